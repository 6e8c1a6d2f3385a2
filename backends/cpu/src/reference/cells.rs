//! A line's way through the cells of a grid.
//!
//! For the linear filter a cell lies between samples, for the nearest one around a sample. The
//! walk (J. Amanatides, A. Woo, *A fast voxel traversal algorithm*, 1987) computes every crossing
//! from its plane, never by adding up steps. Bricks of cells in which nothing can be seen are
//! left out at once; the integral does not change by that, since nothing is absorbed there.

use super::{
    line::Line,
    medium::{Medium, Voxels},
};

/// Cells along an edge of a brick.
const BRICK: usize = 8;

/// The stretch of a line inside one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Lowest sample; for the nearest filter the sample.
    pub base: [usize; 3],
    /// 1 along axes on which the cell has extent, else 0.
    pub upper: [usize; 3],
    /// Where it begins and ends, counted from the line's anchor.
    pub t: [f64; 2],
    /// Fractions within the cell where the stretch begins.
    pub from: [f64; 3],
    /// Their change over the stretch.
    pub step: [f64; 3],
    /// Whether the block begins, and ends, here.
    pub ends: [bool; 2],
}

/// The grid of a medium, and which of its bricks are empty.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    lo: [usize; 3],
    /// Cells along each axis, at least one.
    cells: [usize; 3],
    /// 1 along axes of several samples.
    extent: [usize; 3],
    nearest: bool,
    bricks: [usize; 3],
    empty: Vec<bool>,
}

impl Grid {
    /// The grid of a medium's voxels. With `skip` the bricks that cannot be seen are found, which
    /// reads every sample once.
    pub fn new(medium: &Medium, voxels: &Voxels<'_>, skip: bool) -> Self {
        let (roi, nearest) = (voxels.roi, voxels.nearest);
        let dims = roi.dims();
        let cells = dims.map(|n| if nearest { n } else { n.saturating_sub(1).max(1) });
        let extent = dims.map(|n| usize::from(n > 1));
        let bricks = cells.map(|n| n.div_ceil(BRICK));
        let mut grid = Self { lo: roi.min, cells, extent, nearest, bricks, empty: Vec::new() };
        if skip && medium.has_opacity() {
            grid.empty = grid.find_empty(medium, voxels);
        }
        grid
    }

    fn find_empty(&self, medium: &Medium, voxels: &Voxels<'_>) -> Vec<bool> {
        let [bx, by, bz] = self.bricks;
        let mut empty = Vec::with_capacity(bx * by * bz);
        for brick in 0..bx * by * bz {
            let at = [brick % bx, brick / bx % by, brick / (bx * by)];
            empty.push(self.is_empty(medium, voxels, at));
        }
        empty
    }

