//! Opaque triangles: the nearest one that a ray meets.
//!
//! A ray along an edge or through a vertex meets one of the triangles there ([`shear`]), so that a
//! closed surface has no pinholes.
//!
//! [`shear`]: super::shear

use volact_core::{Aabb, Bvh, Surface, glam::DVec3};

use super::shear::{Shear, meet};

/// Triangles with a tree over them.
#[derive(Debug)]
pub struct Skin {
    surface: Surface,
    tree: Bvh,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Where on the ray.
    pub t: f64,
    /// The surface's normal there, in object space and of any length.
    pub normal: DVec3,
}

impl Skin {
    /// Makes a surface ready.
    pub fn new(surface: &Surface) -> Self {
        let points = surface.points();
        let around =
            |t: &[u32; 3]| t.iter().map(|&v| points.at(v as usize)).fold(Aabb::EMPTY, |b, p| b.union(&Aabb::new(p, p)));
        let boxes: Vec<Aabb> = surface.triangles().iter().map(around).collect();
        Self { surface: surface.clone(), tree: Bvh::new(&boxes) }
    }

    /// Bytes held besides the surface.
    pub fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    /// The nearest place between two `t` where a line in object space meets the surface, of those
    /// that `keep` accepts.
    pub fn nearest(
        &self,
        origin: DVec3,
        direction: DVec3,
        span: [f64; 2],
        keep: impl Fn(f64) -> bool,
    ) -> Option<Meeting> {
        let shear = Shear::new(origin, direction);
        let mut best: Option<(f64, usize, [f64; 3])> = None;
        self.tree.line(origin, direction, span, |triangle| {
            let corners = self.surface.triangles()[triangle].map(|v| shear.apply(self.surface.points().at(v as usize)));
            let Some(met) = meet(&corners) else { return };
            let (t, weights) = (met.t, met.weights);
            // Of triangles in one place the first counts, in whatever order the tree gives them.
            let nearer = best.is_none_or(|(least, i, _)| t < least || t == least && triangle < i);
            if nearer && span[0] <= t && t <= span[1] && keep(t) {
                best = Some((t, triangle, weights));
            }
        });
        best.map(|(t, triangle, weights)| Meeting { t, normal: self.normal(triangle, weights) })
    }

    fn normal(&self, triangle: usize, weights: [f64; 3]) -> DVec3 {
        let vertices = self.surface.triangles()[triangle].map(|v| v as usize);
        let [a, b, c] = vertices.map(|v| self.surface.points().at(v));
        let flat = (b - a).cross(c - a);
        let Some(normals) = self.surface.normals() else { return flat };
        let smooth: DVec3 = (0..3).map(|i| normals.at(vertices[i]) * weights[i]).sum();
        if smooth.length_squared() > 0.0 { smooth } else { flat }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{Buffer, Points};

    /// An octahedron, met exactly through its vertices, edges and faces: never a hole.
    #[test]
    fn rays_through_vertices_and_edges_meet_a_closed_surface() {
        let vertices = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y, DVec3::Z, -DVec3::Z];
        let mut triangles = Vec::new();
        for i in 0..4u32 {
            triangles.extend([i, (i + 1) % 4, 4, (i + 1) % 4, i, 5]);
        }
        let surface = Surface::new(vertices.into_iter().collect::<Points>(), Buffer::from_vec(triangles)).unwrap();
        let skin = Skin::new(&surface);
        for direction in [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::new(1.0, 1.0, 0.0), DVec3::new(-1.0, 2.0, 3.0)] {
            for shift in [DVec3::ZERO, DVec3::Y * 0.25, DVec3::new(0.25, 0.25, 0.5), DVec3::Z * 0.5] {
                let origin = shift - direction * 5.0;
                let met = skin.nearest(origin, direction, [0.0, 10.0], |_| true).expect("a hit");
                let p = origin + direction * met.t;
                assert!((p.abs().element_sum() - 1.0).abs() < 1e-12, "{direction} {shift}: {p}");
                assert!(met.normal.dot(direction).abs() > 0.0);
                let behind = skin.nearest(origin, direction, [0.0, 10.0], |t| t > met.t + 1e-9);
                assert!(behind.is_some_and(|b| b.t > met.t));
            }
        }
    }
}
