//! All compositings, slice planes and overlaps, held to `reference` on planes.

use volact_core::{SliceStyle, Sliced, Slices};

use super::*;

const STEP: f64 = 0.31;

/// A block of a shader, somewhere else than [`block`].
fn other(shader: &str) -> Shape {
    let name = if shader == "isosurface" { "surfaces" } else { "lookup_table" };
    let mut look = Appearance::new(shader).with(name, table());
    if matches!(shader, "lut" | "xray") {
        look = look.with("unit_distance", if shader == "lut" { 1.5 } else { 9.0 });
    }
    let shape = Shape::around(&data(ScalarType::F32), look);
    shape.set_transform(
        DAffine3::from_translation(DVec3::new(2.0, -1.5, 1.0)) * block(ScalarType::U8).state().transform,
    );
    shape
}

/// A frame with something opaque of which light is left behind it.
fn behind(frame: FrameDesc) -> FrameDesc {
    let pixels = frame.width * frame.height;
    let distance: Vec<f32> = (0..pixels).map(|i| if i % 3 == 0 { 21.0 } else { f32::INFINITY }).collect();
    let color: Vec<[f32; 4]> = (0..pixels).map(|i| [0.2, 0.1, (i % 5) as f32 * 0.1, 0.8]).collect();
    frame.with_opaque(Opaque { color: Some(color.into()), depth: OpaqueDepth::Distance(distance.into()) })
}

pub fn agree(action: &mut dyn RenderAction, what: &str, shapes: &[Shape], frame: &FrameDesc, least: f32) {
    let (wanted, depth) = planes(shapes, frame, STEP);
    let made = draw(action, shapes, frame);
    let error = worst(&made, &wanted);
    assert!(error < TOLERANCE, "{what}: {error:e}");
    assert!(made.color.iter().any(|p| p[3] > least), "{what}: nothing is seen");
    for (found, wanted) in made.depth.iter().zip(&depth) {
        let far = (f64::from(*found) - wanted).abs();
        assert!(wanted.is_infinite() || found.is_infinite() || far < 1e-3, "{what}: {found} {wanted}");
    }
    shapes.iter().for_each(|s| action.unmanage(s).unwrap());
}

#[test]
fn pictures_of_their_own_are_laid_over_the_rest_in_order() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    for (number, frame) in views().into_iter().enumerate() {
        for name in ["mip", "minip", "average", "xray"] {
            let what = format!("{name}, view {number}");
            agree(&mut *action, &what, &[other(name)], &frame, 0.05);
            let several = [other(name), block(ScalarType::U8), block_of("mip")];
            agree(&mut *action, &format!("{what}, with others"), &several, &behind(frame.clone()), 0.5);
        }
    }
}

fn block_of(shader: &str) -> Shape {
    let shape = other(shader);
    shape.set_transform(block(ScalarType::U8).state().transform);
    shape
}

#[test]
fn surfaces_of_values_lie_in_the_depth_of_the_rest() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    for (number, frame) in views().into_iter().enumerate() {
        agree(&mut *action, &format!("view {number}"), &[other("isosurface")], &frame, 0.2);
        let both = [other("isosurface"), block(ScalarType::U8)];
        agree(&mut *action, &format!("view {number}, with a haze"), &both, &behind(frame), 0.5);
    }
}

#[test]
fn slice_planes_lie_in_the_depth_of_the_rest() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    for style in [SliceStyle::Opaque, SliceStyle::Blended] {
        for volume in [false, true] {
            let shape = block(ScalarType::U8);
            let planes = [(DVec3::Y, 3.3), (DVec3::X, 4.7)].map(|(n, at)| Plane::new(n * at, n).unwrap());
            let slices = Slices { planes: planes.to_vec(), style, volume };
            shape.set_geometry(Sliced::new(shape.state().geometry, slices).unwrap());
            for (number, frame) in views().into_iter().enumerate() {
                let what = format!("{style:?}, inside {volume}, view {number}");
                agree(&mut *action, &what, std::slice::from_ref(&shape), &frame, 0.1);
                agree(&mut *action, &format!("{what}, overlapping"), &[shape.clone(), other("lut")], &frame, 0.3);
            }
        }
    }
}

/// Shapes that overlap share their runs, so that what they make together is no matter of turns.
#[test]
fn overlapping_shapes_are_those_of_the_reference_on_planes() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    let apart = block(ScalarType::I16);
    apart.set_transform(DAffine3::from_translation(DVec3::new(-3.0, 14.0, -2.0)) * apart.state().transform);
    let shapes = [apart, block(ScalarType::U8), other("lut")];
    for (number, frame) in views().into_iter().enumerate() {
        agree(&mut *action, &format!("view {number}"), &shapes, &behind(frame), 0.5);
        let swapped: Vec<Shape> = shapes.iter().rev().cloned().collect();
        let frame = &views()[number];
        assert_eq!(draw(&mut *action, &swapped, frame).color, draw(&mut *action, &shapes, frame).color);
        shapes.iter().for_each(|s| action.unmanage(s).unwrap());
    }
}
