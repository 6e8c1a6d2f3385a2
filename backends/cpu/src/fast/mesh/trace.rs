//! The crossings of one ray with tetrahedra, in f64: for what the vector kernels do not do.
//!
//! Positions are sheared so that the ray becomes the third axis. On which side of an edge the ray
//! passes is then the sign of a 2×2 determinant, which is found exactly for the sheared positions;
//! where it is zero, the ray counts as moved by an infinitesimal (δ, δ²) (H. Edelsbrunner,
//! E. P. Mücke, *Simulation of simplicity*, 1990). All tetrahedra at an edge so see the ray on the
//! same side of it: a ray that enters a tetrahedron leaves it through exactly one other face, and
//! no two ways meet. It meets every point of the mesh once, however thin cells are.
//!
//! Meshes that overlap themselves give crossings that overlap: each counts.

use std::ops::ControlFlow;

use volact_core::{geometry::Spans, glam::DVec3};

use super::build::{Linked, OUTSIDE};

/// Gaps between stretches that are rounding, as a part of the distances along the ray.
const ROUNDING: f64 = 1e-13;

/// A tetrahedron met by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Which one.
    pub tetrahedron: usize,
    /// Its vertices; the order is this crossing's own.
    pub vertices: [u32; 4],
    /// Where the ray is inside.
    pub span: [f64; 2],
    /// Barycentric weights of the vertices at both ends; in between they are linear.
    pub weights: [[f64; 4]; 2],
}

