//! The cells that sixteen rays pass, with what they carry: numbers of vertices, and where a
//! deformed mesh has its volume.

use std::ops::ControlFlow;

use volact_core::{
    Points,
    glam::{DAffine3, DMat3, DVec3},
};

use crate::fast::{
    mesh::{build::Linked, trace::Crossing},
    packet::Vectors,
    part::lane,
    simd::LANES,
    stretches::Stretches,
};

/// A mesh as programs see it.
#[derive(Clone, Copy, Debug)]
pub struct Cells<'a> {
    /// Its tetrahedra.
    pub mesh: &'a Linked,
    /// Texture coordinates of its vertices, where it carries volumes along.
    pub texture: Option<&'a Points>,
    /// World to object space.
    pub to_object: DAffine3,
}

/// The cells passed, by lane.
#[derive(Debug)]
pub struct Trail<'a> {
    cells: Cells<'a>,
    crossings: [Vec<Crossing>; LANES],
}

impl<'a> Trail<'a> {
    /// The cells of rays given in object space, on some stretches.
    pub fn new(cells: Cells<'a>, rays: &[Vectors; 2], stretches: &Stretches) -> Self {
        let mut crossings: [Vec<Crossing>; LANES] = Default::default();
        for (l, list) in crossings.iter_mut().enumerate() {
            let [origin, direction] = lane(rays, l);
            for span in stretches.lane(l) {
                cells.mesh.trace(origin, direction, span, |crossing| {
                    // Cells over each other: the first one stays.
                    let behind = list.last().map_or(f64::NEG_INFINITY, |last: &Crossing| last.span[1]);
                    list.extend((crossing.span[1] > behind).then_some(*crossing));
                    ControlFlow::Continue(())
                });
            }
        }
        Self { cells, crossings }
    }

    /// Whether volumes are carried along.
    pub fn is_bent(&self) -> bool {
        self.cells.texture.is_some()
    }

    /// The cell at `t`, or the last one before.
    fn at(&self, l: usize, t: f64) -> Option<&Crossing> {
        let list = &self.crossings[l];
        let after = list.partition_point(|c| c.span[0] <= t);
        // The first one that holds it: a later one may begin inside of it.
        let first = list[..after].partition_point(|c| c.span[1] < t);
        list.get(first.min(after.saturating_sub(1)))
    }

    /// An interpolated number of vertices; NaN where there is no cell.
    pub fn number(&self, l: usize, t: f64, value: impl Fn(usize) -> f64) -> f64 {
        let Some(crossing) = self.at(l, t) else { return f64::NAN };
        let weights = crossing.weights_at(t);
        (0..4).map(|i| weights[i] * value(crossing.vertices[i] as usize)).sum()
    }

    /// From places around a sample, local to `origin`, to texture coordinates: the affine map of
    /// the sample's cell.
    pub fn map(&self, l: usize, t: f64, origin: DVec3) -> DAffine3 {
        let found = self.at(l, t).zip(self.cells.texture);
        let Some((crossing, texture)) = found else { return DAffine3::from_scale(DVec3::NAN) };
        let corners = crossing.vertices.map(|v| self.cells.mesh.vertices.at(v as usize));
        let textures = crossing.vertices.map(|v| texture.at(v as usize));
        let edges = |p: [DVec3; 4]| DMat3::from_cols(p[1] - p[0], p[2] - p[0], p[3] - p[0]);
        let linear = edges(textures) * edges(corners).inverse();
        let weights = crossing.weights_at(t);
        let mean = |p: [DVec3; 4]| (0..4).map(|i| p[i] * weights[i]).sum::<DVec3>();
        // Exact at the sample, however thin the cell is.
        let linear = if linear.is_finite() { linear } else { DMat3::ZERO };
        let to_texture = DAffine3::from_mat3_translation(linear, mean(textures) - linear * mean(corners));
        to_texture * self.cells.to_object * DAffine3::from_translation(origin)
    }
}
