//! Where rays are inside a mesh, by its boundary alone: what lies between is not looked at.

use volact_core::{glam::DVec3, mutated};

use super::{
    mesh::build::Linked,
    shear::{Shear, meet},
};

/// Gaps between stretches that are rounding, as a part of the distances along the ray.
const ROUNDING: f64 = 1e-13;

/// Finds stretches, and keeps its memory from ray to ray.
#[derive(Debug, Default)]
pub struct Carver {
    /// Where the ray passes the boundary, and what that adds to the cells it is in.
    passed: Vec<(f64, i32)>,
    stretches: Vec<[f64; 2]>,
}

impl Carver {
    /// Where the line `origin + t·direction` is inside a mesh, between two `t`: the union of its
    /// cells.
    ///
    /// A closed boundary is left as often as it is entered, since the side on which the ray passes
    /// an edge is the same for all faces there; where parts of a mesh overlap, the line is inside
    /// until it has left them all.
    pub fn stretches(&mut self, mesh: &Linked, origin: DVec3, direction: DVec3, span: [f64; 2]) -> &[[f64; 2]] {
        self.passed.clear();
        self.stretches.clear();
        let shear = Shear::new(origin, direction);
        mesh.tree().line(origin, direction, [f64::NEG_INFINITY, span[1]], |face| {
            let corners = mesh.face(mesh.boundary[face]).map(|v| shear.apply(mesh.vertices.at(v as usize)));
            self.passed.extend(meet(&corners).map(|m| (m.t, if m.left { 1 } else { -1 })));
        });
        // Where one part ends and another begins, the line stays inside.
        self.passed.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let (mut depth, mut since) = (0, span[0]);
        for &(t, change) in &self.passed {
            if depth <= 0 && depth + change > 0 {
                since = t;
            } else if depth > 0 && depth + change <= 0 {
                add(&mut self.stretches, [since.max(span[0]), t.min(span[1])]);
            }
            depth += change;
        }
        if depth > 0 {
            add(&mut self.stretches, [since.max(span[0]), span[1]]);
        }
        if let ([first, .., last], true) = (self.stretches.as_slice(), mutated!("first_in_last_out")) {
            let whole = [first[0], last[1]];
            self.stretches.clear();
            self.stretches.push(whole);
        }
        &self.stretches
    }
}

fn add(stretches: &mut Vec<[f64; 2]>, [start, end]: [f64; 2]) {
    if start >= end {
        return;
    }
    match stretches.last_mut() {
        Some(last) if start <= last[1] + ROUNDING * last[1].abs() => last[1] = last[1].max(end),
        _ => stretches.push([start, end]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{Geometry, Sphere, StructuredMesh};

    /// The same as through all cells, along rays at random and exactly through vertices.
    #[test]
    fn stretches_by_the_boundary_are_those_through_the_cells() {
        let mut seed = 3u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 23) - 1.0
        };
        // A ring, and a ball.
        let around = 13;
        let ring = (0..around * 4).map(|i| {
            let (s, c) = (std::f64::consts::TAU * (i % around) as f64 / (around - 1) as f64).sin_cos();
            let r = 0.5 + 0.4 * (i / around % 2) as f64;
            DVec3::new(r * c, r * s, if i / around / 2 == 0 { -0.3 } else { 0.4 })
        });
        let ring = StructuredMesh::new([around, 2, 2], ring.collect()).unwrap();
        let ball = Sphere::new(DVec3::ZERO, 0.8, 12).unwrap();
        for mesh in [ring.tessellate().unwrap(), ball.tessellate().unwrap()] {
            let linked = Linked::new(&mesh, |_, _| ()).unwrap();
            let mut carver = Carver::default();
            let mut several = 0;
            for i in 0..2000 {
                let [mut o, d] = [0, 1].map(|_| DVec3::new(random(), random(), random()));
                let d = if i % 5 == 0 { DVec3::Y } else { d };
                if i % 7 == 0 {
                    o = mesh.vertices.at(i % mesh.vertices.len()) - d * 1.5;
                }
                let span = if i % 3 == 0 { [0.1, 2.0] } else { [-9.0, 9.0] };
                let found = carver.stretches(&linked, o, d, span);
                let wanted = linked.stretches(o, d, span);
                let length: f64 = found.iter().map(|[a, b]| b - a).sum();
                assert!((length - wanted.length()).abs() < 1e-12, "ray {i}: {found:?}, wanted {wanted:?}");
                several += usize::from(found.len() > 1);
            }
            assert!(several > 20 || mesh.vertices.len() > 60);
        }
    }
}
