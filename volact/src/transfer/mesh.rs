//! A camera and a table for a bare mesh, from its shape and numbers alone.
//!
//! Numbers count by the volume in which they are found, so that a mesh may be fine where little
//! happens. Colours follow the middle between the numbers themselves and their rank. Extinction is
//! the greater the less room a number takes up, so that what is common, as a rule the
//! surroundings, hides nothing; all of it is scaled to a stated optical depth of the whole, seen
//! from where the camera stands. Nothing depends on how finely the mesh is divided.

use std::sync::Arc;

use thiserror::Error;
use volact_core::{
    Aabb, Appearance, Attribute, ControlPoint, FrameDesc, LookupTable, MeshData, ScalarType, Shape, Tessellation, View,
    geometry::GeometryError,
    glam::{DAffine3, DVec3},
    names,
};

use super::{
    palette::Palette,
    short,
    sight::{along, around, fit, fit_upright, thin_axis},
};

/// Mean optical depth of all lines that meet the mesh.
const DEPTH: f64 = 1.5;
/// Classes of numbers.
const CLASSES: usize = 24;
/// The part of the volume below the range shown, and above it.
const TAIL: f64 = 0.002;
/// How strongly what is rare is emphasised: extinction is the class's part of the volume to this
/// power, negative.
const EMPHASIS: f64 = 0.8;
/// Numbers by which extinction is measured, each for an equal part of the volume.
const JUDGES: usize = 512;
/// Numbers that are looked at, at least, however few tetrahedra there are.
const WANTED: usize = 20_000;
/// Tetrahedra whose numbers are looked at, at most.
const MOST_TETRAHEDRA: usize = 250_000;
/// More points than these are thinned out before a camera is fitted.
const MOST_POINTS: usize = 100_000;
/// Columns along each axis by which they are.
const COLUMNS: usize = 64;

/// Why a mesh cannot be shown as asked.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshLookError {
    /// There is no such attribute.
    #[error("no attribute is called {name:?}{hint}; known: {known}")]
    UnknownAttribute {
        /// The name asked for.
        name: String,
        /// The nearest name, as a question.
        hint: String,
        /// All names.
        known: String,
    },
    /// A surface has no inside whose numbers could be shown.
    #[error("attribute {name:?} asked for, wanted none: a surface is shown in one colour")]
    Surface {
        /// The name asked for.
        name: String,
    },
    /// The mesh cannot be taken apart.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// How to show a mesh or surface of which nothing else is known.
#[derive(Clone, Debug)]
pub struct AutomaticMesh {
    /// The numbers shown, one a vertex; `None` for a surface.
    pub attribute: Option<Attribute>,
    /// Their table; `None` for a surface.
    pub table: Option<LookupTable>,
    /// The world length for the table's opacities.
    pub unit_distance: f64,
    /// From where to look.
    pub view: View,
    /// The box of what can be seen.
    pub subject: Aabb,
    /// Points which a camera should fit.
    pub hull: Vec<DVec3>,
    /// What was found and chosen, in words.
    pub notes: Vec<String>,
}

impl AutomaticMesh {
    /// Shader `attribute` with its parameters, or `surface`.
    pub fn appearance(&self) -> Appearance {
        match (&self.attribute, &self.table) {
            (Some(attribute), Some(table)) => Appearance::new("attribute")
                .with("scalars", attribute.clone())
                .with("lookup_table", table.clone())
                .with("unit_distance", self.unit_distance),
            _ => Appearance::new("surface"),
        }
    }

    /// A picture over black from where the mesh is seen best.
    pub fn frame(&self, width: usize, height: usize) -> FrameDesc {
        self.frame_from(self.view, width, height)
    }

    /// A picture over black from a view of one's own.
    pub fn frame_from(&self, view: View, width: usize, height: usize) -> FrameDesc {
        fit(&self.hull, &self.subject, view, width, height)
    }

    /// As [`frame_from`](Self::frame_from), where another direction than z is up in the world; without
    /// a view, from where the mesh is seen best.
    pub fn frame_upright(&self, up: DVec3, view: Option<View>, width: usize, height: usize) -> FrameDesc {
        fit_upright(&self.hull, &self.subject, [view, Some(self.view)], up, [width, height])
    }

    /// The mesh as a shape that looks so.
    pub fn shape(&self, data: &MeshData) -> Shape {
        Shape::build(&data.name, Arc::clone(&data.geometry), self.appearance(), DAffine3::IDENTITY)
    }
}

