//! Shapes whose shader is a text: its program is evaluated over batches of samples.
//!
//! The samples of sixteen rays in one chunk of the lattice, at most 512, are one batch
//! (`batch`). Positions are made in f64 and are local from then on. The program asks its
//! `surroundings` for what volumes and tables say, sixteen positions at once. What comes of it is
//! put together as the shader's compositing says: segments of a medium (`dense`) by the
//! [`sweep`](super::sweep) over the whole scene, surfaces (`crossings`) as hits in it, values
//! that are reduced along a ray (`flat`) as a picture of their own.

mod absorb;
pub mod batch;
mod chosen;
mod crossings;
mod dense;
pub mod field;
mod flat;
mod lit;
pub mod lookup;
pub mod rows;
mod skip;
mod surroundings;
pub mod trail;

use std::{collections::BTreeMap, sync::Arc};

use volact_core::{
    ActionError, Compositing, LookupTable, ParameterType, ParameterValue, ShaderEntry, TableInterpolation,
    VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::ParameterMap,
    resolve::ResolvedShape,
};
use volact_shaders::{
    Entry, Kernel, Program, blunt,
    eval::{Field, Function, Input, Uniforms},
    signatures::Derived,
    unfit,
};

use super::options::{Classification, Settings};
pub use absorb::{absorb, composite};
pub use chosen::Chosen;
pub use crossings::Crossings;
pub use dense::Dense;
pub use flat::Flattened;
pub use lit::{Lit, lit};
use lookup::Lookup;
pub use skip::{Rows, Skip, Take, visible, visit};

/// Whether a shape is drawn by evaluating its shader's source.
pub fn wanted(shape: &ResolvedShape) -> bool {
    shape.shader.source.is_some()
}

/// The component that functions of volumes and attributes read.
pub fn component(shape: &ResolvedShape) -> usize {
    shape.int("component").map_or(0, |c| usize::try_from(c).unwrap_or(usize::MAX))
}

/// Whether such a shape needs to know in which cells its samples are.
pub fn by_cells(shape: &ResolvedShape) -> bool {
    wanted(shape) && shape.parameters.values().any(|v| v.kind() == ParameterType::Attribute)
}

/// What of a shape with such a shader is not drawn, and what its user can do.
pub fn refused(shape: &ResolvedShape) -> Option<(String, String)> {
    let name = &shape.shader.declaration.name;
    if shape.state.geometry.as_surface().is_some() {
        return Some((format!("a surface with shader {name:?}"), "draw it with the shader \"surface\"".into()));
    }
    let before =
        |v: &ParameterValue| matches!(v, ParameterValue::Table(t) if t.interpolation() == TableInterpolation::Pre);
    if shape.parameters.values().any(before) {
        return Some((
            format!("a pre-interpolated table in shader {name:?}"),
            "let it apply after interpolation".into(),
        ));
    }
    unfit(shape).or_else(|| blunt(shape))
}

/// The table of a parameter and the range that it is taken over: a grey one where it was left out.
fn table_of(shape: &ResolvedShape, name: &str) -> (LookupTable, [f64; 2]) {
    let range = shape.first_volume().map_or([0.0, 1.0], VolumeTexture::range);
    let grey = || LookupTable::grey([range[0].min(range[1]), range[0].max(range[1])]);
    (shape.table(name).cloned().unwrap_or_else(grey), range)
}

/// A shape's shader, ready to be evaluated.
#[derive(Debug)]
pub struct Shader {
    shade: Kernel<f32>,
    value: Option<Kernel<f32>>,
    segment: Option<Kernel<f32>>,
    /// The point of the world that is the origin of local space.
    origin: DVec3,
    entry: Arc<ShaderEntry>,
    program: Program,
    /// Whether the program is that of `gradient`.
    lit: bool,
    classification: Classification,
    recognise: bool,
    uniforms: ParameterMap,
    transform: DAffine3,
    /// Parameters of a volume and a table with which it is transparent.
    transparent: Option<(usize, usize)>,
    /// What voxels depend on: distances between samples are uniform, too.
    volumes: Vec<u64>,
    /// Tables that it looks up in, by parameter.
    tables: BTreeMap<String, Table>,
}

/// A table as programs look it up, and what that depends on.
#[derive(Debug)]
struct Table {
    /// The table's identity; `None` for the grey one of a parameter that was left out.
    id: Option<u64>,
    range: [f64; 2],
    unit: f64,
    lookup: Lookup,
}

/// The parameters that are the same for every sample.
fn uniforms(shape: &ResolvedShape) -> ParameterMap {
    use ParameterType::{Attribute, Table, Volume};
    let bulky = |v: &ParameterValue| matches!(v.kind(), Volume | Table | Attribute);
    shape.parameters.iter().filter(|(_, v)| !bulky(v)).map(|(n, v)| (n.clone(), v.clone())).collect()
}

fn volumes(shape: &ResolvedShape) -> Vec<u64> {
    let volume = |v: &ParameterValue| match v {
        ParameterValue::Volume(texture) => Some(texture.volume().id()),
        _ => None,
    };
    shape.parameters.values().filter_map(volume).collect()
}

