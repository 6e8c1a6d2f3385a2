//! What a shape is made of: scalar fields, and how they become colour and opacity.
//!
//! Every shader that is a table comes down to the same thing: one to four scalar fields, each of
//! which drives some of the channels red, green, blue and opacity through a piecewise linear
//! function. A post-interpolated table is one field that drives all four; a pre-interpolated one
//! is four fields, classified at the voxels, that drive one each; `simple` maps components;
//! `attribute` has one field for colour and one for opacity, or one for both. Fields of volumes
//! are trilinear in a cell, fields of attributes linear in a tetrahedron.

use volact_core::{
    Attribute, ControlPoint, Filter, LookupTable, Roi, ScalarType, TableInterpolation, VolumeTexture,
    resolve::ResolvedShape, table::ResolvedTable, volume::Components,
};

use super::knots::Knots;

/// Where the numbers of a field come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Source {
    /// A component of the voxels, in data units.
    Component(usize),
    /// A channel of the voxels' classification.
    Classified(usize),
    /// A component of the attribute whose numbers are classified.
    Scalars(usize),
    /// The first component of the attribute that gives the opacity.
    OpacityScalars,
}

/// A scalar field and the channels that it drives.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub source: Source,
    pub knots: Knots,
    /// Which of red, green, blue, opacity.
    pub drives: [bool; 4],
}

/// A shape's fields and their classification.
#[derive(Clone, Debug)]
pub(super) struct Medium {
    /// One to four.
    pub fields: Vec<Field>,
    /// World length over which opacity is the fraction absorbed.
    pub unit: f64,
    /// For pre-interpolated tables.
    table: Option<ResolvedTable>,
    component: usize,
}

/// The corners of a cell for each field.
pub(super) type Corners = [[f64; 8]; 4];

impl Medium {
    /// Prepares a shape as a shader of that name shows it; `None` where it is not known here.
    pub fn new(shape: &ResolvedShape, shader: &str) -> Option<Self> {
        let unit = shape.float("unit_distance").unwrap_or(1.0);
        let component = usize::try_from(shape.int("component").unwrap_or(0)).unwrap_or(0);
        let mut made = Self { fields: Vec::new(), unit, table: None, component };
        match shader {
            "simple" => {
                let texture = shape.volume("volume")?;
                made.fields = simple(texture.meaning(), texture.range());
            }
            "lut" | "mip" | "minip" | "average" | "xray" => {
                let range = shape.volume("volume")?.range();
                let grey = LookupTable::grey(range);
                let table = shape.table("lookup_table").unwrap_or(&grey);
                let pre = shader == "lut" && table.interpolation() == TableInterpolation::Pre;
                made.set_table(table.resolve(sorted(range)), pre);
            }
            "attribute" => made.fields = attribute_fields(shape, component)?,
            _ => return None,
        }
        Some(made)
    }

    fn set_table(&mut self, table: ResolvedTable, at_voxels: bool) {
        if at_voxels {
            let channel = |c| Field { source: Source::Classified(c), knots: Knots::identity(c), drives: only(c) };
            self.fields = (0..4).map(channel).collect();
            self.table = Some(table);
        } else {
            let source = Source::Component(self.component);
            self.fields = vec![Field { source, knots: knots(&table), drives: [true; 4] }];
        }
    }

    /// Whether the field that drives opacity exists; without one everything is opaque.
    pub fn has_opacity(&self) -> bool {
        self.fields.iter().any(|f| f.drives[3])
    }

    /// The highest number of any colour channel.
    pub fn brightest(&self) -> f64 {
        let table = self.table.iter().flat_map(|t| t.points()).flat_map(|p| p.color);
        let fields = self.fields.iter().flat_map(|f| f.knots.bounds(f64::NEG_INFINITY, f64::INFINITY));
        let bounded = fields.map(|b| b[1]).filter(|v| v.is_finite());
        table.chain(bounded).fold(1.0, f64::max)
    }

    /// The highest opacity that there may be.
    pub fn max_opacity(&self) -> f64 {
        if let Some(table) = &self.table {
            return table.points().iter().map(|p| p.opacity).fold(0.0, f64::max);
        }
        let opacity = self.fields.iter().find(|f| f.drives[3]);
        opacity.map_or(1.0, |f| f.knots.bounds(f64::NEG_INFINITY, f64::INFINITY)[3][1])
    }

    /// Reads the fields at one sample; `None` where one is NaN.
    pub fn at_sample(&self, voxels: &Voxels<'_>, sample: [usize; 3]) -> Option<[f64; 4]> {
        let mut values = [0.0; 4];
        if let Some(table) = &self.table {
            let value = voxels.value(sample, self.component);
            return (!value.is_nan()).then(|| table.classify(value));
        }
        for (value, field) in values.iter_mut().zip(&self.fields) {
            let Source::Component(c) = field.source else { continue };
            *value = voxels.value(sample, c);
            if value.is_nan() {
                return None;
            }
        }
        Some(values)
    }

