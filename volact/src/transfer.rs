//! A camera and a transfer function for a bare volume, from its values alone.
//!
//! What surrounds the subject is found at the volume's faces and made transparent. The rest is
//! split in two by Otsu's threshold: *soft*, warm and thin, and *dense*, the colour of bone. Each
//! gets the extinction at which a typical line through it has a stated optical depth, so that the
//! picture depends neither on the number of voxels nor on the size of the subject. The first
//! values above the background are dark: a ray that grazes a surface stays among them, which
//! draws an outline where there is no lighting.
//!
//! Segmentations are recognised and get a colour for each label and the nearest sample instead.

mod mesh;
mod palette;
mod sight;
mod statistics;

use std::collections::BTreeSet;

use volact_core::{
    Aabb, Appearance, ControlPoint, Filter, FrameDesc, LookupTable, Shape, View, Volume, VolumeTexture, glam::DVec3,
    shape::smallest_voxel,
};

pub use mesh::{AutomaticMesh, MeshLookError, automatic_mesh};

use sight::{Sight, fit, fit_upright, world_steps};
use statistics::{Background, Histogram, Statistics};

/// How to show a volume of which nothing else is known.
#[derive(Clone, Debug)]
pub struct Automatic {
    /// The shader: `lut`, or `simple` for volumes that bring colour or opacity.
    pub shader: String,
    /// The table for `lut`; `None` for `simple`.
    pub table: Option<LookupTable>,
    /// From where to look.
    pub view: View,
    /// The world box of what can be seen.
    pub subject: Aabb,
    /// World points around all that can be seen, which a camera should fit: nearer to it than the
    /// box where the grid stands oblique.
    pub hull: Vec<DVec3>,
    /// How to interpolate.
    pub filter: Filter,
    /// What was found and chosen, in words.
    pub notes: Vec<String>,
}

impl Automatic {
    fn new(shader: &str, table: Option<LookupTable>, sight: Sight, filter: Filter, notes: Vec<String>) -> Self {
        let Sight { view, bounds, hull } = sight;
        Self { shader: shader.into(), table, view, subject: bounds, hull, filter, notes }
    }

    /// The volume as a texture with the filter chosen.
    pub fn texture(&self, volume: &Volume) -> VolumeTexture {
        VolumeTexture::new(volume).with_filter(self.filter)
    }

    /// Shader and table.
    pub fn appearance(&self) -> Appearance {
        let appearance = Appearance::new(&self.shader);
        match &self.table {
            Some(table) => appearance.with("lookup_table", table.clone()),
            None => appearance,
        }
    }

    /// A picture over black of the subject from where it is seen best.
    pub fn frame(&self, width: usize, height: usize) -> FrameDesc {
        self.frame_from(self.view, width, height)
    }

    /// A picture over black of the subject from a view of one's own.
    pub fn frame_from(&self, view: View, width: usize, height: usize) -> FrameDesc {
        fit(&self.hull, &self.subject, view, width, height)
    }

    /// As [`frame_from`](Self::frame_from), where another direction than z is up in the world; without
    /// a view, from where the subject is seen best.
    pub fn frame_upright(&self, up: DVec3, view: Option<View>, width: usize, height: usize) -> FrameDesc {
        fit_upright(&self.hull, &self.subject, [view, Some(self.view)], up, [width, height])
    }

    /// The volume as a shape that looks so.
    pub fn shape(&self, volume: &Volume) -> Shape {
        Shape::around_texture(&self.texture(volume), self.appearance())
    }
}

/// Chooses appearance and view for a volume. Looks at a regular part of at most some million
/// voxels; the same volume gets the same answer.
pub fn automatic(volume: &Volume) -> Automatic {
    let components = volume.desc().components;
    if components > 1 {
        let note = format!("{components} components: shown as the colour and opacity that they are");
        let sight = Sight::whole(volume);
        return Automatic::new("simple", None, sight, Filter::Linear, vec![note]);
    }
    let statistics = Statistics::new(volume, 0);
    let mut notes = Vec::new();
    if let Some(padding) = statistics.padding {
        notes.push(format!("{padding} taken as padding"));
    }
    if statistics.percentile(0.0) == statistics.percentile(1.0) {
        return constant(volume, &statistics, notes);
    }
    match statistics.labels(volume, 0) {
        Some(labels) => segmentation(volume, &statistics, &labels, notes),
        None => intensity(volume, &statistics, notes),
    }
}

