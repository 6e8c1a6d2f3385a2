//! A ray through tetrahedra, one by one: which it crosses, where, and in through which face.
//!
//! Object space is sheared so that the ray becomes an axis: a vertex v has the coordinates
//! (x, y) at which it lies beside the ray, and τ, at which the ray passes it (S. Woop, C. Benthin,
//! I. Wald, *Watertight ray/triangle intersection*, 2013). The ray passes through a triangle where
//! the edge functions e = xᵢyⱼ − xⱼyᵢ of its three edges have one sign; over their sum they are the
//! barycentric coordinates of the crossing.
//!
//! # Every point once
//! Coordinates are double-double and depend on the vertex and the ray alone; signs of edge
//! functions are exact. A ray through a vertex or an edge is taken as moved aside by (δ, δ²) with
//! an infinitesimal δ (H. Edelsbrunner, E. Mücke, *Simulation of simplicity*, 1990): then it passes
//! each edge on one side, the same for all tetrahedra that share it, and meets either two faces
//! of a tetrahedron or none. Nothing is known of neighbours, and nothing needs to be.

use volact_core::glam::DVec3;

use super::{
    dd::{Dd, sign_of_determinant},
    mark::FINE,
    sight::Path,
};

/// A ray in sheared coordinates. `τ` is counted from its origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheared {
    /// The two axes beside the ray, and the one it mostly runs along.
    axes: [usize; 3],
    origin: [Dd; 3],
    /// What the first two coordinates change by over the third.
    shear: [Dd; 2],
    /// The change of the third for one unit of τ.
    along: Dd,
    /// A power of two that makes coordinates about 1.
    unit: f64,
    /// Bound on the error of coordinates beside the ray.
    fuzz: f64,
}

/// A vertex as a ray sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// Where it lies beside the ray.
    x: Dd,
    y: Dd,
    /// Where the ray passes it.
    tau: Dd,
}

/// Which way a ray is moved aside by an infinitesimal amount: two signs.
pub(super) type Lean = [f64; 2];

/// All ways, the usual one first.
pub(super) const LEANS: [Lean; 4] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];

/// Where a ray passes through a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pass {
    /// The corners, as places in the tetrahedron's corners.
    pub corners: [usize; 3],
    /// Their barycentric weights.
    pub weights: [f64; 3],
    /// The same in double-double.
    fine: [Dd; 3],
    pub tau: Dd,
    /// Bound on the error of a weight.
    pub loose: f64,
    /// Bound on the error of `tau`.
    pub error: f64,
}

/// What a ray does at a tetrahedron.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "made and used in one place, never stored")]
pub(super) enum Meeting {
    Miss,
    /// In through the first face and out through the second.
    Through([Pass; 2]),
}

impl Sheared {
    /// A ray in object space; `size` is the extent of what it may meet.
    pub fn new(path: &Path, size: f64) -> Self {
        let steep = |a: &usize, b: &usize| path.step[*a].hi.abs().total_cmp(&path.step[*b].hi.abs());
        let k = (0..3).max_by(steep).unwrap_or(2);
        let axes = [(k + 1) % 3, (k + 2) % 3, k];
        let shear = [0, 1].map(|a| path.step[axes[a]].over(path.step[k]));
        let unit = (-size.max(f64::MIN_POSITIVE).log2().ceil()).clamp(-1000.0, 1000.0).exp2();
        let most = |v: &[f64; 3]| v.iter().fold(0f64, |m, v| m.max(*v));
        // Errors of the origin, of the direction on the way across, and of a vertex' subtractions.
        let across = most(&path.step_size) / path.step[k].hi.abs() * size;
        let fuzz = FINE * (most(&path.at_size) + across + size) * unit;
        Self { axes, origin: path.at, shear, along: path.step[k], unit, fuzz }
    }

