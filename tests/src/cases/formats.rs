//! Formats and ranges: scalar types, slope and intercept, components, what 0 and 1 are.

use volact_core::{Appearance, Buffer, ScalarType, Shape, Volume, VolumeDesc, VolumeTexture, glam::DVec3};

use super::stock::{around, rule, warm, waves};
use crate::{
    case::{Case, Need, Topic},
    rig::{How, Scene},
    scene::{along_y, constant, encode, greys, look, lut, placed, values, volume},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("formats", &[]);
    scalars(&mut topic);
    rescaled(&mut topic);
    components(&mut topic);
    ranges(&mut topic);
    offsets(&mut topic);
    topic.done()
}

const LUT: &[Need] = &[Need::Shader("lut")];
const SIMPLE: &[Need] = &[Need::Shader("simple")];

fn scalars(topic: &mut Topic) {
    for scalar in ScalarType::ALL {
        let about = "every scalar type draws the same values alike";
        topic.needing(LUT, format!("values_of_{scalar}"), about, move |rig| {
            let scene = around([lut(&waves([6, 5, 7], scalar), warm(), 1.0)]);
            rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
        });
    }
    for scalar in ScalarType::ALL.into_iter().filter(|s| s.limits().is_some_and(|l| l[0] < 0.0)) {
        let about = "signed numbers are signed";
        topic.needing(LUT, format!("negative_values_of_{scalar}"), about, move |rig| {
            let data = volume([4, 4, 4], scalar, |p| 20.0 * p.x - 30.0 - 10.0 * p.z);
            let table = greys(&[(-60.0, 0.9, 0.5), (-10.0, 0.2, 0.0), (30.0, 0.6, 0.3)]);
            rig.lattice("picture", &around([lut(&data, table, 1.0)]), &How::step(0.3)).map(|_| ())
        });
    }
    for scalar in ScalarType::ALL.into_iter().filter(|s| s.limits().is_some()) {
        let about = "the whole range of an integer type is 0 to 1";
        topic.needing(SIMPLE, format!("type_range_of_{scalar}"), about, move |rig| {
            let [lo, hi] = scalar.limits().unwrap_or([0.0, 1.0]);
            // A quarter of the way up, in a number that the type holds.
            let stored = (lo + 0.25 * (hi - lo)).round();
            let v = (stored - lo) / (hi - lo);
            let desc = VolumeDesc::new([2, 2, 2], scalar, 1);
            let data = Volume::new(desc, Buffer::from_vec(encode(scalar, &[stored; 8]))).expect("a volume");
            let shape = Shape::around(&data, Appearance::new("simple").with("unit_distance", 1.0));
            rig.pixel("grey", &Scene::new([shape], along_y(0.5, 0.5)), &How::step(0.25), [v * v, v * v, v * v, v])
                .map(|_| ())
        });
    }
}

fn rescaled(topic: &mut Topic) {
    let about = "samples are interpolated in data units, after slope and intercept";
    for (name, scalar, slope, intercept) in [
        ("i16_as_hounsfield", ScalarType::I16, 0.5, -20.0),
        ("u8_upside_down", ScalarType::U8, -1.0, 100.0),
        ("u16_small_slope", ScalarType::U16, 1.0 / 64.0, 0.0),
        ("f32_shifted", ScalarType::F32, 2.0, 7.0),
    ] {
        topic.needing(LUT, format!("rescaled_{name}"), about, move |rig| {
            let desc = VolumeDesc { slope, intercept, ..VolumeDesc::new([6, 5, 7], scalar, 1) };
            let data = placed(desc, |p| (rule(p) - intercept) / slope);
            rig.lattice("picture", &around([lut(&data, warm(), 1.0)]), &How::step(0.3)).map(|_| ())
        });
    }
}

const STORED: [f64; 4] = [51.0, 102.0, 153.0, 204.0];

fn solid(n: usize) -> VolumeTexture {
    let all: Vec<_> = (0..8).flat_map(|_| STORED[..n].to_vec()).collect();
    let bytes = Buffer::from_vec(encode(ScalarType::U8, &all));
    VolumeTexture::new(&Volume::new(VolumeDesc::new([2; 3], ScalarType::U8, n), bytes).expect("a volume"))
}