    fn is_empty(&self, medium: &Medium, voxels: &Voxels<'_>, brick: [usize; 3]) -> bool {
        let first = [0, 1, 2].map(|a| brick[a] * BRICK);
        let last = [0, 1, 2].map(|a| {
            let end = (first[a] + BRICK).min(self.cells[a]);
            if self.nearest { end - 1 } else { end - 1 + self.extent[a] }
        });
        let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 4];
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let sample = [self.lo[0] + x, self.lo[1] + y, self.lo[2] + z];
                    let Some(values) = medium.at_sample(voxels, sample) else { continue };
                    for (r, v) in range.iter_mut().zip(values) {
                        *r = [r[0].min(v), r[1].max(v)];
                    }
                }
            }
        }
        let opacity = medium.fields.iter().zip(&range).find(|(f, _)| f.drives[3]);
        opacity.is_some_and(|(field, r)| {
            let infinite = r.iter().any(|v| v.is_infinite());
            r[0] > r[1] || (!infinite && field.knots.bounds(r[0], r[1])[3][1] == 0.0)
        })
    }

    /// Visits the cells of a line in order until `visit` says false.
    pub fn walk(&self, line: &Line, mut visit: impl FnMut(&Cell) -> bool) {
        let shift = if self.nearest { 0.5 } else { 0.0 };
        let [start, end] = line.t;
        let mut t = start;
        let mut base = [0, 1, 2].map(|a| self.locate(line, a, t, shift));
        loop {
            let brick_exit = self.empty_brick(&base).map(|brick| self.brick_exit(line, brick, shift));
            let (exit, axis) = brick_exit.unwrap_or_else(|| self.cell_exit(line, &base, shift));
            let next = exit.min(end).max(t);
            if brick_exit.is_none() && next > t && !visit(&self.cell(line, base, [t, next], [t == start, next == end]))
            {
                return;
            }
            if exit >= end {
                return;
            }
            t = next;
            if brick_exit.is_some() {
                let leaving = base;
                base = [0, 1, 2].map(|a| self.locate(line, a, t, shift));
                self.leave_brick(line, &leaving, axis, &mut base);
            } else if line.step[axis] > 0.0 {
                base[axis] += 1;
            } else {
                base[axis] -= 1;
            }
        }
    }

    /// The cell along an axis that a line enters at `t`.
    fn locate(&self, line: &Line, axis: usize, t: f64, shift: f64) -> usize {
        let p = line.at(axis, t, self.lo[axis] as f64) + shift;
        let below = if line.step[axis] < 0.0 && p == p.floor() { p - 1.0 } else { p.floor() };
        below.clamp(0.0, (self.cells[axis] - 1) as f64) as usize
    }

    /// Where the first of three planes is crossed, and along which axis.
    fn first_crossing(line: &Line, plane: [Option<f64>; 3]) -> (f64, usize) {
        let mut first = (f64::INFINITY, 0);
        for (axis, plane) in plane.into_iter().enumerate() {
            let t = plane.map_or(f64::INFINITY, |p| line.crossing(axis, p));
            if t < first.0 {
                first = (t, axis);
            }
        }
        first
    }

    fn cell_exit(&self, line: &Line, base: &[usize; 3], shift: f64) -> (f64, usize) {
        let plane = |a: usize| {
            let d = line.step[a];
            let inner = if d > 0.0 { base[a] + 1 < self.cells[a] } else { base[a] > 0 };
            let cell = base[a] + usize::from(d > 0.0);
            (d != 0.0 && inner).then(|| (self.lo[a] + cell) as f64 - shift)
        };
        Self::first_crossing(line, [plane(0), plane(1), plane(2)])
    }

    fn empty_brick(&self, base: &[usize; 3]) -> Option<[usize; 3]> {
        if self.empty.is_empty() {
            return None;
        }
        let brick = base.map(|b| b / BRICK);
        let [bx, by, _] = self.bricks;
        self.empty[(brick[2] * by + brick[1]) * bx + brick[0]].then_some(brick)
    }

    fn brick_exit(&self, line: &Line, brick: [usize; 3], shift: f64) -> (f64, usize) {
        let plane = |a: usize| {
            let d = line.step[a];
            let inner = if d > 0.0 { brick[a] + 1 < self.bricks[a] } else { brick[a] > 0 };
            let cell = (brick[a] + usize::from(d > 0.0)) * BRICK;
            (d != 0.0 && inner).then(|| (self.lo[a] + cell) as f64 - shift)
        };
        Self::first_crossing(line, [plane(0), plane(1), plane(2)])
    }

    /// Makes sure that a step out of a brick goes one brick on along `axis` and stays inside it
    /// along the others, whatever rounding says.
    fn leave_brick(&self, line: &Line, from: &[usize; 3], axis: usize, base: &mut [usize; 3]) {
        for a in 0..3 {
            let first = from[a] / BRICK * BRICK;
            let last = (first + BRICK).min(self.cells[a]) - 1;
            base[a] = match (a == axis, line.step[a] > 0.0) {
                (false, _) => base[a].clamp(first, last),
                (true, true) => last + 1,
                (true, false) => first - 1,
            };
        }
    }

    fn cell(&self, line: &Line, base: [usize; 3], t: [f64; 2], ends: [bool; 2]) -> Cell {
        let mut sample = [0, 1, 2].map(|a| self.lo[a] + base[a]);
        if self.nearest {
            return Cell { base: sample, upper: [0; 3], t, from: [0.0; 3], step: [0.0; 3], ends };
        }
        let mut upper = self.extent;
        let mut from = [0.0; 3];
        let mut step = [0.0; 3];
        for a in 0..3 {
            if upper[a] == 1 {
                from[a] = line.at(a, t[0], sample[a] as f64);
                step[a] = line.step[a] * (t[1] - t[0]);
                // In a face itself the samples on either side of it have no weight.
                if step[a] == 0.0 && (from[a] == 0.0 || from[a] == 1.0) {
                    sample[a] += from[a] as usize;
                    (from[a], upper[a]) = (0.0, 0);
                }
            }
        }
        Cell { base: sample, upper, t, from, step, ends }
    }
}
