//! Lookup tables: points, entries, ends, steps; when they apply.

use volact_core::{ControlPoint, LookupTable, ScalarType};

use super::stock::{absorbed, around, laid, through, usual, warm};
use crate::{
    case::{Case, Need, Topic},
    rig::{How, Scene},
    scene::{along_y, colors, constant, greys, lut, volume},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("tables", &[Need::Shader("lut")]);
    constants(&mut topic);
    entries(&mut topic);
    pictures(&mut topic);
    interpolation(&mut topic);
    topic.done()
}

/// A constant value through a table, one unit long.
fn constants(topic: &mut Topic) {
    let table = || colors(&[(10.0, [0.9, 0.1, 0.2], 0.2), (20.0, [0.1, 0.5, 0.8], 0.6)]);
    for (name, value, color, opacity) in [
        ("clamped_below", 3.0, [0.9, 0.1, 0.2], 0.2),
        ("at_the_first_point", 10.0, [0.9, 0.1, 0.2], 0.2),
        ("between_points", 15.0, [0.5, 0.3, 0.5], 0.4),
        ("near_the_last_point", 19.0, [0.18, 0.46, 0.74], 0.56),
        ("clamped_above", 1e4, [0.1, 0.5, 0.8], 0.6),
    ] {
        topic.case(name, "linear between points, clamped outside", move |rig| {
            let scene = Scene::new([lut(&constant(value, [1, 1, 1]), table(), 1.0)], along_y(0.5, 0.5));
            rig.pixel("colour", &scene, &How::step(0.25), laid(color, opacity)).map(|_| ())
        });
    }
    topic.case("one_point", "a single point is the same everywhere", |rig| {
        let scene = Scene::new([lut(&constant(7.0, [1, 1, 1]), greys(&[(900.0, 0.3, 0.4)]), 1.0)], along_y(0.5, 0.5));
        rig.pixel("colour", &scene, &How::step(0.25), laid([0.3; 3], 0.4)).map(|_| ())
    });
    for (value, opacity) in [(4.999, 0.1), (5.001, 0.7)] {
        let name = if value < 5.0 { "below_a_step" } else { "above_a_step" };
        topic.case(name, "two points at one value make a step: from it on the second holds", move |rig| {
            let table = greys(&[(0.0, 1.0, 0.1), (5.0, 1.0, 0.1), (5.0, 1.0, 0.7), (9.0, 1.0, 0.7)]);
            let scene = Scene::new([lut(&constant(value, [1, 1, 1]), table, 1.0)], along_y(0.5, 0.5));
            rig.pixel("side", &scene, &How::step(0.25), laid([1.0; 3], opacity)).map(|_| ())
        });
    }
    topic.case("points_in_any_order", "points are sorted by their value", |rig| {
        let point = |value, grey, opacity| ControlPoint { value, color: [grey; 3], opacity };
        let table = LookupTable::from_points(vec![point(20.0, 1.0, 0.6), point(0.0, 0.0, 0.2), point(10.0, 0.5, 0.4)]);
        let shape = lut(&constant(15.0, [1, 1, 1]), table.expect("a table"), 1.0);
        rig.pixel("colour", &Scene::new([shape], along_y(0.5, 0.5)), &How::step(0.25), laid([0.75; 3], 0.5)).map(|_| ())
    });
    topic.case("brighter_than_white", "colours above 1 are kept: no clamp before the end", |rig| {
        let shape = lut(&constant(1.0, [1, 2, 1]), colors(&[(1.0, [3.0, 0.5, 1.5], 0.4)]), 1.0);
        let wanted = laid([3.0, 0.5, 1.5], absorbed(0.4, 2.0));
        rig.pixel("colour", &Scene::new([shape], along_y(0.5, 0.5)), &How::step(0.25), wanted).map(|_| ())
    });
    topic.case("all_transparent", "a table without opacity draws nothing", |rig| {
        let scene = around([lut(&usual(), greys(&[(0.0, 1.0, 0.0), (100.0, 1.0, 0.0)]), 1.0)]);
        rig.closed("nothing", &scene, &How::step(0.3), &|_, _| Some([0.0; 4])).map(|_| ())
    });
}

