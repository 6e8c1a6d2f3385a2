//! Scenes by rule that the topics share: a field that looks different from every side, a table with
//! slopes everywhere, and views of few pixels.

use volact_core::{Aabb, Camera, FrameDesc, LookupTable, ScalarType, Shape, Volume, VolumeDesc, glam::DVec3};

use crate::{
    rig::Scene,
    scene::{colors, lut, placed},
};

/// Pixels of a picture on a side.
pub const PIXELS: usize = 32;

/// 0 to 100, and like itself along no axis, mirrored by none, swapped with none.
pub fn rule(p: DVec3) -> f64 {
    let v =
        50.0 + 21.0 * (0.9 * p.x + 0.3).sin() + 16.0 * (0.7 * p.y - 0.2 * p.x).cos() + 11.0 * (1.1 * p.z + 0.4).sin();
    v.round().clamp(0.0, 100.0)
}

/// A volume of [`rule`] with spacing 1.
pub fn waves(dims: [usize; 3], scalar: ScalarType) -> Volume {
    placed(VolumeDesc::new(dims, scalar, 1), rule)
}

/// The volume that most cases draw: 7 × 6 × 8 of f32.
pub fn usual() -> Volume {
    waves([7, 6, 8], ScalarType::F32)
}

/// A table over 0 to 100 in four colours, transparent at its low end.
pub fn warm() -> LookupTable {
    colors(&[
        (20.0, [0.1, 0.2, 0.9], 0.0),
        (45.0, [0.2, 0.9, 0.4], 0.08),
        (65.0, [1.0, 0.6, 0.1], 0.35),
        (95.0, [1.0, 0.9, 0.8], 0.7),
    ])
}

/// The usual volume through the usual table.
pub fn shape() -> Shape {
    lut(&usual(), warm(), 1.0)
}

/// The world bounds of shapes.
pub fn bounds(shapes: &[Shape]) -> Aabb {
    shapes.iter().fold(Aabb::EMPTY, |b, s| b.union(&s.state().world_bounds()))
}

/// All shapes from a direction that is along no axis, orthographic.
pub fn around(shapes: impl IntoIterator<Item = Shape>) -> Scene {
    from(shapes, DVec3::new(0.62, -1.0, 0.55))
}

/// All shapes from a direction, orthographic.
pub fn from(shapes: impl IntoIterator<Item = Shape>, towards_eye: DVec3) -> Scene {
    let shapes: Vec<_> = shapes.into_iter().collect();
    let bounds = bounds(&shapes);
    let size = bounds.size().length();
    let up = if towards_eye.normalize().z.abs() < 0.9 { DVec3::Z } else { DVec3::Y };
    let eye = bounds.center() + towards_eye.normalize() * 1.5 * size;
    let camera = Camera::orthographic(eye, bounds.center(), up, 0.93 * size);
    Scene::new(shapes, FrameDesc::new(camera, PIXELS, PIXELS))
}

/// All shapes in perspective, from a direction that is along no axis.
pub fn through(shapes: impl IntoIterator<Item = Shape>) -> Scene {
    let shapes: Vec<_> = shapes.into_iter().collect();
    let bounds = bounds(&shapes);
    let size = bounds.size().length();
    let eye = bounds.center() + DVec3::new(0.6, -1.0, 0.45).normalize() * 1.5 * size;
    Scene::new(shapes, FrameDesc::new(Camera::perspective(eye, bounds.center(), DVec3::Z, 38.0), PIXELS, PIXELS))
}

/// Axes by number.
pub const AXES: [(&str, DVec3); 3] = [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)];

/// What a constant opacity over a unit absorbs over a length.
pub fn absorbed(opacity: f64, length: f64) -> f64 {
    -(length * (-opacity).ln_1p()).exp_m1()
}

/// Premultiplied: straight colour times what is absorbed.
pub fn laid(color: [f64; 3], alpha: f64) -> [f64; 4] {
    [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha]
}

/// One premultiplied colour over another.
pub fn over(front: [f64; 4], back: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|c| front[c] + (1.0 - front[3]) * back[c])
}
