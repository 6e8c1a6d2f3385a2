//! Orders that tests must see: of the step, of the grid, and what supersampling leaves as it is.

use volact_core::{Camera, FrameDesc, LookupTable, ScalarType, Shape, VolumeDesc, glam::DVec3};

use super::stock::{around, from, usual};
use crate::{
    case::{Need, Stop, Topic, Verdict},
    metrics::{rms_error, wide},
    rig::{How, Rig, Scene},
    rules::smooth,
    scene::{cell, colors, greys, lut, placed, square, volume},
    study::{Expected, Study},
};

const STEP: [Need; 1] = [Need::Option("sample_distance")];

/// Lists a case that expects something of an error.
fn study(
    topic: &mut Topic,
    name: &str,
    about: &str,
    expected: Expected,
    run: impl Fn(&mut Rig<'_>, Expected) -> Verdict + Send + Sync + 'static,
) {
    topic.needing(&STEP, name, about, move |rig| run(rig, expected));
    topic.expects(expected);
}

/// One trilinear cell from a direction that is along no axis, seen within.
fn one_cell(shape: Shape) -> Scene {
    let eye = DVec3::splat(0.5) + DVec3::new(9.0, -5.0, 3.0);
    Scene::new([shape], FrameDesc::new(Camera::orthographic(eye, DVec3::splat(0.5), DVec3::Z, 0.7), 16, 16))
}

/// A field that rises along every ray of this view, so that each crosses a step once and none grazes it.
fn rising(table: LookupTable) -> Scene {
    let data = volume([2, 2, 2], ScalarType::F32, |p| {
        let (x, z) = (1.0 - p.x, 1.0 - p.z);
        0.1 + 0.3 * p.y + 0.35 * x * p.y * z + 0.1 * x + 0.1 * z
    });
    Scene::new([lut(&data, table, 0.4)], square(DVec3::splat(0.5), DVec3::new(5.0, -9.0, 6.0), 1.2, 24))
}

/// A step in opacity and colour at 0.4.
fn stepped() -> LookupTable {
    greys(&[(0.0, 0.3, 0.1), (0.4, 0.3, 0.1), (0.4, 0.9, 0.8), (1.0, 0.9, 0.8)])
}

/// The slope of the error over the step, against the certified integral.
pub fn over_steps(topic: &mut Topic) {
    let smooth = || lut(&cell(), greys(&[(0.0, 0.2, 0.1), (1.0, 0.9, 0.9)]), 0.3);
    let steps = [0.25, 0.125, 0.0625, 0.03125];
    let about = "midpoint rule with the exact exponential: order 2";
    study(topic, "midpoint_is_of_second_order", about, Expected::order(2.0, [1.7, 2.4]), move |rig, expected| {
        rig.slope("order", &one_cell(smooth()), &How::default(), &steps, expected)
    });
    let about = "pre-integrated with in-segment attenuation: order 2";
    study(
        topic,
        "pre_integration_is_of_second_order",
        about,
        Expected::order(2.0, [1.7, 2.6]),
        move |rig, expected| rig.slope("order", &one_cell(smooth()), &How::segments(1.0), &steps, expected),
    );
    let about = "a whole picture of several cells: order 2";
    study(topic, "pictures_converge", about, Expected::order(2.0, [1.6, 2.5]), |rig, expected| {
        let table = colors(&[(0.0, [0.2, 0.4, 0.9], 0.02), (100.0, [1.0, 0.6, 0.2], 0.5)]);
        rig.slope("order", &around([lut(&usual(), table, 1.0)]), &How::default(), &[0.5, 0.25, 0.125, 0.0625], expected)
    });
    let about = "corners of a table, narrower than a table of 256 entries resolves: order 2, down to small steps";
    study(topic, "corners_in_tables_are_of_second_order", about, Expected::order(2.0, [1.7, 2.5]), |rig, expected| {
        let spikes = [
            (0.0, 0.3, 0.05),
            (0.2471, 0.3, 0.05),
            (0.2503, 0.9, 0.7),
            (0.2549, 0.2, 0.05),
            (0.4377, 0.2, 0.05),
            (0.4401, 0.8, 0.6),
            (0.4433, 0.3, 0.05),
            (1.0, 0.9, 0.4),
        ];
        let steps = [1.0 / 256.0, 1.0 / 512.0, 1.0 / 1024.0, 1.0 / 2048.0];
        rig.slope("order", &rising(greys(&spikes)), &How::default(), &steps, expected)
    });
    let steps = [0.2, 0.1, 0.05, 0.025, 0.0125];
    let about = "a step in the table: midpoint about 1, and noisy";
    study(
        topic,
        "steps_in_tables_are_of_first_order",
        about,
        Expected::order(1.0, [0.6, 1.5]),
        move |rig, expected| {
            let table = greys(&[(0.0, 0.2, 0.05), (0.4, 0.2, 0.05), (0.4, 0.9, 0.7), (1.0, 0.9, 0.7)]);
            rig.slope("order", &one_cell(lut(&cell(), table, 0.3)), &How::default(), &steps, expected)
        },
    );
    let about = "a step in the table, pre-integrated: order 2";
    let steps = [0.32, 0.16, 0.08, 0.04, 0.02];
    study(
        topic,
        "steps_in_tables_pre_integrated_are_of_second_order",
        about,
        Expected::order(2.0, [1.7, 2.3]),
        move |rig, expected| rig.slope("order", &rising(stepped()), &How::segments(1.0), &steps, expected),
    );
}

/// What finer grids change: by their squared spacing, or nothing where the field is one cell's.
pub fn over_grids(topic: &mut Topic) {
    let about = "finer grids of a smooth field: linear interpolation is of order 2";
    study(topic, "refinement_is_of_second_order", about, Expected::order(2.0, [1.8, 2.2]), refined);
    let about = "one trilinear cell, sampled more and more finely, is the same field: no change";
    study(topic, "supersampled_cell_is_the_same", about, Expected::NoChange, |rig, _| {
        let at = |n: usize| {
            let spacing = DVec3::splat(1.0 / (n - 1) as f64);
            let desc = VolumeDesc { spacing, ..VolumeDesc::new([n; 3], ScalarType::F32, 1) };
            let corners = [0.125, 0.5, 0.375, 0.25, 0.625, 0.25, 0.125, 0.875];
            let field = |p: DVec3| {
                let weight = |i: usize, a: usize| if i >> a & 1 == 1 { p[a] } else { 1.0 - p[a] };
                (0..8).map(|i| corners[i] * weight(i, 0) * weight(i, 1) * weight(i, 2)).sum::<f64>()
            };
            let shape = lut(&placed(desc, |p| field(p * spacing)), greys(&[(0.0, 0.2, 0.1), (1.0, 0.9, 0.9)]), 0.3);
            from([shape], DVec3::new(0.62, -1.0, 0.55))
        };
        let plain = rig.draw(&at(2), &How::step(0.04))?;
        for n in [3, 9, 33, 65] {
            let scene = at(n);
            let frame = rig.draw(&scene, &How::step(0.04))?;
            rig.alike(&format!("{n} samples along an axis"), &scene, &frame, &plain)?;
        }
        Ok(())
    });
}

/// A smooth field, no grid's.
fn field(p: DVec3) -> f64 {
    0.5 + 0.4 * (4.0 * p.x + 5.0 * p.y + 0.3).sin() * (3.0 * p.z - 2.0 * p.y).cos()
}

/// Pixels of the picture of [`field`] on a side.
const PIXELS: usize = 5;

fn refined(rig: &mut Rig<'_>, expected: Expected) -> Verdict {
    rig.steps_are_free()?;
    let table = greys(&[(0.0, 0.1, 0.05), (1.0, 0.9, 0.85)]);
    let camera = Camera::orthographic(DVec3::new(0.5, -9.0, 0.5), DVec3::splat(0.5), DVec3::Z, 1.0);
    let desc = FrameDesc::new(camera, PIXELS, PIXELS);
    let (wanted, mut errors, mut last) = (integrals(), Vec::new(), None);
    for n in [5usize, 9, 17, 33] {
        let spacing = DVec3::splat(1.0 / (n - 1) as f64);
        let data = VolumeDesc { spacing, ..VolumeDesc::new([n; 3], ScalarType::F32, 1) };
        let scene = Scene::new([lut(&placed(data, |p| field(p * spacing)), table.clone(), 0.5)], desc.clone());
        let frame = rig.draw(&scene, &How::step(1.0 / 512.0))?;
        errors.push([spacing.x, rms_error(&wide(&frame), &wanted)]);
        last = Some(scene);
    }
    let scene = last.ok_or_else(|| Stop::Fail("no grid was drawn".into()))?;
    rig.order("order", Study::of("grid spacing", errors), expected, "the field's own integral", &scene);
    Ok(())
}

/// What rays along y through the pixels' centres meet: the table is linear, with a unit of a half.
fn integrals() -> Vec<[f64; 4]> {
    let place = |i: usize| (i as f64 + 0.5) / PIXELS as f64;
    let at = |row: usize, column: usize| {
        let medium = |y: f64| {
            let v = field(DVec3::new(place(column), y, 1.0 - place(row)));
            [0.1 + 0.8 * v, 1.0 - (1.0 - (0.05 + 0.8 * v)).powi(2)]
        };
        let [grey, alpha] = smooth(&medium, 1.0);
        [grey, grey, grey, alpha]
    };
    (0..PIXELS * PIXELS).map(|i| at(i / PIXELS, i % PIXELS)).collect()
}