    /// Reads the corners of the cell from `base` to `base + upper`, where an axis along which the
    /// cell has no extent repeats its samples; `None` where a corner is NaN, or where infinities
    /// of both signs meet. A cell with an infinite corner is infinite throughout.
    pub fn corners(&self, voxels: &Voxels<'_>, base: [usize; 3], upper: [usize; 3]) -> Option<Corners> {
        let mut corners = [[0.0; 8]; 4];
        for i in 0..8 {
            let flat = (0..3).any(|a| i >> a & 1 == 1 && upper[a] == 0);
            if flat {
                let twin = (0..3).filter(|&a| upper[a] == 1).map(|a| i & (1 << a)).sum::<usize>();
                corners.iter_mut().for_each(|c| c[i] = c[twin]);
                continue;
            }
            let sample = [0, 1, 2].map(|a| base[a] + (i >> a & 1));
            let values = self.at_sample(voxels, sample)?;
            for (c, v) in corners.iter_mut().zip(values) {
                c[i] = v;
            }
        }
        let count = self.fields.len();
        corners[..count].iter_mut().try_for_each(tame_infinities)?;
        Some(corners)
    }
}

/// Makes a cell with an infinite corner infinite throughout; `None` where both signs meet.
pub(super) fn tame_infinities<const N: usize>(corner: &mut [f64; N]) -> Option<()> {
    if corner.iter().all(|v| v.is_finite()) {
        return Some(());
    }
    let has = |infinity: f64| corner.contains(&infinity);
    match (has(f64::INFINITY), has(f64::NEG_INFINITY)) {
        (true, true) => None,
        (up, _) => {
            *corner = [if up { f64::MAX } else { f64::MIN }; N];
            Some(())
        }
    }
}

/// A volume's bytes with what is needed to read them.
#[derive(Clone, Copy)]
pub(super) struct Voxels<'a> {
    bytes: &'a [u8],
    scalar: ScalarType,
    row: usize,
    slice: usize,
    components: usize,
    slope: f64,
    intercept: f64,
    /// The part of the data in use.
    pub roi: Roi,
    /// Whether values are those of the nearest sample.
    pub nearest: bool,
}

impl<'a> Voxels<'a> {
    /// The voxels of a texture.
    pub fn new(texture: &'a VolumeTexture) -> Self {
        let desc = texture.volume().desc();
        let [nx, ny, _] = desc.dims;
        let bytes = texture.volume().data().bytes();
        Self {
            bytes,
            scalar: desc.scalar,
            row: nx,
            slice: nx * ny,
            components: desc.components,
            slope: desc.slope,
            intercept: desc.intercept,
            roi: texture.data_roi(),
            nearest: texture.filter() == Filter::Nearest,
        }
    }

    /// The value at a sample in data units, to the bit that of [`volact_core::Volume::value`].
    pub fn value(&self, [x, y, z]: [usize; 3], component: usize) -> f64 {
        let index = (z * self.slice + y * self.row + x) * self.components + component;
        self.scalar.read(self.bytes, index) * self.slope + self.intercept
    }
}

/// A table's control points in rising order.
fn knots(table: &ResolvedTable) -> Knots {
    let mut points = table.points().to_vec();
    points.sort_by(|a, b| a.value.total_cmp(&b.value));
    Knots::new(points)
}

/// `attribute`: colour from the scalars, opacity from the same or others, by the same or another
/// table.
fn attribute_fields(shape: &ResolvedShape, component: usize) -> Option<Vec<Field>> {
    let scalars = shape.attribute("scalars")?;
    let table = shape.table("lookup_table")?;
    let field = |table: &LookupTable, attribute: &Attribute, source, drives| {
        let component = if let Source::Scalars(c) = source { c } else { 0 };
        // As of a texture of floats.
        let range = match attribute.range(component) {
            Some([a, b]) if a < b => [a, b],
            Some([a, _]) => [a, a + 1.0],
            None => [0.0, 1.0],
        };
        Field { source, knots: knots(&table.resolve(range)), drives }
    };
    let (others, other_table) = (shape.attribute("opacity_scalars"), shape.table("opacity_table"));
    if others.is_none() && other_table.is_none() {
        return Some(vec![field(table, scalars, Source::Scalars(component), [true; 4])]);
    }
    let color = field(table, scalars, Source::Scalars(component), [true, true, true, false]);
    let source = if others.is_some() { Source::OpacityScalars } else { Source::Scalars(component) };
    Some(vec![color, field(other_table.unwrap_or(table), others.unwrap_or(scalars), source, only(3))])
}

fn only(channel: usize) -> [bool; 4] {
    [0, 1, 2, 3].map(|c| c == channel)
}

fn sorted([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

/// `simple`: components by meaning, mapped from the texture's range to 0 to 1 and clamped.
fn simple(meaning: Components, range: [f64; 2]) -> Vec<Field> {
    let ramp = |component, drives: [bool; 4], opaque: bool| {
        let point =
            |value, level: f64| ControlPoint { value, color: [level; 3], opacity: if opaque { 1.0 } else { level } };
        let mut points = vec![point(range[0], 0.0), point(range[1], 1.0)];
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        Field { source: Source::Component(component), knots: Knots::new(points), drives }
    };
    match meaning {
        Components::Intensity => vec![ramp(0, [true; 4], false)],
        Components::Luminance => vec![ramp(0, [true; 4], true)],
        Components::LuminanceAlpha => vec![ramp(0, [true, true, true, false], false), ramp(1, only(3), false)],
        Components::Rgb => (0..3).map(|c| ramp(c, only(c), false)).collect(),
        Components::Rgba => (0..4).map(|c| ramp(c, only(c), false)).collect(),
    }
}
