//! The numbers of a shape as rows of a buffer.

use volact_core::{
    Clip, ClipRegion, Compositing, ControlPoint, LookupTable, ParameterType, ParameterValue, SliceStyle, VolumeTexture,
    glam::{DAffine3, DVec3, DVec4},
    mutated,
    resolve::ResolvedShape,
    volume::Components,
};

use super::{Anchor, Layout, Recipe, SHAPE_ROWS, mesh, skip::Cells, voxels::Units};
use crate::{
    eval::{Function, Uniform, Uniforms},
    signatures::{Derived, kind_of},
};

/// One row.
pub type Row = [u32; 4];

/// A shape to be written.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    /// The shape.
    pub shape: &'a ResolvedShape,
    /// Its recipe.
    pub recipe: &'a Recipe,
    /// Its number among the shapes of the module.
    pub number: usize,
    /// For each declared parameter what the numbers in its texture mean.
    pub units: &'a [Option<Units>],
    /// For each declared parameter where its table begins.
    pub tables: &'a [u32],
    /// What can be skipped.
    pub cells: Option<Cells>,
    /// Its mesh, where it is one.
    pub mesh: Option<mesh::Placed>,
    /// For each declared parameter where its attribute lies.
    pub attributes: &'a [Row],
}

/// Writes shapes that are drawn with a layout from an anchor; what is longer for some than for others
/// goes behind the layout's rows.
pub fn write(layout: &Layout, anchor: &Anchor, clip: &Clip, shapes: &[Shape<'_>]) -> Vec<Row> {
    let mut rows = vec![[0; 4]; layout.rows as usize];
    for shape in shapes {
        let origin = shape.shape.world_block();
        let origin = 0.5 * (origin.min + origin.max);
        shape.write_parameters(&mut rows, layout, origin);
        shape.write_place(&mut rows, anchor, clip, origin);
        shape.write_cells(&mut rows, layout);
    }
    rows
}

/// The control points that a table parameter stands for: an opaque grey ramp over the range of the
/// shape's first volume where it was left out.
pub fn points(shape: &ResolvedShape, name: &str) -> Vec<ControlPoint> {
    let range = shape.first_volume().map_or([0.0, 1.0], VolumeTexture::range);
    match shape.table(name) {
        Some(table) => table.points(range),
        None => LookupTable::grey([range[0].min(range[1]), range[0].max(range[1])]).points(range),
    }
}

fn floats(v: [f64; 4]) -> Row {
    v.map(|v| (v as f32).to_bits())
}

pub(super) fn float3(v: DVec3, w: f64) -> Row {
    floats([v.x, v.y, v.z, w])
}

pub(super) fn write_affine(rows: &mut [Row], first: usize, map: &DAffine3) {
    for a in 0..3 {
        rows[first + a] = float3(map.matrix3.row(a), map.translation[a]);
    }
}

fn plane(normal: DVec3, offset: f64, origin: DVec3) -> Row {
    float3(normal, offset - normal.dot(origin))
}

/// Writes the regions of clips of the world behind other rows; gives the first and how many there are.
pub(super) fn write_clips(rows: &mut Vec<Row>, clips: &[&Clip], origin: DVec3) -> Row {
    let first = rows.len() as u32;
    let regions = || clips.iter().flat_map(|c| c.regions());
    for region in regions() {
        rows.push([region.bounding_planes().len() as u32, u32::from(region.keeps_inside()), 0, 0]);
        rows.extend(region.bounding_planes().iter().map(|p| plane(p.normal(), p.offset(), origin)));
    }
    [first, regions().count() as u32, 0, 0]
}

impl Shape<'_> {
    fn write_parameters(&self, rows: &mut [Row], layout: &Layout, origin: DVec3) {
        let program = &self.recipe.program;
        let uniforms =
            Uniforms { parameters: &self.shape.parameters, object_to_world: self.shape.state.transform, origin };
        for (i, parameter) in program.declaration().parameters.iter().enumerate() {
            let slot = layout.slots[self.number][i];
            let (row, given) = (slot.row as usize, self.shape.parameters.get(&parameter.name));
            rows[slot.given as usize][0] = u32::from(given.is_some());
            match (given, self.units[i]) {
                (Some(ParameterValue::Volume(texture)), Some(units)) => {
                    self.write_volume(&mut rows[row..], texture, &units, origin, &uniforms, i);
                    continue;
                }
                (Some(ParameterValue::Table(_)), _) => {
                    rows[row][0] = self.tables[i];
                    continue;
                }
                _ => {}
            }
            let count = super::layout::rows_of(kind_of(parameter)) as usize;
            match kind_of(parameter) {
                Some(ParameterType::Table) => {
                    rows[row][0] = self.tables[i];
                    continue;
                }
                Some(ParameterType::Attribute) => {
                    rows[row] = self.attributes[i];
                    continue;
                }
                _ => {}
            }
            let bits = match uniforms.value(program, Function { parameter: i, derived: Derived::Plain }) {
                Some(Uniform::Floats(v)) => v.iter().map(|v| (*v as f32).to_bits()).collect(),
                Some(Uniform::Int(v)) => vec![v as i32 as u32],
                Some(Uniform::Bool(v)) => vec![u32::from(v)],
                None => Vec::new(),
            };
            for (to, from) in rows[row..row + count].as_flattened_mut().iter_mut().zip(bits) {
                *to = from;
            }
            if let Some(ParameterValue::Vec3(v)) = given {
                rows[row + 1] = float3(*v - origin, 0.0);
            }
        }
    }

    fn write_volume(
        &self,
        rows: &mut [Row],
        texture: &VolumeTexture,
        units: &Units,
        origin: DVec3,
        uniforms: &Uniforms<'_>,
        parameter: usize,
    ) {
        let desc = texture.volume().desc();
        let to_object = self.shape.to_object * DAffine3::from_translation(origin);
        let (roi, block) = (texture.data_roi(), texture.geometry_roi());
        let vector = |v: [usize; 3]| DVec3::from_array(v.map(|v| v as f64));
        write_affine(rows, 0, &(texture.object_to_index() * to_object));
        let component = self.shape.int("component").unwrap_or(0).clamp(0, 3) as u32;
        rows[3] = float3(vector(roi.min), 0.0);
        rows[3][3] = component.min(desc.components as u32 - 1);
        let spacing = match uniforms.value(&self.recipe.program, Function { parameter, derived: Derived::Spacing }) {
            Some(Uniform::Floats(v)) => v.first().copied().unwrap_or(0.0),
            _ => 0.0,
        };
        rows[4] = float3(vector(roi.max), spacing);
        rows[5] = float3(vector(desc.dims) - DVec3::ONE, 0.0);
        rows[5][3] = desc.components as u32;
        let [low, high] = texture.range();
        rows[6] = floats([units.scale, units.offset, low, 1.0 / (high - low)]);
        let unit = DAffine3::from_scale(1.0 / (block.max - block.min)) * DAffine3::from_translation(-block.min);
        write_affine(rows, 7, &(unit * to_object));
        let meaning = match texture.meaning() {
            Components::Intensity => 0,
            Components::Luminance => 1,
            Components::LuminanceAlpha => 2,
            Components::Rgb => 3,
            Components::Rgba => 4,
        };
        let size = 1.0 / vector(desc.dims);
        rows[10] = floats([0.0, size.x, size.y, size.z]);
        rows[10][0] = meaning;
    }

    fn write_place(&self, rows: &mut Vec<Row>, anchor: &Anchor, clip: &Clip, origin: DVec3) {
        let shape = self.shape;
        let first = self.number * SHAPE_ROWS as usize;
        let unit = shape.float("unit_distance").unwrap_or(1.0);
        let point = if mutated!("positions_in_f32") { anchor.point.as_vec3().as_dvec3() } else { anchor.point };
        rows[first] = float3(point - origin, unit);
        let from_local = shape.to_object * DAffine3::from_translation(origin);
        match self.mesh {
            Some(mesh) => {
                write_affine(rows, first + 1, &(mesh.unit * from_local));
                rows[first + 7][1] = mesh.row;
            }
            None => self.write_block(&mut rows[first + 1..], &from_local),
        }
        let kind = match shape.compositing() {
            Compositing::Over => 0,
            Compositing::First => 1,
            Compositing::Maximum => 2,
            Compositing::Minimum => 3,
            Compositing::Average => 4,
            Compositing::Add => 5,
        };
        let slices = shape.state.geometry.slices();
        let inside = u32::from(slices.is_none_or(|s| s.volume));
        let opaque = u32::from(slices.is_some_and(|s| s.style == SliceStyle::Opaque));
        let own = shape.state.clip.transformed(&shape.state.transform);
        let region = self.mesh.and_then(|_| shape.first_volume());
        let region =
            region.map(|t| Clip::new([ClipRegion::crop(t.geometry_roi())]).transformed(&shape.state.transform));
        let [regions, count, ..] = write_clips(rows, &[&region.unwrap_or_default(), &own, clip], origin);
        let (mesh, carries) = (u32::from(self.mesh.is_some()), u32::from(self.recipe.carries));
        let flags = inside | opaque << 1 | mesh << 2 | carries << 3;
        rows[first + 4] = [regions, count, kind, flags];
        let levels = self.levels();
        rows[first + 5] = [rows.len() as u32, levels.len() as u32, (rows.len() + levels.len()) as u32, 0];
        rows.extend(levels.iter().map(|v| floats([*v, 0.0, 0.0, 0.0])));
        for p in slices.iter().flat_map(|s| &s.planes) {
            let normal = shape.to_object.matrix3.transpose() * p.normal();
            let offset = p.offset() - p.normal().dot(shape.to_object.translation);
            let size = normal.length();
            rows.push(plane(normal / size, offset / size, origin));
            rows[first + 5][3] += 1;
        }
    }

    fn write_cells(&self, rows: &mut [Row], layout: &Layout) {
        let Some(cells) = self.cells else { return };
        let first = self.number * SHAPE_ROWS as usize;
        let [x, y, z] = cells.count;
        rows[first + 6] = [cells.base, x, y, z];
        rows[first + 7][0] = layout.slots[self.number][cells.volume].row;
    }

    /// The map from local space to the block as a unit cube.
    fn write_block(&self, rows: &mut [Row], from_local: &DAffine3) {
        // A box that is nothing in one direction holds no ray; its map is not a number there.
        let block = self.shape.block().filter(|_| !mutated!("forgotten_roi"));
        let block = block.unwrap_or_else(|| self.shape.state.geometry.bounds());
        let unit = DAffine3::from_scale(1.0 / (block.max - block.min)) * DAffine3::from_translation(-block.min);
        if (block.max - block.min).cmpgt(DVec3::ZERO).all() {
            write_affine(rows, 0, &(unit * *from_local));
        } else {
            rows[..3].fill(floats([0.0, 0.0, 0.0, -1.0]));
        }
    }

    /// The values whose crossings are seen, in rising order: those of the control points of the first
    /// table declared.
    fn levels(&self) -> Vec<f64> {
        if self.shape.compositing() != Compositing::First {
            return Vec::new();
        }
        let parameters = &self.recipe.program.declaration().parameters;
        let table = parameters.iter().find(|p| kind_of(p) == Some(ParameterType::Table));
        let mut levels: Vec<f64> =
            table.map_or_else(Vec::new, |p| points(self.shape, &p.name).iter().map(|p| p.value).collect());
        levels.dedup();
        levels
    }
}

/// The most stretches that clips may leave of a ray in a shape: one more for each region cut away.
pub fn spans(shape: &ResolvedShape, clip: &Clip) -> u32 {
    let cuts = shape.state.clip.regions().iter().chain(clip.regions()).filter(|r| !r.keeps_inside());
    1 + cuts.count() as u32
}

/// A colour's rows: premultiplied, then where it is.
pub fn limit(color: [f32; 4], t: f64) -> [Row; 2] {
    let place = DVec4::new(t.min(f64::from(f32::MAX)), 0.0, 0.0, 0.0);
    let t = if t.is_finite() { place.x as f32 } else { f32::INFINITY };
    [color.map(f32::to_bits), [t.to_bits(), 0, 0, 0]]
}