/// Chooses attribute, table and view for a mesh, or the view for a surface.
///
/// Where no attribute is named, it is the first of one component that is not the same everywhere,
/// else the first of several, by its magnitude. A name may end in the number of a component, as
/// in `velocity[2]`; without, an attribute of several components is shown by its magnitude.
///
/// # Errors
/// If there is no such attribute, or the mesh cannot be taken apart.
pub fn automatic_mesh(data: &MeshData, attribute: Option<&str>) -> Result<AutomaticMesh, MeshLookError> {
    if let Some(surface) = data.geometry.as_surface() {
        if let Some(name) = attribute {
            return Err(MeshLookError::Surface { name: name.into() });
        }
        let hull = thinned(surface.points().iter().collect());
        let subject = data.geometry.bounds();
        let notes = vec![format!("{} triangles, lit from the eye", surface.triangles().len())];
        let (view, unit_distance) = (choose_view(&subject), unit(&subject));
        return Ok(AutomaticMesh { attribute: None, table: None, unit_distance, view, subject, hull, notes });
    }
    let mesh = data.geometry.tessellate()?;
    let (attribute, what) = choose(data, attribute, mesh.vertices.len())?;
    let Visible { points, volume, samples } = Visible::new(&mesh, &attribute);
    let subject = if points.is_empty() { data.geometry.bounds() } else { around(&points) };
    let (view, unit_distance) = (choose_view(&subject), unit(&subject));
    let hull = thinned(points);
    let chord = volume / shadow(&hull, view).max(f64::MIN_POSITIVE);
    let ends = attribute.range(0).unwrap_or_default();
    let (points, note) = Numbers::new(samples).table(ends, chord, unit_distance);
    let table = LookupTable::from_points(points).ok();
    let notes = vec![format!("{what}, {note}")];
    Ok(AutomaticMesh { attribute: Some(attribute), table, unit_distance, view, subject, hull, notes })
}

fn unit(bounds: &Aabb) -> f64 {
    (bounds.size().length() / 100.0).max(f64::MIN_POSITIVE)
}

fn choose_view(bounds: &Aabb) -> View {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    thin_axis(bounds.size().to_array()).map_or(View::Iso, |thin| along(axes[thin]))
}

/// The numbers to show, one a vertex, and what they are in words.
fn choose(data: &MeshData, name: Option<&str>, vertices: usize) -> Result<(Attribute, String), MeshLookError> {
    let all = &data.attributes;
    let varies = |a: &Attribute| a.range(0).is_some_and(|[lo, hi]| lo < hi);
    let Some(name) = name else {
        let scalar = || all.iter().find(|a| a.components == 1 && varies(a));
        let several = || all.iter().filter(|a| a.components > 1).map(magnitude).find(|(a, _)| varies(a));
        let any = || all.iter().find(|a| a.components == 1);
        return Ok(match scalar() {
            Some(attribute) => plain(attribute),
            None => several().or_else(|| any().map(plain)).unwrap_or_else(|| nothing(vertices)),
        });
    };
    if let Some(attribute) = data.attribute(name) {
        return Ok(if attribute.components == 1 { plain(attribute) } else { magnitude(attribute) });
    }
    let part = name.strip_suffix(']').and_then(|n| n.rsplit_once('['));
    let part = part.and_then(|(name, number)| Some((data.attribute(name)?, number.parse().ok()?)));
    match part {
        Some((attribute, component)) if component < attribute.components => Ok(one(attribute, component)),
        _ => {
            let known: Vec<_> = all.iter().map(|a| a.name.as_str()).collect();
            let hint = names::hint(name, known.iter().copied());
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            Err(MeshLookError::UnknownAttribute { name: name.into(), hint, known })
        }
    }
}

fn plain(attribute: &Attribute) -> (Attribute, String) {
    (attribute.clone(), format!("attribute {:?}", attribute.name))
}

fn derived(name: &str, vertices: usize, number: impl Fn(usize) -> f64) -> Attribute {
    let numbers: Vec<f64> = (0..vertices).map(number).collect();
    Attribute { name: name.into(), scalar: ScalarType::F64, components: 1, data: numbers.into() }
}

fn magnitude(attribute: &Attribute) -> (Attribute, String) {
    let n = attribute.components;
    let length = |v: usize| (0..n).map(|c| attribute.value(v, c).powi(2)).sum::<f64>().sqrt();
    let made = derived(&attribute.name, attribute.len(), length);
    (made, format!("magnitude of attribute {:?} of {n} components", attribute.name))
}

fn one(attribute: &Attribute, component: usize) -> (Attribute, String) {
    let made = derived(&attribute.name, attribute.len(), |v| attribute.value(v, component));
    (made, format!("component {component} of attribute {:?}", attribute.name))
}

/// For a mesh without attributes: the same number everywhere.
fn nothing(vertices: usize) -> (Attribute, String) {
    (derived("inside", vertices, |_| 0.0), "no attribute of the vertices: the inside of the mesh".into())
}

