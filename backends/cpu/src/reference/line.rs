//! A ray in a shape's spaces, with bounds on the rounding of its positions.
//!
//! A ray's numbers, the shape's inverse transform and the map to samples are taken as the exact
//! f64 that core hands over. An anchor near the middle of the shape is carried into object and
//! index space in double-double, and positions are counted from there: `p(t) = p_a + t·d`, so
//! that neither a distant camera nor a distant scene costs digits.

use volact_core::{
    Aabb, Ray,
    glam::{DAffine3, DVec3},
};

use super::dd::Dd;

/// Half a unit in the last place of 1: the bound of one rounding.
pub(super) const EPS: f64 = f64::EPSILON / 2.0;

/// A stretch of a ray inside a shape's block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// The ray's `t` from which `t` is counted here.
    pub anchor: f64,
    /// Where the block begins and ends, counted from the anchor.
    pub t: [f64; 2],
    /// Bound on the error of `t[0]`, `t[1]` and of any crossing of a cell face.
    pub dt: f64,
    /// Sample coordinates at the anchor.
    pub index: [Dd; 3],
    /// Their change for one unit of `t`.
    pub step: [f64; 3],
    /// Bounds on the errors of sample coordinates, the one from `dt` included.
    pub dp: [f64; 3],
}

/// How a ray meets a block.
#[derive(Clone, Copy, Debug)]
pub(super) enum Hit {
    /// Not at all, or in a point.
    Miss,
    /// So barely that rounding decides.
    Graze,
    /// Along a stretch.
    Through(Line),
}

/// What of a shape a line needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// World to object.
    pub to_object: DAffine3,
    /// Object to sample coordinates.
    pub to_index: DAffine3,
    /// The box in object space.
    pub block: Aabb,
}

impl Place {
    /// The stretch of `ray` inside the block and between near and far.
    pub fn meet(&self, ray: &Ray) -> Hit {
        if self.block.is_empty() {
            return Hit::Miss;
        }
        let direction = self.to_object.transform_vector3(ray.direction);
        let from = self.to_object.transform_point3(ray.origin);
        let anchor = (self.block.center() - from).dot(direction) / direction.length_squared();
        if !anchor.is_finite() {
            return Hit::Miss;
        }
        let world = [0, 1, 2].map(|a| Dd::new(ray.origin[a]).add(Dd::product(anchor, ray.direction[a])));
        let object = map_point(&self.to_object, world);
        let object_step = map_vector(&self.to_object, ray.direction.to_array().map(Dd::new));
        let Some(t) = self.clip(&object, object_step.map(|d| d.hi), [ray.near - anchor, ray.far - anchor]) else {
            return Hit::Miss;
        };
        let reach = t[0].abs().max(t[1].abs());
        let dt = 16.0 * EPS * reach;
        if !reach.is_finite() || t[1] - t[0] <= -4.0 * dt {
            return Hit::Miss;
        }
        if t[1] - t[0] <= 8.0 * dt {
            return Hit::Graze;
        }
        let index = map_point(&self.to_index, object);
        let step = map_vector(&self.to_index, object_step).map(|d| d.hi);
        let dp = step.map(|d| if d == 0.0 { 0.0 } else { 16.0 * EPS * (reach * d.abs() + 1.0) + dt * d.abs() });
        Hit::Through(Line { anchor, t, dt, index, step, dp })
    }

    fn clip(&self, at: &[Dd; 3], step: [f64; 3], limits: [f64; 2]) -> Option<[f64; 2]> {
        let [mut t0, mut t1] = limits;
        for a in 0..3 {
            let (lo, hi) = (-at[a].minus(self.block.min[a]), -at[a].minus(self.block.max[a]));
            if step[a] == 0.0 {
                if lo > 0.0 || hi < 0.0 {
                    return None;
                }
                continue;
            }
            let (u, v) = (lo / step[a], hi / step[a]);
            t0 = t0.max(u.min(v));
            t1 = t1.min(u.max(v));
        }
        Some([t0, t1])
    }
}

impl Line {
    /// A sample coordinate at `t`, less `base`.
    pub fn at(&self, axis: usize, t: f64, base: f64) -> f64 {
        self.index[axis].minus(base) + t * self.step[axis]
    }

    /// All sample coordinates at `t`.
    pub fn point(&self, t: f64) -> DVec3 {
        DVec3::new(self.at(0, t, 0.0), self.at(1, t, 0.0), self.at(2, t, 0.0))
    }

    /// Where a sample coordinate takes a value.
    pub fn crossing(&self, axis: usize, value: f64) -> f64 {
        -self.index[axis].minus(value) / self.step[axis]
    }
}

fn map_vector(map: &DAffine3, v: [Dd; 3]) -> [Dd; 3] {
    let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
    [0, 1, 2].map(|a| (0..3).fold(Dd::default(), |sum, c| sum.add(v[c].scale(columns[c][a]))))
}

fn map_point(map: &DAffine3, p: [Dd; 3]) -> [Dd; 3] {
    let v = map_vector(map, p);
    [0, 1, 2].map(|a| v[a].add(Dd::new(map.translation[a])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distant_scene_keeps_its_digits() {
        let far = DVec3::new(1e7, -3e7, 2e7);
        let block = Aabb::new(DVec3::ZERO, DVec3::ONE);
        let place = Place { to_object: DAffine3::from_translation(-far), to_index: DAffine3::IDENTITY, block };
        let ray = Ray {
            origin: far + DVec3::new(0.25, 0.5, -4.0),
            direction: DVec3::Z,
            near: 0.0,
            far: f64::INFINITY,
            depth_zero: 0.0,
        };
        let Hit::Through(line) = place.meet(&ray) else { panic!("the ray meets the block") };
        assert_eq!(line.point(line.t[0]), DVec3::new(0.25, 0.5, 0.0));
        assert_eq!((line.anchor + line.t[0], line.t[1] - line.t[0]), (4.0, 1.0));
        assert!(line.dt < 1e-14);
    }

    #[test]
    fn a_line_past_the_block_misses() {
        let block = Aabb::new(DVec3::ZERO, DVec3::ONE);
        let place = Place { to_object: DAffine3::IDENTITY, to_index: DAffine3::IDENTITY, block };
        let ray = |x: f64| Ray {
            origin: DVec3::new(x, 0.5, -1.0),
            direction: DVec3::Z,
            near: 0.0,
            far: f64::INFINITY,
            depth_zero: 0.0,
        };
        assert!(matches!(place.meet(&ray(1.5)), Hit::Miss));
        assert!(matches!(place.meet(&ray(1.0)), Hit::Through(_)));
        let behind = Ray { near: 3.0, ..ray(0.5) };
        assert!(matches!(place.meet(&behind), Hit::Miss));
    }
}