fn components(topic: &mut Topic) {
    let v = STORED.map(|s| s / 255.0);
    for (name, texture, [r, g, b, a]) in [
        ("one_component_is_grey_and_opacity", solid(1), [v[0]; 4]),
        ("luminance_is_opaque_grey", solid(1).as_luminance(), [v[0], v[0], v[0], 1.0]),
        ("two_components_are_grey_and_opacity", solid(2), [v[0], v[0], v[0], v[1]]),
        ("three_components_are_opaque_colour", solid(3), [v[0], v[1], v[2], 1.0]),
        ("four_components_are_colour_and_opacity", solid(4), v),
    ] {
        topic.needing(SIMPLE, name, "components mean what their number says", move |rig| {
            let shape = Shape::around_texture(&texture, Appearance::new("simple").with("unit_distance", 1.0));
            rig.pixel("colour", &Scene::new([shape], along_y(0.5, 0.5)), &How::step(0.4), [r * a, g * a, b * a, a])
                .map(|_| ())
        });
    }
    for n in [2usize, 3, 4] {
        topic.needing(
            SIMPLE,
            format!("picture_of_{n}_components"),
            "each component is interpolated on its own",
            move |rig| {
                let dims = [5, 4, 6];
                let parts: Vec<_> =
                    (0..n).map(|c| values(dims, |p| 2.5 * rule(p + DVec3::splat(1.7 * c as f64)))).collect();
                let all: Vec<_> = (0..parts[0].len()).flat_map(|i| parts.iter().map(move |p| p[i])).collect();
                let bytes = Buffer::from_vec(encode(ScalarType::U8, &all));
                let data = Volume::new(VolumeDesc::new(dims, ScalarType::U8, n), bytes).expect("a volume");
                let shape = Shape::around(&data, Appearance::new("simple").with("unit_distance", 2.0));
                rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
            },
        );
    }
    for component in 0..2i64 {
        topic.needing(
            LUT,
            format!("table_reads_component_{component}"),
            "a table reads the component named",
            move |rig| {
                let dims = [5, 4, 6];
                let (one, two) = (values(dims, rule), values(dims, |p| 100.0 - rule(p + DVec3::ONE)));
                let pairs: Vec<_> = one.into_iter().zip(two).flat_map(|(a, b)| [a, b]).collect();
                let bytes = Buffer::from_vec(encode(ScalarType::I16, &pairs));
                let data = Volume::new(VolumeDesc::new(dims, ScalarType::I16, 2), bytes).expect("a volume");
                let shape = lut(&data, warm(), 1.0);
                shape.set_parameter("component", component);
                rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
            },
        );
    }
}

fn ranges(topic: &mut Topic) {
    for (name, range, value) in [
        ("upper_half", [0.0, 102.0], 0.5),
        ("upside_down", [102.0, 0.0], 0.5),
        ("clamped_above", [0.0, 25.5], 1.0),
        ("clamped_below", [102.0, 204.0], 0.0),
    ] {
        topic.needing(
            SIMPLE,
            format!("range_{name}"),
            "the texture's range says which values are 0 and 1",
            move |rig| {
                let texture = solid(1).with_range(range).expect("a range");
                let shape = Shape::around_texture(&texture, Appearance::new("simple").with("unit_distance", 1.0));
                let wanted = if value == 1.0 { [1.0; 4] } else { [value * value, value * value, value * value, value] };
                rig.pixel("grey", &Scene::new([shape], along_y(0.5, 0.5)), &How::step(0.4), wanted).map(|_| ())
            },
        );
    }
    topic.needing(SIMPLE, "range_of_floats_is_that_of_the_data", "floats take the data's own range", |rig| {
        let data = volume([2, 2, 2], ScalarType::F32, |p| 10.0 + 30.0 * p.x);
        let shape = Shape::around(&data, Appearance::new("simple").with("unit_distance", 1.0));
        // At x = 0.25 of 10 to 40.
        let v = 0.25;
        let wanted = [v * v, v * v, v * v, v];
        rig.pixel("grey", &Scene::new([shape], along_y(0.25, 0.5)), &How::step(0.25), wanted).map(|_| ())
    });
    topic.needing(SIMPLE, "range_of_one_value_is_one_unit_wide", "a single value is the low end", |rig| {
        let shape = Shape::around(&constant(7.0, [1, 1, 1]), Appearance::new("simple").with("unit_distance", 1.0));
        let scene = Scene::new([shape], along_y(0.5, 0.5));
        rig.pixel("nothing", &scene, &How::step(0.25), [0.0; 4]).map(|_| ())
    });
}

fn offsets(topic: &mut Topic) {
    for (name, scalar, offset) in [("f64_at_1e7", ScalarType::F64, 1e7), ("u32_at_4e9", ScalarType::U32, 4e9)] {
        let about = "fine data on a large offset keep their detail";
        topic.needing(LUT, format!("offset_{name}"), about, move |rig| {
            let data = volume([5, 6, 7], scalar, |p| offset + rule(p));
            let table = greys(&[(offset + 20.0, 0.1, 0.0), (offset + 90.0, 0.9, 0.7)]);
            let appearance = look("lut", table, 1.0);
            let scene = around([Shape::around(&data, appearance)]);
            let frame = rig.draw(&scene, &How::step(0.3))?;
            rig.on_lattice("picture", &scene, &frame)
        });
    }
}
