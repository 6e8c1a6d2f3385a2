//! Vertices in the space of a picture's rays.
//!
//! Columns, rows and depth are the axes: (X, Y, Z) with the pixel at X/Z, Y/Z in a perspective
//! view and at X, Y in a parallel one. A ray at offset (p, q) then passes vertices at
//! x = X − p·Z + b, y = Y − q·Z + c. Positions are f32 relative to a reference near what is seen,
//! so that neither a distant eye nor a narrow view costs digits; b and c are found in f64.

use volact_core::{
    Aabb, Points,
    camera::LinearRays,
    glam::{DAffine3, DMat3, DVec3},
};

use super::super::{packet::SIDE, simd::LANES};

/// A picture's rays as axes of a space.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Object space to (X, Y, Z), relative to the reference and scaled.
    map: DAffine3,
    /// The reference, scaled.
    pub reference: DVec3,
    /// The middle of the viewport in pixels, from which offsets count; 0 in a parallel view.
    pub middle: [f64; 2],
    /// −1 where Y runs against the rows: the space is left-handed, so that faces turned towards
    /// the eye turn from X to Y.
    pub turn: f64,
    perspective: bool,
    /// What Z has been multiplied by.
    scale: f64,
    world: LinearRays,
}

/// Sixteen rays in that space.
#[derive(Clone, Copy, Debug)]
pub struct Slopes {
    /// −p and −q.
    pub slope: [[f32; LANES]; 2],
    /// b and c.
    pub shift: [[f32; LANES]; 2],
    /// `t` where Z is 0, relative to the reference.
    pub zero: [f64; LANES],
    /// World length of one Z.
    pub length: [f64; LANES],
}

impl View {
    /// The space of rays for what lies in a box of object space; `None` where the shape's map or
    /// the camera is too flat for f64.
    pub fn new(rays: &LinearRays, size: [usize; 2], to_world: &DAffine3, bounds: &Aabb) -> Option<Self> {
        let perspective = rays.eye.is_some();
        let middle = if perspective { size.map(|n| n as f64 / 2.0) } else { [0.0; 2] };
        let ahead = rays.corner + rays.dx * middle[0] + rays.dy * middle[1];
        let (origin, depth) = match rays.eye {
            Some(eye) => (eye, ahead),
            None => (rays.corner, rays.direction),
        };
        let handed = DMat3::from_cols(rays.dx, rays.dy, depth).determinant() * to_world.matrix3.determinant();
        let turn = if handed > 0.0 { -1.0 } else { 1.0 };
        let inverse = DMat3::from_cols(rays.dx, rays.dy * turn, depth).inverse();
        let whole = DAffine3::from_mat3(inverse) * DAffine3::from_translation(-origin) * *to_world;
        let seen = bounds.corners().map(|c| whole.transform_point3(c));
        let seen = seen.iter().fold(Aabb::EMPTY, |b, &p| Aabb { min: b.min.min(p), max: b.max.max(p) });
        if !(whole.is_finite() && seen.min.is_finite() && seen.max.is_finite()) {
            return None;
        }
        let reference = reference(&seen, size, perspective, turn);
        let reach = (seen.max.z - reference.z).max(reference.z - seen.min.z).max(f64::MIN_POSITIVE);
        // A power of two, so that scaling does not round.
        let scale = (-reach.log2().ceil()).clamp(-1000.0, 1000.0).exp2();
        let scales = if perspective { DVec3::splat(scale) } else { DVec3::new(1.0, 1.0, scale) };
        let map = DAffine3::from_scale(scales) * DAffine3::from_translation(-reference) * whole;
        Some(Self { map, reference: reference * scales, middle, turn, perspective, scale, world: *rays })
    }

    /// Whether rays leave an eye, behind which nothing is seen.
    pub fn perspective(&self) -> bool {
        self.perspective
    }

