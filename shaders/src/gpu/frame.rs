//! What is the same for all rays of a frame: the camera and the lattice, seen from an anchor near the
//! scene.
//!
//! Segments of the lattice are counted from the eye, or from the plane through the world's origin, and
//! single precision has no digits for that far away. So the host counts, in f64, up to the border of a
//! segment near the middle of the scene: the *anchor* is the point of one pixel's ray there, and all
//! places on all rays are counted from it. The number of that border is a multiple of 32, so that the
//! borders at which rays may end stay those of the whole lattice.

use bytemuck::{Pod, Zeroable};
use volact_core::{Aabb, RayGrid, Viewport, camera::LinearRays, glam::DVec3};

/// Beyond this a number means that there is no plane.
const FAR: f64 = 1e37;

/// The frame's numbers as the shaders read them (`VolactFrame`).
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[expect(missing_docs, reason = "library.wgsl says it")]
pub struct FrameNumbers {
    pub toward: [f32; 3],
    pub start: f32,
    pub dx: [f32; 3],
    pub perspective: f32,
    pub dy: [f32; 3],
    pub step: f32,
    pub axis: [f32; 3],
    pub step_rest: f32,
    pub near: f32,
    pub far: f32,
    pub first: f32,
    pub depth_shift: f32,
    pub anchor: [f32; 2],
    pub size: [u32; 2],
    pub limited: u32,
    pub threshold: f32,
    pub termination: f32,
    pub infinity: f32,
    pub first_row: u32,
    pub probe: u32,
    pub surfaces: [u32; 2],
}

/// The point from which places are counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Where it is in the world.
    pub point: DVec3,
    /// Where it is on its ray, from where the lattice is counted.
    pub t: f64,
    /// What a frame's depths have less than the rays' own `t`.
    pub depth_zero: f64,
    rays: LinearRays,
    toward: DVec3,
    dx: DVec3,
    dy: DVec3,
    pixel: [f64; 2],
    size: [u32; 2],
    step: f64,
}

impl Anchor {
    /// The anchor for a scene with these bounds and a lattice of this step.
    pub fn new(grid: &RayGrid, viewport: &Viewport, bounds: &Aabb, step: f64) -> Self {
        let rays = grid.linear();
        let center = 0.5 * (bounds.min + bounds.max);
        let size = [viewport.width as f64, viewport.height as f64];
        let seen = center - rays.eye.unwrap_or(DVec3::ZERO);
        let pixel = pixel_of(&rays, seen, size);
        let plane = rays.corner + rays.dx * pixel[0] + rays.dy * pixel[1];
        let border = |t: f64| 32.0 * (t / (32.0 * step)).round() * step;
        let made = |toward, t: f64, point, [dx, dy]: [DVec3; 2]| Self {
            point,
            t,
            depth_zero: rays.depth_zero,
            rays,
            toward,
            dx,
            dy,
            pixel,
            size: size.map(|n| n as u32),
            step,
        };
        match rays.eye {
            Some(eye) => {
                let length = plane.length();
                let toward = plane / length;
                let t = border(toward.dot(seen).max(0.0));
                made(toward, t, eye + toward * t, [rays.dx / length, rays.dy / length])
            }
            None => {
                let toward = rays.direction;
                let across = |v: DVec3| v - toward * v.dot(toward);
                let t = border(toward.dot(center));
                made(toward, t, across(plane) + toward * t, [across(rays.dx), across(rays.dy)])
            }
        }
    }

    /// The frame's numbers. What is the action's own is left at nothing.
    pub fn numbers(&self) -> FrameNumbers {
        let single = |v: DVec3| v.as_vec3().to_array();
        let plane = |offset: f64| (offset - self.rays.axis.dot(self.point)).clamp(-FAR, FAR) as f32;
        let perspective = self.rays.eye.is_some();
        FrameNumbers {
            toward: single(self.toward),
            start: self.t as f32,
            dx: single(self.dx),
            perspective: f32::from(u8::from(perspective)),
            dy: single(self.dy),
            step: self.step as f32,
            axis: single(self.rays.axis),
            step_rest: (self.step - f64::from(self.step as f32)) as f32,
            near: plane(self.rays.near),
            far: plane(self.rays.far),
            first: if perspective { -self.t as f32 } else { -FAR as f32 },
            depth_shift: (self.t - self.depth_zero) as f32,
            anchor: self.pixel.map(|v| v as f32),
            size: self.size,
            infinity: f32::INFINITY,
            probe: 4,
            ..FrameNumbers::zeroed()
        }
    }
}