    /// A vertex in the ray's coordinates; beside the ray what is nothing to double-double
    /// precision is nothing.
    pub fn corner(&self, vertex: DVec3) -> Corner {
        let [a, b, c] = self.axes.map(|i| Dd::new(vertex[i]).add(self.origin[i].negate()));
        let aside = |p: Dd, shear: Dd| {
            let made = p.add(shear.times(c).negate());
            let none = made.hi.abs() <= FINE * p.hi.abs() || made.hi.abs() * self.unit <= self.fuzz;
            if none { Dd::default() } else { made.scale(self.unit) }
        };
        Corner { x: aside(a, self.shear[0]), y: aside(b, self.shear[1]), tau: c.over(self.along) }
    }

    /// Meets a tetrahedron of corners in the order of their numbers. Tells whether the ray had to
    /// be moved aside, too.
    pub fn meet(&self, corners: &[Corner; 4], lean: Lean, tie: &mut bool) -> Meeting {
        let mut signs = [[0.0; 4]; 4];
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            signs[i][j] = side(&corners[i], &corners[j], lean, tie);
            signs[j][i] = -signs[i][j];
        }
        let hit = |[a, b, c]: &[usize; 3]| {
            signs[*a][*b] != 0.0 && signs[*a][*b] == signs[*b][*c] && signs[*a][*b] == signs[*c][*a]
        };
        let mut passed = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]].into_iter().filter(hit);
        let (Some(first), Some(second)) = (passed.next(), passed.next()) else { return Meeting::Miss };
        let (first, second) = (self.pass(corners, first), self.pass(corners, second));
        Meeting::Through(if first.tau.sign_from(second.tau) <= 0.0 { [first, second] } else { [second, first] })
    }

    /// Meets a triangle; `None` where the ray passes beside it. Tells whether the ray had to be
    /// moved aside, too.
    pub fn meet_triangle(&self, corners: &[Corner; 3], lean: Lean, tie: &mut bool) -> Option<Pass> {
        let [a, b, c] = corners;
        let signs = [side(a, b, lean, tie), side(b, c, lean, tie), side(c, a, lean, tie)];
        let through = signs[0] != 0.0 && signs[0] == signs[1] && signs[1] == signs[2];
        through.then(|| self.pass(&[*a, *b, *c, *a], [0, 1, 2]))
    }

    fn pass(&self, all: &[Corner; 4], corners: [usize; 3]) -> Pass {
        let [a, b, c] = corners.map(|i| &all[i]);
        let edges = [edge(b, c), edge(c, a), edge(a, b)];
        let sum = edges[0].add(edges[1]).add(edges[2]);
        let reach = [a, b, c].iter().map(|p| p.x.hi.abs() + p.y.hi.abs()).fold(0.0, f64::max);
        // An edge function is wrong by the corners' errors times their distance from the ray.
        let wrong = 16.0 * self.fuzz * reach / sum.hi.abs();
        let loose = if wrong < 1.0 { wrong } else { 1.0 };
        let part = |e: Dd| if sum.hi == 0.0 { Dd::new(1.0 / 3.0) } else { e.over(sum) };
        let fine = edges.map(part);
        let weights = fine.map(|w| w.hi.clamp(0.0, 1.0));
        let [_, v, w] = fine;
        let tau = a.tau.add(v.times(b.tau.add(a.tau.negate()))).add(w.times(c.tau.add(a.tau.negate())));
        let low = a.tau.hi.min(b.tau.hi).min(c.tau.hi);
        let high = a.tau.hi.max(b.tau.hi).max(c.tau.hi);
        let error = 2.0 * loose * (high - low) + 4.0 * FINE * low.abs().max(high.abs());
        Pass { corners, weights, fine, tau, loose, error }
    }
}

impl Pass {
    /// A linear field at the crossing, from its numbers at the tetrahedron's corners; exact where
    /// these are the same.
    pub fn value(&self, field: &[f64; 4]) -> f64 {
        let [a, b, c] = self.corners.map(|i| field[i]);
        a + (self.weights[1] * (b - a) + self.weights[2] * (c - a))
    }