impl Crossing {
    /// The weights at some `t`.
    pub fn weights_at(&self, t: f64) -> [f64; 4] {
        let [t0, t1] = self.span;
        let [a, b] = self.weights;
        let part = if t1 > t0 { ((t - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { 0.0 };
        [0, 1, 2, 3].map(|i| a[i] * (1.0 - part) + b[i] * part)
    }

    /// A number of the vertices at both ends; never outside of theirs, so that it is the same
    /// wherever theirs are.
    pub fn interpolate(&self, value: impl Fn(usize) -> f64) -> [f64; 2] {
        let values = self.vertices.map(|v| value(v as usize));
        let low = values.into_iter().fold(f64::INFINITY, f64::min);
        let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
        self.weights.map(|w| {
            let sum: f64 = (0..4).map(|i| w[i] * values[i]).sum();
            if sum.is_nan() { sum } else { sum.max(low).min(high) }
        })
    }

    /// The part between two places; `None` where it has no length.
    pub fn clipped(&self, [start, end]: [f64; 2]) -> Option<Self> {
        let span = [self.span[0].max(start), self.span[1].min(end)];
        let weights = span.map(|t| self.weights_at(t));
        (span[0] < span[1]).then_some(Self { span, weights, ..*self })
    }
}

impl Linked {
    /// Visits the tetrahedra that the line `origin + t·direction` crosses between two `t`, by
    /// rising beginning, until told to stop. `direction` has any length but zero.
    pub fn trace(
        &self,
        origin: DVec3,
        direction: DVec3,
        span: [f64; 2],
        mut visit: impl FnMut(&Crossing) -> ControlFlow<()>,
    ) {
        let shear = Shear::new(origin, direction);
        let mut waiting = self.entries(&shear, origin, direction, span[1]);
        let mut active: Vec<(Crossing, Walk)> = Vec::new();
        loop {
            let next = (0..active.len()).min_by(|&i, &j| active[i].0.span[0].total_cmp(&active[j].0.span[0]));
            let first = next.map_or(f64::INFINITY, |i| active[i].0.span[0]);
            if let Some(mut walk) = waiting.pop_if(|w| w.at <= first) {
                active.extend(walk.step(self, &shear).map(|c| (c, walk)));
                continue;
            }
            let Some(i) = next.filter(|_| first < span[1]) else { return };
            let (crossing, walk) = &mut active[i];
            if let Some(inside) = crossing.clipped(span)
                && visit(&inside).is_break()
            {
                return;
            }
            match walk.step(self, &shear) {
                Some(crossing) => active[i].0 = crossing,
                None => drop(active.swap_remove(i)),
            }
        }
    }

    /// Where the line is inside the mesh, between two `t`.
    pub fn stretches(&self, origin: DVec3, direction: DVec3, span: [f64; 2]) -> Spans {
        let mut inside: Vec<[f64; 2]> = Vec::new();
        self.trace(origin, direction, span, |crossing| {
            let [t0, t1] = crossing.span;
            match inside.last_mut() {
                Some(last) if t0 <= last[1] + ROUNDING * (t0.abs() + t1.abs()) => last[1] = last[1].max(t1),
                _ => inside.push([t0, t1]),
            }
            ControlFlow::Continue(())
        });
        Spans::union(inside)
    }

    /// All ways into the mesh before `end`, the last one first.
    fn entries(&self, shear: &Shear, origin: DVec3, direction: DVec3, end: f64) -> Vec<Walk> {
        let mut found: Vec<Walk> = Vec::new();
        self.tree().line(origin, direction, [f64::NEG_INFINITY, end], |face| {
            found.extend(Walk::new(self, shear, self.boundary[face]));
        });
        found.sort_by(|a, b| b.at.total_cmp(&a.at).then(b.link.cmp(&a.link)));
        found
    }
}

/// The map to a space in which the ray is the third axis, and `t` its coordinate.
struct Shear {
    origin: DVec3,
    /// The axes that become first, second and third.
    axes: [usize; 3],
    slope: [f64; 2],
    inverse: f64,
}

impl Shear {
    fn new(origin: DVec3, direction: DVec3) -> Self {
        let size = direction.abs();
        let k = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let (mut i, mut j) = ((k + 1) % 3, (k + 2) % 3);
        // Faces turned towards the origin of the ray shall turn from the first to the second axis.
        if direction[k] > 0.0 {
            std::mem::swap(&mut i, &mut j);
        }
        let inverse = 1.0 / direction[k];
        Self { origin, axes: [i, j, k], slope: [direction[i] * inverse, direction[j] * inverse], inverse }
    }

    fn apply(&self, point: DVec3) -> Corner {
        let q = point - self.origin;
        let [i, j, k] = self.axes;
        Corner { x: q[i] - self.slope[0] * q[k], y: q[j] - self.slope[1] * q[k], t: q[k] * self.inverse }
    }
}

/// A sheared vertex.
#[derive(Clone, Copy)]
struct Corner {
    x: f64,
    y: f64,
    t: f64,
}

/// The edge function: twice the signed area of the triangle that the ray makes with an edge.
fn area(a: Corner, b: Corner) -> f64 {
    a.x * b.y - b.x * a.y
}

/// Whether the edge function is positive: exactly, the ray moved by (δ, δ²) where it is zero.
fn positive(a: Corner, b: Corner) -> bool {
    let (m, n) = (a.x * b.y, b.x * a.y);
    if m != n {
        return m > n;
    }
    // What rounding took from the products.
    let (m, n) = (a.x.mul_add(b.y, -m), b.x.mul_add(a.y, -n));
    if m != n {
        return m > n;
    }
    if a.y != b.y { b.y < a.y } else { b.x > a.x }
}

/// A way of the ray through linked tetrahedra.
struct Walk {
    /// The next door and its turn; [`OUTSIDE`] at the end.
    link: u32,
    /// The vertices of the face that has been reached, and where they are.
    face: [u32; 3],
    corners: [Corner; 3],
    /// The weights of the face's vertices.
    weights: [f64; 3],
    /// `t` on the face.
    at: f64,
}

impl Walk {
    /// A way that begins at a door, if the ray enters there.
    fn new(mesh: &Linked, shear: &Shear, door: u32) -> Option<Self> {
        let face = mesh.face(door);
        let corners = face.map(|v| shear.apply(mesh.vertices.at(v as usize)));
        let [a, b, c] = corners;
        (positive(a, b) && positive(b, c) && positive(c, a)).then(|| {
            let weights = weights(corners);
            Self { link: 4 * door, face, corners, weights, at: at(corners, weights) }
        })
    }

    /// Crosses the tetrahedron behind the face.
    fn step(&mut self, mesh: &Linked, shear: &Shear) -> Option<Crossing> {
        if self.link == OUTSIDE {
            return None;
        }
        let (door, turn) = (mesh.doors[self.link as usize / 4], self.link as usize % 4);
        let apex = shear.apply(mesh.vertices.at(door.apex as usize));
        let sides = self.corners.map(|c| positive(apex, c));
        // The ray leaves through the apex and the edge between + and −: the third vertex goes.
        let out = (0..3).find(|&i| sides[(i + 1) % 3] && !sides[(i + 2) % 3]).unwrap_or(0);
        let ([a, b, c], [u, v, w], before) = (self.face, self.weights, self.at);
        (self.face[out], self.corners[out]) = (door.apex, apex);
        self.weights = weights(self.corners);
        self.at = before.max(at(self.corners, self.weights));
        let mut after = [0.0; 4];
        after[..3].copy_from_slice(&self.weights);
        after.swap(out, 3);
        let crossing = Crossing {
            tetrahedron: self.link as usize / 16,
            vertices: [a, b, c, door.apex],
            span: [before, self.at],
            weights: [[u, v, w, 0.0], after],
        };
        let slot = (out + turn) % 3;
        self.link = match door.next[slot] {
            OUTSIDE => OUTSIDE,
            next => next - next % 4 + (next % 4 + turn as u32) % 3,
        };
        Some(crossing)
    }
}

/// Barycentric weights of the point where the ray meets a triangle.
fn weights([a, b, c]: [Corner; 3]) -> [f64; 3] {
    let areas = [area(b, c), area(c, a), area(a, b)].map(|e| e.max(0.0));
    let sum: f64 = areas.iter().sum();
    if sum > 0.0 { areas.map(|e| e / sum) } else { [1.0 / 3.0; 3] }
}

fn at(corners: [Corner; 3], weights: [f64; 3]) -> f64 {
    (0..3).map(|i| corners[i].t * weights[i]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use volact_core::{Block, Geometry, Sphere, Tessellation};

    fn linked(mesh: &Tessellation) -> Linked {
        Linked::new(mesh, |_, _| {}).unwrap()
    }

    fn crossings(mesh: &Linked, origin: DVec3, direction: DVec3) -> Vec<Crossing> {
        let mut all = Vec::new();
        mesh.trace(origin, direction, [f64::NEG_INFINITY, f64::INFINITY], |c| {
            all.push(*c);
            ControlFlow::Continue(())
        });
        all
    }

    fn length(mesh: &Linked, origin: DVec3, direction: DVec3) -> f64 {
        crossings(mesh, origin, direction).iter().map(|c| c.span[1] - c.span[0]).sum()
    }

    /// A box of n³ cells, whose inner vertices are moved by up to `twist` of a cell.
    fn grid(n: usize, twist: f64) -> Tessellation {
        let at = |i: usize| i as f64 / n as f64;
        let moved = |i: usize, seed: usize| match i {
            0 => 0.0,
            i if i == n => 0.0,
            i => (((i * 7 + seed * 13) % 11) as f64 / 5.0 - 1.0) * twist / n as f64,
        };
        let side = n + 1;
        let points = (0..side * side * side).map(|v| {
            let (x, y, z) = (v % side, v / side % side, v / side / side);
            DVec3::new(at(x) + moved(x, y + z), at(y) + moved(y, z + 2 * x), at(z) + moved(z, x + 3 * y))
        });
        volact_core::StructuredMesh::new([side; 3], points.collect()).unwrap().tessellate().unwrap()
    }

    #[test]
    fn rays_through_vertices_edges_and_faces_meet_every_point_once() {
        let mesh = linked(&grid(4, 0.0));
        for (x, y) in [(0.5, 0.5), (0.25, 0.5), (0.3, 0.3), (0.25, 0.1), (0.1, 0.2), (0.25, 0.75)] {
            for z in [-1.0, -0.25, 0.0, 0.5] {
                let origin = DVec3::new(x, y, z);
                assert_eq!(length(&mesh, origin, DVec3::Z), 1.0);
                assert_eq!(length(&mesh, origin, -DVec3::Z * 2.0), 0.5);
                assert_eq!(length(&mesh, DVec3::new(z, x, y), DVec3::X), 1.0);
            }
        }
        // Along the diagonals of cells, of the whole, and along edges and faces inside.
        assert!((length(&mesh, DVec3::splat(-1.0), DVec3::ONE) - 1.0).abs() < 1e-12);
        assert!((length(&mesh, DVec3::new(-1.0, 2.0, 0.5), DVec3::new(1.0, -1.0, 0.0)) - 1.0).abs() < 1e-12);
        assert!((length(&mesh, DVec3::new(-1.0, 2.0, 0.3), DVec3::new(1.0, -1.0, 0.0)) - 1.0).abs() < 1e-12);
        // On the boundary a ray counts as moved: in or out, never twice.
        let along = length(&mesh, DVec3::new(0.0, 0.3, -1.0), DVec3::Z);
        assert!(along == 0.0 || along == 1.0, "{along}");
    }

    #[test]
    fn weights_are_those_of_the_points() {
        let tessellation = grid(3, 0.3);
        let mesh = linked(&tessellation);
        let (origin, direction) = (DVec3::new(-1.0, 0.2, 0.1), DVec3::new(1.0, 0.3, 0.4));
        let all = crossings(&mesh, origin, direction);
        assert!(all.len() > 8);
        for pair in all.windows(2) {
            assert_eq!(pair[0].span[1], pair[1].span[0]);
        }
        for c in &all {
            let mut own = c.vertices;
            let mut wanted = tessellation.tetrahedra[c.tetrahedron];
            own.sort();
            wanted.sort();
            assert_eq!(own, wanted);
            for (t, w) in c.span.into_iter().zip(c.weights) {
                let point: DVec3 = (0..4).map(|i| w[i] * mesh.vertices.at(c.vertices[i] as usize)).sum();
                assert!(point.distance(origin + direction * t) < 1e-12, "{c:?}");
                assert!(w.iter().all(|&w| w >= 0.0) && (w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn spans_cut_crossings_and_overlapping_cells_count_each() {
        let mut mesh = Block::new(DVec3::ZERO, DVec3::ONE).unwrap().tessellate().unwrap();
        let inside = |mesh: &Tessellation, span| {
            let mut sum = 0.0;
            let mesh = linked(mesh);
            let origin = DVec3::new(0.3, 0.4, -1.0);
            mesh.trace(origin, DVec3::Z, span, |c| {
                assert!(c.span[0] >= span[0] && c.span[1] <= span[1]);
                sum += c.span[1] - c.span[0];
                ControlFlow::Continue(())
            });
            (sum, mesh.stretches(origin, DVec3::Z, span).length())
        };
        assert!((inside(&mesh, [1.25, 1.75]).0 - 0.5).abs() < 1e-15);
        let twice = mesh.tetrahedra.clone();
        mesh.tetrahedra.extend(twice);
        let (sum, length) = inside(&mesh, [0.5, 1.5]);
        assert!((sum - 1.0).abs() < 1e-15 && (length - 0.5).abs() < 1e-15, "{sum} {length}");
    }

    proptest! {
        #[test]
        fn lengths_in_cells_add_up_to_the_length_inside(
            origin in prop::array::uniform3(-2.0..3.0f64),
            toward in prop::array::uniform3(0.0..1.0f64),
            ball in any::<bool>(),
        ) {
            let (origin, toward) = (DVec3::from(origin), DVec3::from(toward));
            let (tessellation, convex) = if ball {
                (Sphere::new(DVec3::splat(0.5), 0.7, 20).unwrap().tessellate().unwrap(), None)
            } else {
                (grid(5, 0.4), Some(volact_core::Aabb::new(DVec3::ZERO, DVec3::ONE)))
            };
            let mesh = linked(&tessellation);
            let direction = toward - origin;
            let sum = length(&mesh, origin, direction);
            let all = [f64::NEG_INFINITY, f64::INFINITY];
            let stretches = mesh.stretches(origin, direction, all);
            prop_assert!((stretches.length() - sum).abs() < 1e-12, "{stretches:?} {sum}");
            prop_assert!(stretches.as_slice().len() <= 1);
            if let Some(block) = convex {
                let wanted = block.clip_line(origin, direction).map_or(0.0, |[a, b]| b - a);
                prop_assert!((wanted - sum).abs() < 1e-12, "{wanted} {sum}");
            }
        }
    }
}