/// The centre of the pixel through which a point is seen, that of the viewport's middle where it is
/// not; `seen` is counted from the eye.
fn pixel_of(rays: &LinearRays, seen: DVec3, [width, height]: [f64; 2]) -> [f64; 2] {
    let middle = [width / 2.0, height / 2.0];
    let (dx, dy) = (rays.dx, rays.dy);
    let normal = dx.cross(dy);
    let on_plane = match rays.eye {
        Some(_) => {
            let scale = rays.corner.dot(normal) / seen.dot(normal);
            (scale > 0.0).then_some(seen * scale)
        }
        None => Some(seen),
    };
    let solve = |point: DVec3| {
        // Along the rays of a parallel view a point may lie anywhere.
        let across = |v: DVec3| if rays.eye.is_some() { v } else { v - rays.direction * v.dot(rays.direction) };
        let (d, a, b) = (across(point - rays.corner), across(dx), across(dy));
        let [aa, ab, bb] = [a.dot(a), a.dot(b), b.dot(b)];
        let [da, db] = [d.dot(a), d.dot(b)];
        let scale = aa * bb - ab * ab;
        [(da * bb - db * ab) / scale, (db * aa - da * ab) / scale]
    };
    let found = on_plane.map_or(middle, solve);
    let inside = |v: f64, middle: f64, n: f64| if v.is_finite() { v.clamp(0.0, n) } else { middle };
    [inside(found[0], middle[0], width), inside(found[1], middle[1], height)].map(|v| v.floor() + 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::Camera;

    /// Rays as the shader makes them, in f32.
    fn ray(n: &FrameNumbers, x: f32, y: f32) -> [DVec3; 2] {
        let v = |a: [f32; 3]| volact_core::glam::Vec3::from_array(a);
        let e = (x - n.anchor[0]) * v(n.dx) + (y - n.anchor[1]) * v(n.dy);
        let toward = v(n.toward);
        let (mut start, mut direction) = (e, toward);
        if n.perspective != 0.0 {
            let more = 2.0 * toward.dot(e) + e.dot(e);
            let size = (1.0 + more).sqrt();
            let change = e / size - toward * (more / (size * (1.0 + size)));
            (start, direction) = (n.start * change, toward + change);
        }
        [start.as_dvec3(), direction.as_dvec3()]
    }

    #[test]
    fn rays_keep_their_digits_however_far_the_eye_is() {
        let viewport = Viewport { x: 0, y: 0, width: 64, height: 48 };
        for far in [2.0, 1e3, 1e7] {
            for shift in [0.0, 1e7] {
                let target = DVec3::splat(shift);
                let eye = target + DVec3::new(0.3, -0.9, 0.2) * far;
                let perspective = Camera::perspective(eye, target, DVec3::Z, 2.0_f64.atan2(far).to_degrees());
                for camera in [perspective, Camera::orthographic(eye, target, DVec3::Z, 2.0)] {
                    let grid = camera.rays(&viewport).unwrap();
                    let bounds = Aabb::new(target - DVec3::ONE, target + DVec3::ONE);
                    let anchor = Anchor::new(&grid, &viewport, &bounds, 0.01);
                    let numbers = anchor.numbers();
                    for (x, y) in [(0.5, 0.5), (63.5, 20.5), (31.5, 47.5)] {
                        let wanted = grid.ray(x, y);
                        let [start, direction] = ray(&numbers, x as f32, y as f32);
                        for t in [-1.0, 0.0, 1.0] {
                            let found = anchor.point + start + direction * t;
                            let miss = (found - wanted.at(anchor.t + t)).length();
                            // f32 over a scene of size 2, and what f64 has left of the eye's place.
                            assert!(miss < 1e-6 + 4e-16 * (far + shift), "{far} {shift} {x} {y} {t}: {miss}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn anchors_lie_on_every_32nd_border() {
        let viewport = Viewport { x: 0, y: 0, width: 8, height: 8 };
        let camera = Camera::perspective(DVec3::new(0.0, -9.0, 0.0), DVec3::ZERO, DVec3::Z, 30.0);
        let bounds = Aabb::new(-DVec3::ONE, DVec3::ONE);
        let anchor = Anchor::new(&camera.rays(&viewport).unwrap(), &viewport, &bounds, 0.1);
        let k = anchor.t / 3.2;
        assert!((k - k.round()).abs() < 1e-12 && (anchor.t - 9.0).abs() < 1.7, "{}", anchor.t);
    }
}