/// A volume that is the same everywhere: a faint box.
fn constant(volume: &Volume, statistics: &Statistics, mut notes: Vec<String>) -> Automatic {
    let value = statistics.percentile(0.0);
    notes.push(match statistics.sorted.is_empty() {
        true => "no finite value: nothing to see".into(),
        false => format!("{value} everywhere: a faint box"),
    });
    let longest = statistics.dims.into_iter().max().unwrap_or(1) * statistics.stride;
    let table = table(vec![point(value, [0.5, 0.6, 0.7], opacity(0.5, longest as f64))]);
    Automatic::new("lut", table, Sight::whole(volume), Filter::Linear, notes)
}

/// Optical depth of a typical line through what is soft and through what is dense.
const DEPTH: [f64; 2] = [1.0, 4.0];
/// Optical depth of a typical line through a label.
const LABEL_DEPTH: f64 = 1.5;

const OUTLINE: [f64; 3] = [0.22, 0.06, 0.04];
const SOFT: [f64; 3] = [0.86, 0.45, 0.28];
const BONE: [f64; 3] = [1.0, 0.93, 0.80];
const WHITE: [f64; 3] = [1.0, 1.0, 1.0];

fn intensity(volume: &Volume, statistics: &Statistics, mut notes: Vec<String>) -> Automatic {
    let background = statistics.background();
    let inside = |v: f64| background.distance(v) > background.margin;
    let sight = Sight::new(volume, statistics, inside);
    let classes = Classes::new(statistics, &background);
    notes.push(classes.describe(&background));
    let axis = view_axis(volume, sight.view);
    let along = smallest_units(volume, axis) * statistics.stride as f64;
    let soft = statistics.chord(axis, |v| inside(v) && background.distance(v) < classes.split) * along;
    let dense = statistics.chord(axis, |v| background.distance(v) >= classes.split) * along;
    let points = classes.points(&background, opacity(DEPTH[0], soft), opacity(DEPTH[1], dense));
    Automatic::new("lut", table(points), sight, Filter::Linear, notes)
}

/// The subject in two, as distances from the background's value.
struct Classes {
    /// Mean of what is soft.
    soft: f64,
    /// Where the dense begins.
    split: f64,
    /// Mean of what is dense.
    dense: f64,
    /// About the greatest.
    top: f64,
}

impl Classes {
    fn new(statistics: &Statistics, background: &Background) -> Self {
        let all = statistics.sorted.iter().map(|&v| background.distance(f64::from(v)));
        let mut distances: Vec<f64> = all.filter(|d| *d > background.margin).collect();
        distances.sort_by(f64::total_cmp);
        let top = distances.get(distances.len() * 999 / 1000).copied().unwrap_or(background.margin * 2.0);
        let split = Histogram::of(distances.iter().copied(), background.margin, top).otsu();
        let (soft, dense) = distances.split_at(distances.partition_point(|d| *d < split));
        let mean = |part: &[f64], none: f64| match part.len() {
            0 => none,
            n => part.iter().sum::<f64>() / n as f64,
        };
        Self { soft: mean(soft, 0.5 * (background.margin + split)), split, dense: mean(dense, top), top }
    }

    fn describe(&self, background: &Background) -> String {
        let value = |distance: f64| short(background.at(distance));
        let side = if background.sign > 0.0 { "above" } else { "below" };
        format!(
            "background {}, subject from {}, soft about {}, dense {side} {} about {}",
            value(0.0),
            value(background.margin),
            value(self.soft),
            value(self.split),
            value(self.dense)
        )
    }

