//! Meshes: each plane touches only the tetrahedra that it cuts.
//!
//! Vertices get their levels, cells are sorted by the first plane that cuts them, and a list of
//! those cut goes along from plane to plane. No cell is ordered against another: on a plane there is
//! no before and behind, so visibility cycles and holes do not matter.
//!
//! A vertex on a plane lies above it. Which edges of a cell are cut is then a matter of signs, which
//! all cells at a vertex see alike; a plane through a vertex, an edge or a face cuts the cells on one
//! side of it only.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::{
    Levels, Polygons, Slabs, Solid,
    polygon::{Clips, mix, mix_places, precedes},
};
use crate::Tessellation;

/// A mesh with the levels of its vertices.
#[derive(Debug)]
pub(super) struct Cells<'a> {
    solid: &'a Solid,
    mesh: Arc<Tessellation>,
    levels: Vec<f64>,
    flat: Option<DVec3>,
}

/// Slabs in the order in which they are visited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Run {
    pub first: i64,
    pub count: usize,
    pub ascending: bool,
}

impl Run {
    /// From number `start` up to, without, `end`.
    pub fn new([start, end]: [i64; 2], ascending: bool) -> Self {
        let count = usize::try_from(end.saturating_sub(start)).unwrap_or(0);
        Self { first: if ascending { start } else { end.saturating_sub(1) }, count, ascending }
    }

    pub fn number(&self, position: usize) -> i64 {
        if self.ascending { self.first + position as i64 } else { self.first - position as i64 }
    }

    /// The positions of the numbers `start..end` that are in it.
    fn positions(&self, [start, end]: [i64; 2]) -> [usize; 2] {
        let [a, b] = if self.ascending {
            [start.saturating_sub(self.first), end.saturating_sub(self.first)]
        } else {
            [end, start].map(|n| self.first.saturating_sub(n).saturating_add(1))
        };
        [a, b].map(|p| p.clamp(0, self.count as i64) as usize)
    }
}

/// The cells that the plane at hand cuts.
#[derive(Debug, Default)]
pub(super) struct Active {
    run: Run,
    /// Cells by the first position at which they are cut.
    order: Vec<u32>,
    /// Where the cells of each position begin in `order`.
    starts: Vec<u32>,
    /// Cells with the position after the last at which they are cut.
    cells: Vec<(u32, u32)>,
    next: usize,
}

impl<'a> Cells<'a> {
    pub fn new(solid: &'a Solid, mesh: Arc<Tessellation>, levels: &Levels) -> Self {
        let transform = solid.transform();
        let of = mesh.vertices.iter().map(|v| levels.at(transform.transform_point3(v))).collect();
        let flat = match levels {
            Levels::Planes { normal, .. } => Some(*normal),
            Levels::Shells { .. } => None,
        };
        Self { solid, mesh, levels: of, flat }
    }

