//! A stretch of a ray inside a block, in sample coordinates, with bounds on the rounding of its
//! positions.

use volact_core::{
    Aabb,
    glam::{DAffine3, DVec3},
};

use super::{
    dd::Dd,
    mark::{FINE, Mark, Stretches},
    sight::Sight,
};

/// Half a unit in the last place of 1: the bound of one rounding.
pub(super) const EPS: f64 = f64::EPSILON / 2.0;

/// A stretch of a ray inside a shape's block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// The ray's `t` from which `t` is counted here.
    pub anchor: f64,
    /// Where it begins and ends, counted from the anchor.
    pub t: [f64; 2],
    /// The same ends on the ray.
    pub ends: [Mark; 2],
    /// Bound on the error of `t[0]`, `t[1]` and of any crossing of a cell face.
    pub dt: f64,
    /// Sample coordinates at the anchor.
    pub index: [Dd; 3],
    /// Their change for one unit of `t`.
    pub step: [f64; 3],
    /// Bounds on the errors of sample coordinates, the one from `dt` included.
    pub dp: [f64; 3],
}

/// What a ray meets of a block.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    /// The stretches in order.
    pub lines: Vec<Line>,
    /// The length of further ones that are so short that rounding decides what they show.
    pub grazed: f64,
}

/// What of a shape a line needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Object to sample coordinates.
    pub to_index: DAffine3,
    /// The box in object space.
    pub block: Aabb,
}

impl Place {
    /// Leaves what of stretches lies inside the block.
    pub fn crop(&self, sight: &Sight, stretches: &mut Stretches) {
        if self.block.is_empty() {
            return stretches.clear();
        }
        for (a, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            let low = sight.front(&sight.object, axis, self.block.min[a]);
            let high = sight.front(&sight.object, -axis, -self.block.max[a]);
            match (low, high) {
                (Some([a, b]), Some([c, d])) => {
                    stretches.keep(a, b);
                    stretches.keep(c, d);
                }
                _ => return stretches.clear(),
            }
        }
    }

    /// Stretches inside the block as lines.
    pub fn lines(&self, sight: &Sight, stretches: &Stretches) -> Lines {
        let mut made = Lines::default();
        let path = sight.object.mapped(&self.to_index);
        let step = path.step.map(|d| d.hi);
        for ends in stretches.as_slice() {
            let t = ends.map(|m| m.from(sight.anchor));
            let reach = t[0].abs().max(t[1].abs());
            if !reach.is_finite() {
                continue;
            }
            let dt = 16.0 * EPS * reach + ends[0].error.max(ends[1].error);
            let length = t[1] - t[0];
            if length <= 8.0 * dt {
                made.grazed += (length + 2.0 * dt).max(0.0);
                continue;
            }
            let round = |a: usize| EPS * 16.0 * (reach * step[a].abs() + 1.0) + FINE * path.at_size[a];
            let dp = [0, 1, 2].map(|a| if step[a] == 0.0 { 0.0 } else { round(a) + dt * step[a].abs() });
            made.lines.push(Line { anchor: sight.anchor, t, ends: *ends, dt, index: path.at, step, dp });
        }
        made
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

/// A vector through a map, in double-double.
pub(super) fn map_vector(map: &DAffine3, v: [Dd; 3]) -> [Dd; 3] {
    let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
    [0, 1, 2].map(|a| (0..3).fold(Dd::default(), |sum, c| sum.add(v[c].scale(columns[c][a]))))
}

/// A point through a map, in double-double.
pub(super) fn map_point(map: &DAffine3, p: [Dd; 3]) -> [Dd; 3] {
    let v = map_vector(map, p);
    [0, 1, 2].map(|a| v[a].add(Dd::new(map.translation[a])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::Ray;

    fn ray(origin: DVec3) -> Ray {
        Ray { origin, direction: DVec3::Z, near: 0.0, far: f64::INFINITY, depth_zero: 0.0 }
    }

    fn meet(place: &Place, to_object: DAffine3, ray: &Ray) -> Lines {
        let sight = Sight::new(ray, &to_object, place.block.center()).unwrap();
        let mut stretches = Stretches::between(Mark::exact(ray.near), Mark::exact(ray.far));
        place.crop(&sight, &mut stretches);
        place.lines(&sight, &stretches)
    }

    #[test]
    fn distant_scene_keeps_its_digits() {
        let far = DVec3::new(1e7, -3e7, 2e7);
        let place = Place { to_index: DAffine3::IDENTITY, block: Aabb::new(DVec3::ZERO, DVec3::ONE) };
        let met = meet(&place, DAffine3::from_translation(-far), &ray(far + DVec3::new(0.25, 0.5, -4.0)));
        let [line] = met.lines[..] else { panic!("the ray meets the block once") };
        assert_eq!(line.point(line.t[0]), DVec3::new(0.25, 0.5, 0.0));
        assert_eq!((line.anchor + line.t[0], line.t[1] - line.t[0]), (4.0, 1.0));
        assert!(line.dt < 1e-14 && line.ends[0].fine);
    }

    #[test]
    fn a_line_past_the_block_misses() {
        let place = Place { to_index: DAffine3::IDENTITY, block: Aabb::new(DVec3::ZERO, DVec3::ONE) };
        let count = |r: &Ray| meet(&place, DAffine3::IDENTITY, r).lines.len();
        let at = |x: f64| ray(DVec3::new(x, 0.5, -1.0));
        assert_eq!((count(&at(1.5)), count(&at(1.0)), count(&at(1.0 + 1e-15))), (0, 1, 0));
        assert_eq!(count(&Ray { near: 3.0, ..at(0.5) }), 0);
    }
}
