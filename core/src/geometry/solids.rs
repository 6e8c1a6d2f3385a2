//! Round solids, written as a user's own geometry would be: bounds and a tessellation.

use std::{any::Any, f64::consts::TAU};

use glam::{DQuat, DVec3};

use super::{Aabb, CellType, Geometry, GeometryError, Points, Tessellation};

fn check(geometry: &str, what: &str, value: f64) -> Result<(), GeometryError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(GeometryError::invalid(geometry, what, value, "a positive, finite number"))
}

fn check_point(geometry: &str, what: &str, point: DVec3) -> Result<(), GeometryError> {
    if point.is_finite() {
        return Ok(());
    }
    Err(GeometryError::invalid(geometry, what, point, "finite numbers"))
}

fn check_segments(geometry: &str, segments: u32) -> Result<(), GeometryError> {
    if (3..=1024).contains(&segments) {
        return Ok(());
    }
    Err(GeometryError::invalid(geometry, "segments", segments, "3 to 1024"))
}

/// A ball, as a polyhedron whose vertices lie on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    center: DVec3,
    radius: f64,
    segments: u32,
}

impl Sphere {
    /// A ball with that many segments around its equator, and half as many from pole to pole.
    ///
    /// # Errors
    /// If a number is not finite, the radius not positive, or there are fewer than 3 or more than
    /// 1024 segments.
    pub fn new(center: DVec3, radius: f64, segments: u32) -> Result<Self, GeometryError> {
        check_point("sphere", "center", center)?;
        check("sphere", "radius", radius)?;
        check_segments("sphere", segments)?;
        Ok(Self { center, radius, segments })
    }
}

impl Geometry for Sphere {
    fn name(&self) -> &str {
        "sphere"
    }

    fn bounds(&self) -> Aabb {
        Aabb::new(self.center - self.radius, self.center + self.radius)
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        let around = self.segments;
        let rings = (around / 2).max(2);
        let mut points = vec![self.center, self.center - DVec3::Z * self.radius, self.center + DVec3::Z * self.radius];
        for ring in 1..rings {
            let (z, r) = (TAU / 2.0 * (f64::from(ring) / f64::from(rings) - 0.5)).sin_cos();
            points.extend((0..around).map(|i| {
                let (y, x) = (TAU * f64::from(i) / f64::from(around)).sin_cos();
                self.center + self.radius * DVec3::new(r * x, r * y, z)
            }));
        }
        let at = |ring: u32, i: u32| match ring {
            0 => 1,
            r if r == rings => 2,
            r => 3 + (r - 1) * around + i % around,
        };
        // One pyramid for each patch of the surface, a tetrahedron at the poles.
        let patches = (0..rings).flat_map(|ring| (0..around).map(move |i| (ring, i)));
        let cells = patches.map(|(ring, i)| {
            let [a, b, c, d] = [at(ring, i), at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)];
            match ring {
                0 => (CellType::Tetrahedron, [1, d, c, 0, 0, 0, 0, 0]),
                r if r + 1 == rings => (CellType::Tetrahedron, [a, 2, b, 0, 0, 0, 0, 0]),
                _ => (CellType::Pyramid, [a, d, c, b, 0, 0, 0, 0]),
            }
        });
        let made = Tessellation::of_cells(&Points::from(points), cells, (rings * around) as usize);
        Ok(Tessellation { inverted: 0, ..made })
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// A cylinder, as a prism whose edges lie on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    ends: [DVec3; 2],
    radius: f64,
    segments: u32,
}

impl Cylinder {
    /// A cylinder from one end of its axis to the other, with that many segments around it.
    ///
    /// # Errors
    /// If a number is not finite, the axis has no length, the radius is not positive, or there
    /// are fewer than 3 or more than 1024 segments.
    pub fn new(ends: [DVec3; 2], radius: f64, segments: u32) -> Result<Self, GeometryError> {
        ends.iter().try_for_each(|&p| check_point("cylinder", "end", p))?;
        check("cylinder", "length", ends[0].distance(ends[1]))?;
        check("cylinder", "radius", radius)?;
        check_segments("cylinder", segments)?;
        Ok(Self { ends, radius, segments })
    }
}

impl Geometry for Cylinder {
    fn name(&self) -> &str {
        "cylinder"
    }

    fn bounds(&self) -> Aabb {
        let axis = (self.ends[1] - self.ends[0]).normalize();
        let reach = (DVec3::ONE - axis * axis).max(DVec3::ZERO).map(f64::sqrt) * self.radius;
        let [a, b] = self.ends;
        Aabb::new(a.min(b) - reach, a.max(b) + reach)
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        let turn = DQuat::from_rotation_arc(DVec3::Z, (self.ends[1] - self.ends[0]).normalize());
        let mut points = self.ends.to_vec();
        for end in self.ends {
            points.extend((0..self.segments).map(|i| {
                let (y, x) = (TAU * f64::from(i) / f64::from(self.segments)).sin_cos();
                end + turn * (self.radius * DVec3::new(x, y, 0.0))
            }));
        }
        let n = self.segments;
        let wedge = |i: u32| {
            let (a, b) = (2 + i, 2 + (i + 1) % n);
            (CellType::Wedge, [0, a, b, 1, a + n, b + n, 0, 0])
        };
        Ok(Tessellation::of_cells(&Points::from(points), (0..n).map(wedge), n as usize))
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Adjacency;

    fn volume(geometry: &dyn Geometry) -> f64 {
        let mesh = geometry.tessellate().unwrap();
        mesh.validate("test").unwrap();
        assert_eq!((mesh.collapsed, mesh.folded), (0, 0));
        let adjacency = Adjacency::new(&mesh.tetrahedra);
        assert_eq!((adjacency.overlapping_faces, adjacency.non_manifold_edges(&mesh.tetrahedra)), (0, 0));
        let bounds = geometry.bounds();
        let grown = Aabb::new(bounds.min - 1e-12, bounds.max + 1e-12);
        assert!(mesh.vertices.iter().all(|p| p.cmpge(grown.min).all() && p.cmple(grown.max).all()));
        (0..mesh.tetrahedra.len()).map(|t| mesh.volume(t)).sum()
    }

    #[test]
    fn round_solids_close_in_on_their_volumes() {
        let sphere = |n| volume(&Sphere::new(DVec3::new(1.0, 2.0, 3.0), 2.0, n).unwrap());
        let error = |n| 32.0 / 3.0 * std::f64::consts::PI - sphere(n);
        assert!(error(64) > 0.0 && (error(64) / error(32) - 0.25).abs() < 0.02, "{} {}", error(64), error(32));
        let ends = [DVec3::new(1.0, 0.0, 0.0), DVec3::new(1.0, 2.0, 2.0)];
        let cylinder = volume(&Cylinder::new(ends, 0.5, 48).unwrap());
        let exact = 0.5 * 0.25 * 48.0 * (TAU / 48.0).sin() * 8f64.sqrt();
        assert!((cylinder - exact).abs() < 1e-12);
    }

    #[test]
    fn damaged_solids_are_refused() {
        assert!(Sphere::new(DVec3::NAN, 1.0, 16).is_err());
        assert!(Sphere::new(DVec3::ZERO, -1.0, 16).is_err());
        assert!(Sphere::new(DVec3::ZERO, 1.0, 2).is_err());
        assert!(Cylinder::new([DVec3::ZERO; 2], 1.0, 16).is_err());
    }
}
