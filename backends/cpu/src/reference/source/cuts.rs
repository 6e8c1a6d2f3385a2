//! Where a ray meets what the volumes of a program have edges at: the faces of their cells, the
//! borders between nearest samples, and the ends of their regions. Between those, interpolated
//! values and gradients are smooth.
//!
//! Where the value itself, or a number of the vertices, meets a control point of any table, there is
//! a cut, too: most sources look values up, and what is narrow in a table would be overlooked.
//! Between two cuts a value is a cubic, known by four samples.

use volact_core::{
    Filter, ParameterValue, VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::ParameterMap,
};
use volact_shaders::{Program, eval::Function, signatures::Derived};

use super::{
    fit::{POINTS, through},
    program::Course,
};
use crate::reference::{cubic, line::EPS};

/// The most control points that are looked for between two cuts; where there are more, parts of
/// that number have to do.
const CONTROLS: usize = 24;

/// The grids that a program reads.
#[derive(Clone, Debug, Default)]
pub(in crate::reference) struct Grids {
    grids: Vec<Grid>,
    /// The interpolated values that it reads.
    values: Vec<Value>,
    /// The control points of all tables, in rising order.
    controls: Vec<f64>,
}

/// A component of a volume as it is interpolated.
#[derive(Clone, Debug)]
struct Value {
    texture: VolumeTexture,
    component: usize,
    /// From local space, and from texture coordinates, to samples.
    to_index: DAffine3,
    unbent: DAffine3,
}

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
        let (mut grids, mut values): (Vec<Grid>, _) = (Vec::new(), Vec::new());
        let component = parameters.get("component").and_then(ParameterValue::as_float).map_or(0, |c| c as usize);
        for function in functions {
            let name = program.declaration().parameters.get(function.parameter).map(|p| p.name.as_str());
            let Some(ParameterValue::Volume(texture)) = name.and_then(|n| parameters.get(n)) else { continue };
            let grid = Grid::new(texture, function.derived, to_object);
            if !grids.contains(&grid) {
                grids.push(grid);
            }
            if function.derived == Derived::Value && texture.filter() == Filter::Linear {
                let component = component.min(texture.volume().desc().components - 1);
                let Grid { to_index, unbent, .. } = grid;
                values.push(Value { texture: texture.clone(), component, to_index, unbent });
            }
        }
        Self { grids, values, controls: controls(program, parameters) }
    }

    /// The places between two ends, in order and with the ends, at which to cut.
    pub fn cuts(&self, course: &Course<'_>, ends: [f64; 2]) -> Vec<f64> {
        let faces = self.faces(course, ends);
        let mut cuts = faces.clone();
        for t in faces.windows(2) {
            let cell = course.cell(0.5 * (t[0] + t[1]));
            let known = self.values.iter().map(|value| value.along(course, cell.and_then(|c| c.bent), [t[0], t[1]]));
            let numbers = cell.into_iter().flat_map(|c| c.linear([t[0], t[1]]));
            known.chain(numbers).for_each(|value| self.controlled(&value, [t[0], t[1]], &mut cuts));
        }
        tidy(cuts, course, ends)
    }

    /// Cuts where a value, a cubic over 0 to 1, meets control points.
    fn controlled(&self, value: &cubic::Cubic, [start, end]: [f64; 2], cuts: &mut Vec<f64>) {
        if self.controls.is_empty() || value.iter().any(|v| !v.is_finite()) {
            return;
        }
        let place = |s: f64| start + (end - start) * s;
        let mut found = Vec::new();
        let mut from = 0.0;
        for to in cubic::critical_points(value).into_iter().filter(|s| !s.is_nan()).chain([1.0]) {
            let (a, b) = (cubic::eval(value, from), cubic::eval(value, to));
            let first = self.controls.partition_point(|c| *c <= a.min(b));
            let last = self.controls.partition_point(|c| *c < a.max(b));
            if last.saturating_sub(first) + found.len() > CONTROLS {
                cuts.extend((1..CONTROLS).map(|k| place(k as f64 / CONTROLS as f64)));
                return;
            }
            let inner = &self.controls[first..last.max(first)];
            found.extend(inner.iter().map(|c| place(cubic::crossing(value, *c, from, to))));
            from = to;
        }
        cuts.extend(found);
    }

    /// The places at which something that it reads changes its cell.
    fn faces(&self, course: &Course<'_>, [start, end]: [f64; 2]) -> Vec<f64> {
        let mut cuts = vec![start, end];
        if course.cells.is_empty() {
            self.grids.iter().for_each(|grid| grid.cut(course, grid.to_index, [start, end], &mut cuts));
        }
        for cell in course.cells {
            let t = [cell.t[0].max(start), cell.t[1].min(end)];
            cuts.extend(t.into_iter().filter(|t| *t > start && *t < end));
            let map = |grid: &Grid| cell.bent.map_or(grid.to_index, |bent| grid.unbent * bent);
            self.grids.iter().for_each(|grid| grid.cut(course, map(grid), t, &mut cuts));
        }
        tidy(cuts, course, [start, end])
    }
}

/// Places in order and apart, with both ends.
fn tidy(mut cuts: Vec<f64>, course: &Course<'_>, [start, end]: [f64; 2]) -> Vec<f64> {
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

/// The values of all control points.
fn controls(program: &Program, parameters: &ParameterMap) -> Vec<f64> {
    let declared = || program.declaration().parameters.iter().filter_map(|p| parameters.get(&p.name));
    let range = declared().find_map(|value| match value {
        ParameterValue::Volume(texture) => Some(texture.range()),
        _ => None,
    });
    let points = |value: &ParameterValue| match value {
        ParameterValue::Table(table) => table.resolve(range.unwrap_or([0.0, 1.0])).points().to_vec(),
        _ => Vec::new(),
    };
    let mut all: Vec<f64> = declared().flat_map(points).map(|p| p.value).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

impl Value {
    /// The value between two cuts, as a cubic over 0 to 1.
    fn along(&self, course: &Course<'_>, bent: Option<DAffine3>, [start, end]: [f64; 2]) -> cubic::Cubic {
        let map = bent.map_or(self.to_index, |bent| self.unbent * bent);
        let (middle, half) = (0.5 * (start + end), 0.5 * (end - start));
        let at = |y: f64| map.transform_point3(course.at + course.direction * (middle + half * y));
        let values = POINTS.map(|y| self.texture.sample(at(y), self.component));
        cubic::restrict(&through(values), -1.0, 2.0)
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
