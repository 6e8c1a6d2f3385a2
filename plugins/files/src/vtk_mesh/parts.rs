//! What the sections of a legacy file say, and the mesh or surface that they make.

use std::{path::Path, sync::Arc};

use volact_core::{Geometry, LoadError, MeshData, Points, Warning};

use crate::{
    mesh::{
        Attributes, Blanking, CellArrays, CellLayout, Cells, GHOSTS, Named, Triangles, codes, finite_points, note,
        structured,
    },
    numbers::Numbers,
};

/// What the sections of a file say.
#[derive(Default)]
pub(super) struct Parts {
    pub(super) dataset: String,
    pub(super) dims: Option<[usize; 3]>,
    pub(super) visible: Option<Vec<u8>>,
    pub(super) points: Option<Numbers>,
    pub(super) cells: Option<(Numbers, CellLayout, u64)>,
    pub(super) types: Option<Numbers>,
    pub(super) faces: Vec<(Numbers, CellLayout, u64, bool)>,
    pub(super) thin: u64,
    pub(super) attributes: Vec<Named>,
    pub(super) normals: Option<Numbers>,
    pub(super) hidden_points: Option<Vec<bool>>,
    pub(super) ghosts: Option<Vec<bool>>,
    pub(super) cell_data: Vec<String>,
    pub(super) left_out: Vec<String>,
}

/// To whom arrays belong.
#[derive(Clone, Copy)]
pub(super) enum Owner {
    Dataset,
    Points(u64),
    Cells(u64),
}

impl Parts {
    pub(super) fn left_out(&mut self, owner: Owner, name: String) {
        match owner {
            Owner::Points(_) => self.left_out.push(name),
            Owner::Cells(_) => self.cell_data.push(name),
            Owner::Dataset => {}
        }
    }

    pub(super) fn build(
        mut self,
        path: &Path,
        name: String,
        mut warnings: Vec<Warning>,
    ) -> Result<MeshData, LoadError> {
        let missing = |what: &str| LoadError::invalid(path, what, "missing", "one");
        let numbers = self.points.take().ok_or_else(|| missing("section POINTS"))?;
        let geometry: Arc<dyn Geometry> = match self.dataset.as_str() {
            "UNSTRUCTURED_GRID" => self.unstructured(path, &name, numbers, &mut warnings)?,
            "STRUCTURED_GRID" => self.structured(path, numbers)?,
            "POLYDATA" => self.surface(path, &name, numbers, &mut warnings)?,
            _ => return Err(missing("keyword DATASET")),
        };
        let vertices = geometry.vertex_count().unwrap_or(0);
        let mut attributes = Attributes::new(path, &name);
        for named in self.attributes {
            attributes.add(named, vertices, &mut warnings)?;
        }
        let attributes = attributes.finish();
        Ok(MeshData { name, geometry, attributes, warnings })
    }

    fn unstructured(
        &mut self,
        path: &Path,
        file: &str,
        numbers: Numbers,
        warnings: &mut Vec<Warning>,
    ) -> Result<Arc<dyn Geometry>, LoadError> {
        let missing = |what: &str| LoadError::invalid(path, what, "missing", "one");
        let (connectivity, layout, count) = self.cells.take().ok_or_else(|| missing("section CELLS"))?;
        let types = self.types.take().ok_or_else(|| missing("section CELL_TYPES"))?;
        if types.len() as u64 != count {
            let wanted = format!("{count}, one for each of CELLS");
            return Err(LoadError::invalid(path, "number of CELL_TYPES", types.len(), wanted));
        }
        let arrays = CellArrays { types: codes(path, &types)?, connectivity, layout };
        let points = finite_points(path, numbers, |vertex| arrays.owner(vertex))?;
        let ghosts = checked(path, "cells", self.ghosts.take(), types.len())?;
        let hidden = |cell: usize| ghosts.as_ref().is_some_and(|g| g[cell]);
        let mut cells = Cells::new(path, 1);
        cells.add(&arrays, points.len(), hidden, |i| i)?;
        Ok(Arc::new(cells.finish(file, points, warnings)?))
    }

    fn structured(&mut self, path: &Path, numbers: Numbers) -> Result<Arc<dyn Geometry>, LoadError> {
        let dims = self.dims.ok_or_else(|| LoadError::invalid(path, "section DIMENSIONS", "missing", "one"))?;
        let [nx, ny, _] = dims;
        let owner = |v: usize| format!("at {:?} of the grid", [v % nx, v / nx % ny, v / nx / ny]);
        let points = finite_points(path, numbers, owner)?;
        let hidden = checked(path, "points", self.hidden_points.take(), points.len())?;
        let hidden = hidden.map(|h| h.into_iter().map(|h| u8::from(!h)).collect());
        let cells = dims.iter().map(|n| n.saturating_sub(1)).product();
        let ghosts = checked(path, "cells", self.ghosts.take(), cells)?;
        let cells = ghosts.map(|g| g.into_iter().map(|g| !g).collect());
        structured(path, dims, points, Blanking { vertices: self.visible.take().or(hidden), cells })
    }

    fn surface(
        &mut self,
        path: &Path,
        file: &str,
        numbers: Numbers,
        warnings: &mut Vec<Warning>,
    ) -> Result<Arc<dyn Geometry>, LoadError> {
        if self.thin > 0 {
            warnings.push(note(file, format!("{} vertices and lines are left out of the surface", self.thin)));
        }
        let points: Points = finite_points(path, numbers, |_| "of the surface".into())?;
        let mut triangles = Triangles::new(path, &points);
        for (connectivity, layout, count, strip) in self.faces.drain(..) {
            triangles.add_all(&connectivity, &layout, count, strip, 0..points.len())?;
        }
        let mut surface = triangles.finish(file, warnings)?;
        if let Some(normals) = self.normals.take() {
            let normals = finite_points(path, normals, |_| "a normal".into())?;
            surface = surface.with_normals(normals).map_err(|source| LoadError::geometry(path, source))?;
        }
        Ok(Arc::new(surface))
    }
}

/// Flags, as many as there should be.
fn checked(path: &Path, what: &str, flags: Option<Vec<bool>>, wanted: usize) -> Result<Option<Vec<bool>>, LoadError> {
    match flags {
        Some(flags) if flags.len() != wanted => {
            let what = format!("number of flags {GHOSTS:?} of {what}");
            Err(LoadError::invalid(path, what, flags.len(), wanted.to_string()))
        }
        flags => Ok(flags),
    }
}