    /// The lowest and the highest level of a cell's vertex.
    pub fn range(&self) -> [f64; 2] {
        let used = self.mesh.tetrahedra.iter().flatten().map(|v| self.levels[*v as usize]);
        used.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], l| [a.min(l), b.max(l)])
    }

    fn cell_range(&self, cell: &[u32; 4]) -> [f64; 2] {
        let levels = cell.map(|v| self.levels[v as usize]);
        levels.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], l| [a.min(*l), b.max(*l)])
    }

    /// Makes the list of active cells ready for a run.
    pub fn start(&self, slabs: &Slabs, run: Run) -> Active {
        let positions = |t: &[u32; 4]| {
            let [low, high] = self.cell_range(t);
            run.positions(slabs.cutting(low, high))
        };
        let mut starts = vec![0u32; run.count + 2];
        let cut = |[a, b]: [usize; 2]| a < b;
        for t in &self.mesh.tetrahedra {
            let p = positions(t);
            starts[p[0] + 1] += u32::from(cut(p));
        }
        for i in 0..=run.count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut order = vec![0u32; starts[run.count + 1] as usize];
        for (i, t) in self.mesh.tetrahedra.iter().enumerate() {
            let p = positions(t);
            if cut(p) {
                order[next[p[0]] as usize] = i as u32;
                next[p[0]] += 1;
            }
        }
        Active { run, order, starts, cells: Vec::new(), next: 0 }
    }

    /// Goes on to a position, which is not before the last.
    pub fn advance(&self, active: &mut Active, slabs: &Slabs, position: usize) {
        active.cells.retain(|(_, end)| *end as usize > position);
        let until = active.starts[position + 1] as usize;
        for &cell in &active.order[active.next..until] {
            let [low, high] = self.cell_range(&self.mesh.tetrahedra[cell as usize]);
            let [_, end] = active.run.positions(slabs.cutting(low, high));
            if end > position {
                active.cells.push((cell, end as u32));
            }
        }
        active.next = until.max(active.next);
    }

    /// Adds the polygons in which a plane cuts the active cells.
    pub fn cut(&self, active: &Active, level: f64, clips: &Clips<'_>, out: &mut Polygons) {
        out.clear(self.solid.attribute_numbers());
        active.cells.iter().for_each(|(cell, _)| self.cut_cell(*cell, level, clips, out));
    }

    /// Adds the polygon in which the surface of a level cuts a cell, if it does.
    pub fn cut_cell(&self, cell: u32, level: f64, clips: &Clips<'_>, out: &mut Polygons) {
        let corners = self.mesh.tetrahedra[cell as usize];
        let (mut above, mut below) = ([0; 4], [0; 4]);
        let (mut a, mut b) = (0, 0);
        for v in corners {
            if self.levels[v as usize] >= level {
                above[a] = v;
                a += 1;
            } else {
                below[b] = v;
                b += 1;
            }
        }
        // Pairs of corners above and below, in order around.
        let edges: &[[usize; 2]] = match a {
            1 => &[[0, 0], [0, 1], [0, 2]],
            2 => &[[0, 0], [0, 1], [1, 1], [1, 0]],
            3 => &[[0, 0], [1, 0], [2, 0]],
            _ => return,
        };
        let first = out.vertex_count();
        edges.iter().for_each(|[i, j]| self.cross(above[*i], below[*j], level, out));
        out.close(first, Some(cell), self.flat.unwrap_or_else(|| self.gradient(corners)), clips);
    }

    /// The gradient of levels that are linear in the cell, in world space.
    fn gradient(&self, corners: [u32; 4]) -> DVec3 {
        let matrix = self.solid.transform().matrix3;
        let [a, b, c, d] = corners.map(|v| self.mesh.vertices.at(v as usize));
        let edges = DMat3::from_cols(matrix * (b - a), matrix * (c - a), matrix * (d - a));
        let [la, lb, lc, ld] = corners.map(|v| self.levels[v as usize]);
        edges.transpose().inverse() * DVec3::new(lb - la, lc - la, ld - la)
    }

    /// Adds the vertex at which an edge meets a level.
    fn cross(&self, u: u32, v: u32, level: f64, out: &mut Polygons) {
        let place = |v: u32| self.mesh.vertices.at(v as usize);
        let [u, v] = if precedes(place(v), place(u)) { [v, u] } else { [u, v] };
        let (fu, fv) = (self.levels[u as usize] - level, self.levels[v as usize] - level);
        let t = fu / (fu - fv);
        let object = mix_places(place(u), place(v), t);
        let texture = match &self.mesh.texture_coordinates {
            Some(given) => mix_places(given.at(u as usize), given.at(v as usize), t),
            None => self.solid.texture(object),
        };
        let world = self.solid.transform().transform_point3(object);
        out.push_vertex([world, object, texture], |numbers| {
            let all = self.solid.attributes().flat_map(|(_, a)| (0..a.components).map(move |c| (a, c)));
            for (number, (attribute, component)) in numbers.iter_mut().zip(all) {
                let at = |v: u32| attribute.value(v as usize, component);
                *number = mix(at(u), at(v), t);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_at_the_ends_of_all_numbers_are_outside_of_runs() {
        for ascending in [true, false] {
            let run = Run::new([-3, 2], ascending);
            assert_eq!(run.positions([i64::MIN, i64::MAX]), [0, 5]);
            for far in [i64::MIN, i64::MAX] {
                let [a, b] = run.positions([far, far]);
                assert_eq!(a, b, "{far}");
            }
            assert_eq!(Run::new([i64::MIN; 2], ascending).count, 0);
        }
    }
}
