//! Rays and triangles: on which side of an edge a ray passes, without doubt.
//!
//! Positions are sheared so that the ray becomes the third axis (S. Woop, C. Benthin, I. Wald,
//! *Watertight ray/triangle intersection*, 2013). The side is then the sign of a difference of two
//! products, which is found exactly for the sheared positions and so is the same for all triangles
//! at the edge; where it is zero, the ray counts as moved by an infinitesimal (δ, δ²)
//! (H. Edelsbrunner, E. P. Mücke, *Simulation of simplicity*, 1990).

use volact_core::glam::DVec3;

/// The map to a space in which the ray is the third axis and begins at the origin.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// The axes that become first, second and third.
    axes: [usize; 3],
    origin: DVec3,
    slope: [f64; 2],
    inverse: f64,
}

/// A sheared vertex.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    x: f64,
    y: f64,
    /// Where on the ray.
    pub t: f64,
}

/// How a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Where on the ray.
    pub t: f64,
    /// Barycentric weights of the corners.
    pub weights: [f64; 3],
    /// Whether the corners turn to the left as seen from where the ray comes from.
    pub left: bool,
}

impl Shear {
    /// The map of a line, whose direction has any length but zero.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        let size = direction.abs();
        let k = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let (mut i, mut j) = ((k + 1) % 3, (k + 2) % 3);
        // What turns left stays so, whichever way the ray runs.
        if direction[k] > 0.0 {
            std::mem::swap(&mut i, &mut j);
        }
        let inverse = 1.0 / direction[k];
        Self { axes: [i, j, k], origin, slope: [direction[i] * inverse, direction[j] * inverse], inverse }
    }

    /// A vertex as the ray sees it.
    pub fn apply(&self, point: DVec3) -> Corner {
        let p = point - self.origin;
        let [x, y, z] = self.axes.map(|a| p[a]);
        Corner { x: x - self.slope[0] * z, y: y - self.slope[1] * z, t: z * self.inverse }
    }
}

/// Whether and where the ray meets a triangle; `None`, too, where rounding leaves no area.
pub fn meet([a, b, c]: &[Corner; 3]) -> Option<Meeting> {
    let left = positive(b, c);
    if positive(c, a) != left || positive(a, b) != left {
        return None;
    }
    let areas = [area(b, c), area(c, a), area(a, b)];
    let sum: f64 = areas.iter().sum();
    let weights = areas.map(|e| e / sum);
    let t = weights[0] * a.t + weights[1] * b.t + weights[2] * c.t;
    t.is_finite().then_some(Meeting { t, weights, left })
}

/// Twice the signed area of the triangle that the ray makes with an edge.
fn area(a: &Corner, b: &Corner) -> f64 {
    a.x * b.y - b.x * a.y
}

/// Whether the ray passes on the left of an edge.
fn positive(a: &Corner, b: &Corner) -> bool {
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