/// What can be seen of a mesh: tetrahedra that have a number at each corner.
struct Visible {
    /// The vertices that they have.
    points: Vec<DVec3>,
    /// All of their volume.
    volume: f64,
    /// Their numbers at evenly spread inner points, each with its part of the volume. There are the
    /// more points to a tetrahedron the fewer of them there are; of very many some are left out.
    samples: Vec<[f64; 2]>,
}

impl Visible {
    fn new(mesh: &Tessellation, attribute: &Attribute) -> Self {
        let number = |v: u32| attribute.value(v as usize, 0);
        let mut used = vec![false; mesh.vertices.len()];
        let (mut volume, mut samples) = (0.0, Vec::new());
        let every = mesh.tetrahedra.len().div_ceil(MOST_TETRAHEDRA).max(1);
        let spread = inner_points(mesh.tetrahedra.len());
        for (i, t) in mesh.tetrahedra.iter().enumerate().filter(|(_, t)| t.iter().all(|&v| number(v).is_finite())) {
            t.iter().for_each(|&v| used[v as usize] = true);
            let own = mesh.volume(i);
            volume += own;
            if i % every == 0 {
                let numbers = t.map(number);
                let at = |shares: &[f64; 4]| shares.iter().zip(numbers).map(|(share, n)| share * n).sum();
                samples.extend(spread.iter().map(|shares| [at(shares), own / spread.len() as f64]));
            }
        }
        let points = mesh.vertices.iter().zip(used).filter(|(_, used)| *used).map(|(p, _)| p);
        Self { points: points.collect(), volume, samples }
    }
}

/// Points inside a tetrahedron, as the shares of its corners: for so many tetrahedra.
fn inner_points(tetrahedra: usize) -> Vec<[f64; 4]> {
    let enough = |n: &usize| n * (n + 1) * (n + 2) / 6 * tetrahedra >= WANTED;
    let n = (2..8).find(enough).unwrap_or(8);
    let share = |steps: usize| (steps as f64 + 0.25) / n as f64;
    let mut points = Vec::new();
    for a in 0..n {
        for b in 0..n - a {
            points.extend((0..n - a - b).map(|c| [a, b, c, n - 1 - a - b - c].map(share)));
        }
    }
    points
}

/// The area that some points cover as seen in a view, were there no gaps between them.
fn shadow(points: &[DVec3], view: View) -> f64 {
    let (towards_eye, up) = view.axes();
    let right = up.cross(towards_eye).normalize();
    let up = towards_eye.cross(right);
    let origin = points.first().copied().unwrap_or_default();
    let flat = points.iter().map(|p| *p - origin).map(|p| [p.dot(right), p.dot(up)]);
    let mut flat: Vec<[f64; 2]> = flat.collect();
    flat.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let cross = |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    // The convex hull, half by half (A. M. Andrew, *Another efficient algorithm for convex hulls in
    // two dimensions*, 1979), and its area as it grows.
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() > 1 && cross(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.windows(2).map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1]).sum::<f64>() / 2.0
    };
    half(&mut flat.iter().copied()) + half(&mut flat.iter().rev().copied())
}

/// Points among which all that lie far out are kept: of very many, the first and last of each of
/// 64 × 64 columns along each axis.
fn thinned(points: Vec<DVec3>) -> Vec<DVec3> {
    if points.len() <= MOST_POINTS {
        return points;
    }
    let bounds = around(&points);
    let scale = DVec3::splat(COLUMNS as f64) / bounds.size().max(DVec3::splat(f64::MIN_POSITIVE));
    let mut kept = Vec::new();
    for axis in 0..3 {
        let mut ends: Vec<Option<[DVec3; 2]>> = vec![None; COLUMNS * COLUMNS];
        for &p in &points {
            let at = (p - bounds.min) * scale;
            let [a, b] = [(axis + 1) % 3, (axis + 2) % 3].map(|other| (at[other] as usize).min(COLUMNS - 1));
            let [low, high] = ends[a * COLUMNS + b].get_or_insert([p, p]);
            if p[axis] < low[axis] {
                *low = p;
            }
            if p[axis] > high[axis] {
                *high = p;
            }
        }
        kept.extend(ends.into_iter().flatten().flatten());
    }
    kept
}

/// Numbers in rising order with the volume of all up to each.
struct Numbers {
    values: Vec<f64>,
    below: Vec<f64>,
}

impl Numbers {
    fn new(mut samples: Vec<[f64; 2]>) -> Self {
        samples.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut sum = 0.0;
        let below = samples.iter().map(|[_, volume]| {
            sum += volume;
            sum
        });
        Self { below: below.collect(), values: samples.iter().map(|[value, _]| *value).collect() }
    }

    fn total(&self) -> f64 {
        self.below.last().copied().unwrap_or(0.0)
    }