/// Equidistant entries, any number of them.
fn entries(topic: &mut Topic) {
    for count in [1usize, 2, 3, 5, 17, 256, 1000, 4096] {
        let about = "equidistant entries of any count over a domain, ends included";
        topic.case(format!("entries_{count}"), about, move |rig| {
            let entry = |i: usize| {
                let t = i as f32 / (count.max(2) - 1) as f32;
                [t, 0.5 + 0.5 * (9.0 * t).sin(), 1.0 - t, 0.6 * t * t]
            };
            let data: Vec<[f32; 4]> =
                (0..count).map(|i| if count == 1 { [0.2, 0.4, 0.6, 0.3] } else { entry(i) }).collect();
            let table = LookupTable::from_entries(volact_core::Buffer::from_vec(data), Some([10.0, 90.0]));
            let scene = around([lut(&usual(), table.expect("entries"), 1.0)]);
            rig.because("the bound counts the segments of the longest ray, and few rays are as long");
            rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("entries_over_the_range", "entries without a domain span the texture's range", |rig| {
        let data = vec![[0f32, 0.0, 1.0, 0.0], [1.0, 1.0, 0.0, 0.5], [1.0, 0.0, 0.0, 0.9]];
        let table = LookupTable::from_entries(data, None).expect("entries");
        // Half of u8's range.
        let data = volume([2, 2, 2], ScalarType::U8, |_| 51.0);
        let scene = Scene::new([lut(&data, table, 1.0)], along_y(0.5, 0.5));
        // 51 of 255 is 0.4 of the way to the second entry.
        rig.pixel("colour", &scene, &How::step(0.25), laid([0.4, 0.4, 0.6], 0.2)).map(|_| ())
    });
    topic.case("window_and_level", "a grey ramp from level − window/2 to level + window/2", |rig| {
        let table = LookupTable::window_level(40.0, 60.0, 0.8).expect("a window");
        let scene = Scene::new([lut(&constant(70.0, [1, 1, 1]), table, 1.0)], along_y(0.5, 0.5));
        rig.pixel("colour", &scene, &How::step(0.25), laid([0.75; 3], 0.6)).map(|_| ())
    });
}

fn pictures(topic: &mut Topic) {
    let sharp = || colors(&[(48.0, [1.0, 0.2, 0.1], 0.0), (50.0, [1.0, 0.9, 0.1], 0.6), (52.0, [0.1, 0.2, 1.0], 0.0)]);
    for (name, table) in [
        ("sharp_peak", sharp()),
        ("opaque_above", greys(&[(60.0, 0.1, 0.0), (75.0, 0.9, 1.0)])),
        ("narrow_window", LookupTable::window_level(8.0, 60.0, 0.6).expect("a window")),
        ("falling", colors(&[(20.0, [1.0, 0.5, 0.2], 0.6), (80.0, [0.2, 0.5, 1.0], 0.0)])),
        (
            "two_humps",
            greys(&[(20.0, 0.2, 0.0), (35.0, 0.9, 0.4), (50.0, 0.2, 0.0), (70.0, 0.7, 0.5), (90.0, 1.0, 0.0)]),
        ),
    ] {
        topic.case(name, "a picture agrees with the lattice, whatever the table", move |rig| {
            rig.lattice("picture", &around([lut(&usual(), table.clone(), 1.0)]), &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("in_perspective", "tables know nothing of cameras", |rig| {
        rig.lattice("picture", &through([lut(&usual(), warm(), 1.0)]), &How::step(0.3)).map(|_| ())
    });
}

fn interpolation(topic: &mut Topic) {
    topic.case(
        "pre_interpolated",
        "on request colour and opacity are computed at the voxels, then interpolated",
        |rig| {
            let scene = around([lut(&usual(), warm().pre_interpolated(), 1.0)]);
            rig.because("the bound counts the segments of the longest ray, and few rays are as long");
            rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
        },
    );
    topic.case("pre_interpolated_is_post_where_linear", "identical where the table is linear", |rig| {
        let linear = || colors(&[(0.0, [0.1, 0.9, 0.3], 0.0), (100.0, [0.1, 0.9, 0.3], 0.6)]);
        let (post, pre) =
            (around([lut(&usual(), linear(), 1.0)]), around([lut(&usual(), linear().pre_interpolated(), 1.0)]));
        let (a, b) = (rig.draw(&pre, &How::step(0.3))?, rig.draw(&post, &How::step(0.3))?);
        rig.alike("variant", &pre, &a, &b)
    });
    topic.needing(
        &[Need::Option("classification")],
        "pre_integrated",
        "pre-integration has the truth of its lattice",
        |rig| {
            let table =
                colors(&[(40.0, [1.0, 0.2, 0.1], 0.0), (55.0, [1.0, 0.9, 0.1], 0.5), (70.0, [0.1, 0.2, 1.0], 0.1)]);
            rig.lattice("picture", &around([lut(&usual(), table, 1.0)]), &How::segments(0.6)).map(|_| ())
        },
    );
}