    /// The same in double-double.
    pub fn fine_value(&self, field: &[f64; 4]) -> Dd {
        let [a, b, c] = self.corners.map(|i| Dd::new(field[i]));
        let rise = |to: Dd, weight: Dd| weight.times(to.add(a.negate()));
        a.add(rise(b, self.fine[1])).add(rise(c, self.fine[2]))
    }
}

/// The edge function, whose sign changes with the order of its ends and nothing else.
fn edge(a: &Corner, b: &Corner) -> Dd {
    a.x.times(b.y).add(b.x.times(a.y).negate())
}

/// On which side the ray passes an edge; 0 only where the edge is a point to it.
fn side(a: &Corner, b: &Corner, lean: Lean, tie: &mut bool) -> f64 {
    let sign = sign_of_determinant([a.x, a.y], [b.x, b.y]);
    if sign != 0.0 {
        return sign;
    }
    *tie = true;
    match -lean[0] * b.y.sign_from(a.y) {
        0.0 => lean[1] * b.x.sign_from(a.x),
        sign => sign,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sheared(origin: DVec3, direction: DVec3) -> Sheared {
        let exact = |v: DVec3| v.to_array().map(Dd::new);
        let sizes = |v: DVec3| v.abs().to_array();
        let path =
            Path { at: exact(origin), step: exact(direction), at_size: sizes(origin), step_size: sizes(direction) };
        Sheared::new(&path, 16.0)
    }

    fn meet(ray: &Sheared, corners: [DVec3; 4], lean: Lean) -> Option<[Pass; 2]> {
        match ray.meet(&corners.map(|c| ray.corner(c)), lean, &mut false) {
            Meeting::Through(passes) => Some(passes),
            Meeting::Miss => None,
        }
    }

    #[test]
    fn a_ray_goes_in_and_out() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let ray = sheared(DVec3::new(0.25, 0.25, -3.0), DVec3::Z * 2.0);
        let [enter, leave] = meet(&ray, corners, LEANS[0]).unwrap();
        assert_eq!((enter.tau, leave.tau), (Dd::new(1.5), Dd::new(1.75)));
        assert_eq!(enter.weights, [0.5, 0.25, 0.25]);
        assert_eq!((enter.value(&[4.0, 8.0, 0.0, 9.0]), leave.value(&[1.0; 4])), (4.0, 1.0));
        assert!(enter.loose < 1e-24 && enter.error < 1e-24);
        assert!(meet(&sheared(DVec3::new(0.6, 0.6, -3.0), DVec3::Z), corners, LEANS[0]).is_none());
    }

    proptest! {
        /// Corners on a coarse grid, so that rays go through vertices, edges and faces: a point and
        /// the tetrahedra that it makes with the faces of another share out the ray among them.
        #[test]
        fn parts_of_a_tetrahedron_share_out_the_ray(
            corners in prop::array::uniform4(prop::array::uniform3(-3..4i32)),
            inner in prop::array::uniform4(0..4u32),
            origin in prop::array::uniform3(-3..4i32),
            direction in prop::array::uniform3(-2..3i32),
            lean in prop::sample::select(LEANS.to_vec()),
        ) {
            let real = |p: [i32; 3]| DVec3::from(p.map(f64::from));
            let (corners, direction) = (corners.map(real), real(direction));
            let weight = inner.iter().sum::<u32>();
            let [a, b, c, d] = corners;
            // Only by such a weight is the point exactly where it is said to be.
            prop_assume!(weight.is_power_of_two());
            prop_assume!(direction != DVec3::ZERO && (b - a).cross(c - a).dot(d - a) != 0.0);
            let middle = (0..4).map(|i| f64::from(inner[i]) / f64::from(weight) * corners[i]).sum::<DVec3>();
            let ray = sheared(real(origin), direction);
            let length = |t: [DVec3; 4]| meet(&ray, t, lean).map_or(0.0, |[a, b]| b.tau.minus(a.tau.hi) - a.tau.lo);
            let parts: f64 = (0..4).map(|i| {
                let mut t = corners;
                t[i] = middle;
                length(t)
            }).sum();
            prop_assert!((parts - length(corners)).abs() < 1e-12, "{parts} {}", length(corners));
        }
    }
}