    /// The number below which that part of the volume lies.
    fn quantile(&self, part: f64) -> f64 {
        let at = self.below.partition_point(|sum| *sum < part * self.total());
        self.values.get(at.min(self.values.len().saturating_sub(1))).copied().unwrap_or(0.0)
    }

    /// The part of the volume with numbers up to this one.
    fn rank(&self, value: f64) -> f64 {
        let count = self.values.partition_point(|v| *v <= value);
        if count == 0 { 0.0 } else { self.below[count - 1] / self.total() }
    }

    /// Control points for numbers between these ends and lines of that mean length inside the
    /// mesh, and what they show.
    fn table(&self, ends: [f64; 2], chord: f64, unit: f64) -> (Vec<ControlPoint>, String) {
        let [lo, hi] = [self.quantile(TAIL), self.quantile(1.0 - TAIL)];
        let [lo, hi] = if lo < hi { [lo, hi] } else { ends };
        let opacity = |extinction: f64| 1.0 - (-extinction * unit).exp();
        // A number between equal ones may be off by rounding.
        if hi - lo <= 1e-12 * lo.abs().max(hi.abs()) {
            let (value, color) = (ends[0].max(lo), Palette::Rising.at(0.6));
            let point = ControlPoint { value, color, opacity: opacity(DEPTH / 2.0 / chord) };
            return (vec![point], format!("{} everywhere", short(value)));
        }
        // A middle that is no end: colours part there.
        let parted = lo < 0.0 && hi > 0.0 && (-lo).min(hi) > 0.2 * (-lo).max(hi);
        let palette = if parted { Palette::Parted } else { Palette::Rising };
        let places: Vec<f64> = (0..=CLASSES).map(|i| i as f64 / CLASSES as f64).collect();
        let values = self.places(&places, [lo, hi]);
        let ranks: Vec<f64> = values.iter().map(|v| self.rank(*v)).collect();
        let parts: Vec<f64> = ranks.windows(2).map(|r| r[1] - r[0]).collect();
        let strengths: Vec<f64> = parts.iter().map(|part| part.max(TAIL).powf(-EMPHASIS)).collect();
        // Where two classes meet, the mean of their logarithms.
        let strength = |i: usize| (strengths[i.saturating_sub(1)] * strengths[i.min(CLASSES - 1)]).sqrt();
        let points = |scale: f64| {
            let point = |i: usize| {
                let place = if parted { 0.5 + 0.5 * values[i] / (-lo).max(hi) } else { places[i] };
                ControlPoint { value: values[i], color: palette.at(place), opacity: opacity(scale * strength(i)) }
            };
            (0..=CLASSES).map(point).collect::<Vec<_>>()
        };
        let scale = self.scale(DEPTH / chord, unit, points);
        let shown = format!("{} to {} of {} to {}", short(lo), short(hi), short(ends[0]), short(ends[1]));
        (points(scale), shown)
    }

    /// The scale at which all of the volume has that extinction in the mean, for tables that absorb
    /// the more the greater it is.
    fn scale(&self, wanted: f64, unit: f64, points: impl Fn(f64) -> Vec<ControlPoint>) -> f64 {
        let judges: Vec<f64> = (0..JUDGES).map(|i| self.quantile((i as f64 + 0.5) / JUDGES as f64)).collect();
        let mean = |scale: f64| {
            let Ok(table) = LookupTable::from_points(points(scale)) else { return f64::INFINITY };
            let table = table.resolve([0.0, 1.0]);
            let extinction = |v: &f64| -(1.0 - table.classify(*v)[3]).ln() / unit;
            judges.iter().map(extinction).sum::<f64>() / judges.len() as f64
        };
        // The wanted one lies between: no strength is below 1, and none above the greatest.
        let (mut low, mut high) = (wanted * TAIL.powf(EMPHASIS), wanted);
        for _ in 0..40 {
            let middle = (low * high).sqrt();
            if mean(middle) < wanted { low = middle } else { high = middle }
        }
        (low * high).sqrt()
    }

    /// Rising numbers at places from 0 to 1: the middle between what is even in the numbers and
    /// what is even in their rank.
    fn places(&self, places: &[f64], [lo, hi]: [f64; 2]) -> Vec<f64> {
        let ranks = [self.rank(lo), self.rank(hi)];
        let mut last = f64::NEG_INFINITY;
        let least = (hi - lo) * 1e-6;
        let value = |place: f64| {
            let even = lo + (hi - lo) * place;
            let ranked = self.quantile(ranks[0] + (ranks[1] - ranks[0]) * place).clamp(lo, hi);
            even.midpoint(ranked)
        };
        let rising = places.iter().map(|p| {
            last = value(*p).max(last + least);
            last
        });
        rising.collect()
    }
}

#[cfg(test)]
mod tests;