    /// The table, from opacities for what is soft and what is dense.
    fn points(&self, background: &Background, thin: f64, thick: f64) -> Vec<ControlPoint> {
        let edge = background.margin;
        let outline = 0.5 * (edge + self.soft.min(2.0 * edge));
        let shell = SOFT.map(|c| c * 0.6);
        let rows = [
            (edge, OUTLINE, 0.0),
            (outline, OUTLINE, thin),
            (self.soft, SOFT, thin),
            (self.split, shell, thin.max(0.3 * thick)),
            (self.dense, BONE, thick),
            (self.top, WHITE, thick),
        ];
        // Rising, whatever the classes: two points never share a value, so none gets lost.
        let mut last = f64::NEG_INFINITY;
        let step = edge * 1e-3;
        let rising = rows.into_iter().map(|(distance, color, opacity)| {
            last = distance.max(last + step);
            point(background.at(last), color, opacity)
        });
        rising.collect()
    }
}

fn segmentation(volume: &Volume, statistics: &Statistics, labels: &BTreeSet<i64>, mut notes: Vec<String>) -> Automatic {
    let background = statistics.background().value.round() as i64;
    let labels = all_labels(volume, labels);
    let shown: Vec<i64> = labels.iter().copied().filter(|l| *l != background).collect();
    notes.push(format!("{} labels besides {background}: a colour for each, nearest sample", shown.len()));
    let sight = Sight::new(volume, statistics, |v| !v.is_nan() && v as i64 != background);
    let axis = view_axis(volume, sight.view);
    let along = smallest_units(volume, axis) * statistics.stride as f64;
    let mut points = vec![point(background as f64, [0.0; 3], 0.0)];
    for (index, &label) in shown.iter().enumerate() {
        let chord = statistics.chord(axis, |v| v as i64 == label) * along;
        let (color, opacity) = (distinct_color(index), opacity(LABEL_DEPTH, chord.max(along)));
        let value = label as f64;
        points.extend([
            point(value - 0.5, [0.0; 3], 0.0),
            point(value - 0.5, color, opacity),
            point(value + 0.5, color, opacity),
            point(value + 0.5, [0.0; 3], 0.0),
        ]);
    }
    Automatic::new("lut", table(points), sight, Filter::Nearest, notes)
}

/// The labels found in a part of the voxels, and those that the part missed.
fn all_labels(volume: &Volume, found: &BTreeSet<i64>) -> BTreeSet<i64> {
    let desc = volume.desc();
    let mut labels = found.clone();
    let mut last = None;
    for index in 0..desc.samples().unwrap_or(0) {
        let stored = desc.scalar.read(volume.data().bytes(), index);
        if last != Some(stored) {
            last = Some(stored);
            let value = stored * desc.slope + desc.intercept;
            if value.is_finite() {
                labels.insert(value.round() as i64);
            }
        }
    }
    labels
}

/// Colours that differ from their neighbours: hues a golden section apart, bright and pale in turn.
fn distinct_color(index: usize) -> [f64; 3] {
    let hue = (0.02 + index as f64 * 0.618_033_988_75).fract() * 6.0;
    let saturation = [0.75, 0.45, 0.6][index % 3];
    let channel = |shift: f64| {
        let ramp = (((hue + shift).rem_euclid(6.0) - 3.0).abs() - 1.0).clamp(0.0, 1.0);
        1.0 - saturation * (1.0 - ramp)
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

/// The axis of the grid that is nearest to the direction of view.
fn view_axis(volume: &Volume, view: View) -> usize {
    let (towards_eye, _) = view.axes();
    let along = world_steps(volume).map(|s| s.normalize_or_zero().dot(towards_eye).abs());
    (0..3).max_by(|a, b| along[*a].total_cmp(&along[*b])).unwrap_or(2)
}

/// The length of one voxel along an axis in unit distances.
fn smallest_units(volume: &Volume, axis: usize) -> f64 {
    let unit = smallest_voxel(&VolumeTexture::new(volume), &volume.desc().placement);
    world_steps(volume)[axis].length() / unit
}

/// The opacity over one unit distance that gives an optical depth over a length in such units.
fn opacity(depth: f64, length: f64) -> f64 {
    1.0 - (-depth / length.max(1.0)).exp()
}

/// A number with four digits that matter.
fn short(v: f64) -> f64 {
    format!("{v:.3e}").parse().unwrap_or(v)
}

fn point(value: f64, color: [f64; 3], opacity: f64) -> ControlPoint {
    ControlPoint { value, color, opacity }
}

fn table(points: Vec<ControlPoint>) -> Option<LookupTable> {
    LookupTable::from_points(points).ok()
}

#[cfg(test)]
mod tests;