impl Shader {
    /// Compiles the shader of a shape; what served before gives what is still good of it.
    ///
    /// # Errors
    /// [`ActionError::Shader`] if its source is wrong.
    pub fn new(shape: &ResolvedShape, settings: &Settings, last: Option<Self>) -> Result<Self, ActionError> {
        let wrong =
            |e: volact_shaders::ShaderError| ActionError::Shader { shape: shape.name.clone(), source: e.into() };
        let (program, lit, tables) = match last.filter(|last| last.entry == shape.shader) {
            Some(last) => (last.program, last.lit, last.tables),
            None => {
                let program = Program::new(&shape.shader).map_err(wrong)?;
                let lit = volact_shaders::does(&program, "gradient");
                (program, lit, BTreeMap::new())
            }
        };
        let (transform, bounds) = (shape.state.transform, shape.world_block());
        let origin = bounds.center();
        let given = Uniforms { parameters: &shape.parameters, object_to_world: transform, origin };
        let kernel = |entry| Kernel::with_values(&program, entry, &given).map_err(wrong);
        let optional = |entry, wanted: bool| (wanted && program.has(entry)).then(|| kernel(entry)).transpose();
        let over = shape.compositing() == Compositing::Over;
        let shade = kernel(Entry::Shade)?;
        Ok(Self {
            transparent: shade.transparent_with(),
            shade,
            value: optional(Entry::Value, !over)?,
            segment: optional(Entry::Segment, over && settings.classification != Classification::Post)?,
            origin,
            entry: Arc::clone(&shape.shader),
            program,
            lit,
            classification: settings.classification,
            recognise: settings.recognise,
            uniforms: uniforms(shape),
            transform,
            volumes: volumes(shape),
            tables,
        })
    }

    /// Whether it is still what the shape needs.
    pub fn serves(&self, shape: &ResolvedShape, settings: &Settings) -> bool {
        self.entry == shape.shader
            && self.classification == settings.classification
            && self.recognise == settings.recognise
            && self.transform == shape.state.transform
            && self.origin == shape.world_block().center()
            && self.uniforms == uniforms(shape)
            && self.volumes == volumes(shape)
    }

    fn kernels(&self) -> impl Iterator<Item = &Kernel<f32>> {
        [Some(&self.shade), self.value.as_ref(), self.segment.as_ref()].into_iter().flatten()
    }

    /// Bytes held, about.
    pub fn bytes(&self) -> usize {
        let tables = self.tables.values().map(|table| table.lookup.bytes());
        self.kernels().map(|k| k.instructions() * 32).sum::<usize>() + tables.sum::<usize>()
    }

    /// Makes the tables that it looks up in ready, as far as they changed; says so.
    pub fn prepare_tables(&mut self, shape: &ResolvedShape, mut say: impl FnMut(&str, usize)) {
        let of =
            |function: &Function| matches!(function.derived, Derived::Medium | Derived::TableColor | Derived::Entry);
        let asked = self.kernels().flat_map(|kernel| kernel.functions()).filter(|f| of(f)).map(|f| f.parameter);
        let parameters = &self.entry.declaration.parameters;
        let names: Vec<String> = asked.filter_map(|i| Some(parameters.get(i)?.name.clone())).collect();
        self.tables.retain(|name, _| names.contains(name));
        for name in names {
            let (table, range) = table_of(shape, &name);
            let (id, unit) = (shape.table(&name).map(LookupTable::id), shape.float("unit_distance").unwrap_or(1.0));
            let same = |kept: &Table| (kept.id, kept.range, kept.unit) == (id, range, unit);
            if !self.tables.get(&name).is_some_and(same) {
                let lookup = Lookup::new(&table.resolve(range), unit);
                say("classification", lookup.bytes());
                self.tables.insert(name, Table { id, range, unit, lookup });
            }
        }
    }

    /// The table of a parameter, ready to be looked up in.
    fn lookup(&self, name: &str) -> Option<&Lookup> {
        self.tables.get(name).map(|table| &table.lookup)
    }

    /// Whether the program is known to be that of `gradient`.
    pub fn is_lit(&self) -> bool {
        self.lit && self.recognise
    }

    /// Whether segments are classified by both of their ends.
    pub fn pre_integrates(&self) -> bool {
        self.segment.is_some()
    }

    /// The parameters of a volume and a table such that the medium is transparent wherever the
    /// table is at the volume's value.
    pub fn transparent_with(&self) -> Option<[&str; 2]> {
        // The ends of a segment say nothing of what lies between.
        let (volume, table) = self.transparent.filter(|_| self.segment.is_none())?;
        let name = |i: usize| self.entry.declaration.parameters.get(i).map(|p| p.name.as_str());
        Some([name(volume)?, name(table)?])
    }

    /// The values of a parameter's volume below the first and above the second of which the medium
    /// is transparent.
    pub fn seen_of(&self, name: &str) -> [f32; 2] {
        let table = self.transparent_with().filter(|[volume, _]| *volume == name).map(|[_, table]| table);
        let lookup = table.and_then(|table| self.lookup(table));
        lookup.map_or([f32::NEG_INFINITY, f32::INFINITY], Lookup::seen)
    }

    /// Whether the medium depends on the value of a parameter's volume at the sample's own position.
    pub fn wants_values_of(&self, name: &str) -> bool {
        let wanted = |input: Input| match input.field {
            Field::Volume(p) => self.entry.declaration.parameters.get(p).is_some_and(|p| p.name == name),
            _ => false,
        };
        self.segment.is_none() && self.shade.inputs().any(wanted)
    }
}