    /// A point in this space.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.map.transform_point3(point)
    }

    /// The rays of the pixels `x..x + 4`, `y..y + 4`.
    #[inline(always)]
    pub fn slopes(&self, [x, y]: [usize; 2]) -> Slopes {
        let mut made =
            Slopes { slope: [[0.0; LANES]; 2], shift: [[0.0; LANES]; 2], zero: [0.0; LANES], length: [0.0; LANES] };
        let (w, middle, r) = (&self.world, self.middle, self.reference);
        for l in 0..LANES {
            let pixel = [(x + l % SIDE) as f64 + 0.5, (y + l / SIDE) as f64 + 0.5];
            let (p, q) = (pixel[0] - middle[0], self.turn * (pixel[1] - middle[1]));
            if self.perspective {
                let plane = [0, 1, 2].map(|a| w.corner[a] + w.dx[a] * pixel[0] + w.dy[a] * pixel[1]);
                let length = (plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2]).sqrt() / self.scale;
                (made.slope[0][l], made.slope[1][l]) = (-p as f32, -q as f32);
                (made.shift[0][l], made.shift[1][l]) = ((r.x - p * r.z) as f32, (r.y - q * r.z) as f32);
                (made.zero[l], made.length[l]) = (length * r.z, length);
            } else {
                let plane = w.corner + w.dx * pixel[0] + w.dy * pixel[1];
                (made.shift[0][l], made.shift[1][l]) = ((r.x - p) as f32, (r.y - q) as f32);
                (made.zero[l], made.length[l]) = (w.direction.dot(plane) + r.z / self.scale, 1.0 / self.scale);
            }
        }
        made
    }

    /// All vertices, each with a number.
    pub fn project(&self, points: &Points, numbers: &[f32], threads: usize) -> Vec<[f32; 4]> {
        let count = points.len().min(numbers.len());
        let mut made = vec![[0f32; 4]; count];
        let part = count.div_ceil(threads.max(1)).max(4096);
        std::thread::scope(|scope| {
            let mut rest = made.chunks_mut(part).enumerate();
            let first = rest.next();
            for (i, out) in rest {
                scope.spawn(move || self.project_part(points, numbers, i * part, out));
            }
            if let Some((i, out)) = first {
                self.project_part(points, numbers, i * part, out);
            }
        });
        made
    }

    fn project_part(&self, points: &Points, numbers: &[f32], from: usize, out: &mut [[f32; 4]]) {
        let end = from + out.len();
        let mut put = |i: usize, p: DVec3| {
            let p = self.apply(p);
            out[i] = [p.x as f32, p.y as f32, p.z as f32, numbers[from + i]];
        };
        if let Some(points) = points.data().as_slice::<[f32; 3]>().filter(|_| points.scalar().size() == 4) {
            points[from..end].iter().enumerate().for_each(|(i, p)| put(i, DVec3::from_array(p.map(f64::from))));
        } else {
            (from..end).for_each(|v| put(v - from, points.at(v)));
        }
    }
}

/// A point of the space near what is seen of a box: the eye, where it is close.
fn reference(seen: &Aabb, size: [usize; 2], perspective: bool, turn: f64) -> DVec3 {
    let close = seen.min.z < 0.5 * (seen.max.z - seen.min.z);
    if perspective && close {
        return DVec3::ZERO;
    }
    let mut at = seen.center();
    for a in 0..2 {
        let (low, high) = if perspective {
            let reach = size[a] as f64 / 2.0 * seen.max.z;
            (-reach, reach)
        } else if a == 1 && turn < 0.0 {
            (-(size[a] as f64), 0.0)
        } else {
            (0.0, size[a] as f64)
        };
        let (low, high) = (seen.min[a].max(low), seen.max[a].min(high));
        if low <= high {
            at[a] = 0.5 * (low + high);
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{Camera, Viewport, glam::DMat4};

    #[test]
    fn vertices_on_a_ray_lie_at_its_offset_and_depth() {
        let size = [37, 23];
        let viewport = Viewport { x: 0, y: 0, width: size[0], height: size[1] };
        let mirrored = DAffine3::from_scale(DVec3::new(-2.0, 1.0, 0.5)) * DAffine3::from_rotation_x(0.4);
        let (eye, up) = (DVec3::new(3.0, -4.0, 2.0), DVec3::Z);
        let off_axis = Camera::Matrices {
            view: volact_core::glam::dcamera::rh::view::look_at_mat4(eye, DVec3::ZERO, up),
            projection: DMat4::from_translation(DVec3::new(0.3, -0.2, 0.0))
                * volact_core::glam::dcamera::rh::proj::directx::perspective(0.7, 37.0 / 23.0, 0.5, 50.0),
            depth: Default::default(),
        };
        for camera in
            [Camera::perspective(eye, DVec3::ZERO, up, 35.0), Camera::orthographic(eye, DVec3::ZERO, up, 3.0), off_axis]
        {
            for to_world in [DAffine3::IDENTITY, mirrored] {
                let grid = camera.rays(&viewport).unwrap();
                let bounds = Aabb::new(-DVec3::ONE, DVec3::ONE);
                let view = View::new(&grid.linear(), size, &to_world, &bounds).unwrap();
                for at in [[0, 0], [16, 12], [32, 20]] {
                    let slopes = view.slopes(at);
                    for l in [0, 5, 15] {
                        let ray = grid.ray((at[0] + l % 4) as f64 + 0.5, (at[1] + l / 4) as f64 + 0.5);
                        for t in [2.0, 5.0] {
                            let p = view.apply(to_world.inverse().transform_point3(ray.at(t)));
                            let offset = |a: usize, v: f64| {
                                v + f64::from(slopes.slope[a][l]) * p.z + f64::from(slopes.shift[a][l])
                            };
                            assert!(offset(0, p.x).abs() < 1e-4 && offset(1, p.y).abs() < 1e-4, "{at:?} {l}");
                            assert!((slopes.zero[l] + slopes.length[l] * p.z - t).abs() < 1e-9);
                        }
                    }
                }
                // A triangle that faces the eye turns from X to Y.
                let ray = grid.ray(18.5, 11.5);
                let back = to_world.inverse();
                let side = ray.direction.any_orthonormal_vector();
                let flip = if to_world.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
                let corners = [DVec3::ZERO, side * 0.01, ray.direction.cross(side) * -0.01 * flip];
                let [a, b, c] = corners.map(|c| view.apply(back.transform_point3(ray.at(4.0) + c)));
                let scale = if view.perspective() { a.z + view.reference.z } else { 1.0 };
                let area = (b - a).truncate().perp_dot((c - a).truncate()) / scale;
                assert!(area > 0.0, "{area}");
            }
        }
    }
}
