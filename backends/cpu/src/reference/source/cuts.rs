//! Where a ray meets what the volumes of a program have edges at: the faces of their cells, the
//! borders between nearest samples, and the ends of their regions. Between those, interpolated
//! values and gradients are smooth.

use volact_core::{
    Filter, ParameterValue, VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::ParameterMap,
};
use volact_shaders::{Program, eval::Function, signatures::Derived};

use super::program::Course;
use crate::reference::line::EPS;

/// The grids that a program reads.
#[derive(Clone, Debug, Default)]
pub(in crate::reference) struct Grids(Vec<Grid>);

/// The planes of one volume, in its sample coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grid {
    /// From local space.
    to_index: DAffine3,
    /// From texture coordinates.
    unbent: DAffine3,
    /// The last sample along each axis.
    last: [usize; 3],
    /// 0 for planes through samples, ½ for planes between them.
    shift: f64,
    /// The ends of its region.
    ends: [DVec3; 2],
}

impl Grids {
    /// The grids of what a program asks for.
    pub fn new(program: &Program, parameters: &ParameterMap, functions: &[Function], to_object: DAffine3) -> Self {
        let mut grids: Vec<Grid> = Vec::new();
        for function in functions {
            let name = program.declaration().parameters.get(function.parameter).map(|p| p.name.as_str());
            let Some(ParameterValue::Volume(texture)) = name.and_then(|n| parameters.get(n)) else { continue };
            let grid = Grid::new(texture, function.derived, to_object);
            if !grids.contains(&grid) {
                grids.push(grid);
            }
        }
        Self(grids)
    }

    /// The places between two ends, in order and with the ends, at which to cut.
    pub fn cuts(&self, course: &Course<'_>, [start, end]: [f64; 2]) -> Vec<f64> {
        let mut cuts = vec![start, end];
        if course.cells.is_empty() {
            self.0.iter().for_each(|grid| grid.cut(course, grid.to_index, [start, end], &mut cuts));
        }
        for cell in course.cells {
            let t = [cell.t[0].max(start), cell.t[1].min(end)];
            cuts.extend(t.into_iter().filter(|t| *t > start && *t < end));
            let map = |grid: &Grid| cell.bent.map_or(grid.to_index, |bent| grid.unbent * bent);
            self.0.iter().for_each(|grid| grid.cut(course, map(grid), t, &mut cuts));
        }
        cuts.sort_by(f64::total_cmp);
        // What is nearer than rounding is one.
        let near = 64.0 * EPS * (start.abs().max(end.abs()) + course.at.abs().max_element());
        let mut kept: Vec<f64> = Vec::with_capacity(cuts.len());
        for t in cuts {
            if kept.last().is_none_or(|last| t - last > near) {
                kept.push(t);
            }
        }
        if kept.last() != Some(&end) {
            // The end is what it is.
            kept.truncate(kept.len().max(2) - 1);
            kept.push(end);
        }
        kept
    }
}

impl Grid {
    fn new(texture: &VolumeTexture, derived: Derived, to_object: DAffine3) -> Self {
        let object_to_index = texture.object_to_index();
        // Gradients are of the interpolated data, whatever the filter.
        let nearest =
            derived == Derived::Nearest || texture.filter() == Filter::Nearest && derived != Derived::Gradient;
        let roi = texture.geometry_roi();
        Self {
            to_index: object_to_index * to_object,
            unbent: object_to_index * DAffine3::from_translation(roi.min) * DAffine3::from_scale(roi.max - roi.min),
            last: texture.volume().dims().map(|n| n - 1),
            shift: if nearest { 0.5 } else { 0.0 },
            ends: [roi.min, roi.max].map(|p| object_to_index.transform_point3(p)),
        }
    }

    fn cut(&self, course: &Course<'_>, map: DAffine3, [start, end]: [f64; 2], cuts: &mut Vec<f64>) {
        let (at, step) = (map.transform_point3(course.at), map.transform_vector3(course.direction));
        for a in 0..3 {
            if step[a] == 0.0 {
                continue;
            }
            let x = [start, end].map(|t| at[a] + step[a] * t);
            let (low, high) = (x[0].min(x[1]), x[0].max(x[1]));
            let last = self.last[a] as f64 - self.shift;
            let first = (low - self.shift).ceil().max(0.0) as usize;
            let planes = (first..).map(|k| k as f64 + self.shift).take_while(|p| *p <= high.min(last));
            let ends = self.ends.map(|p| p[a]).into_iter();
            cuts.extend(planes.chain(ends).map(|p| (p - at[a]) / step[a]).filter(|t| *t > start && *t < end));
        }
    }
}
