//! What the tetrahedra of a mesh carry: numbers of its vertices, or a volume through texture
//! coordinates. Both are linear in a tetrahedron.
//!
//! Numbers give a field that is linear along a crossing. Texture coordinates give the ray a
//! straight way through the volume's samples, another one in each tetrahedron; where it leaves
//! the volume, the crossing is cut.
//!
//! # What is wrong with a crossing's numbers
//! Barycentric weights are wrong by next to nothing ([`tetra`](super::tetra)) and interpolation by
//! a few roundings, however short the crossing is. Its ends are known in double-double; where
//! they are rounded, the field keeps its place on the crossing and the *length* is wrong, which
//! harms the optical depth by no more than the same part.

use volact_core::{Attribute, VolumeTexture, glam::DVec3};

use super::{
    cells::Grid,
    dd::Dd,
    line::{EPS, Line},
    mark::{FINE, Mark, Stretches},
    medium::{Medium, Source, tame_infinities},
    mesh::{Crossing, Mesh, Step, Trace, distance, restrict},
    piece::{Kind, Linear, Piece, Stretch},
    sight::Sight,
};

/// Sample coordinates known worse than this are not looked at.
const VAGUE: f64 = 1e-3;

/// What a mesh carries.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one a shape")]
pub(super) enum Carried {
    /// Numbers at the vertices, one list for each field of the medium.
    Numbers(Vec<Vec<f64>>),
    /// A volume, by texture coordinates of the vertices.
    Volume(Volume),
}

/// A volume that is carried by a mesh.
#[derive(Clone, Debug)]
pub(super) struct Volume {
    pub texture: VolumeTexture,
    pub grid: Grid,
    /// Of the vertices, 0 to 1 over the data ROI.
    coordinates: Vec<DVec3>,
}

/// A mesh with what it carries.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    pub mesh: Mesh,
    pub carried: Carried,
}

/// How a ray goes through a mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    /// Parts that do not overlap, in order; several where cells overlap.
    pub tracks: Vec<Vec<Part>>,
    /// The stretches inside the mesh and, if there is one, the volume.
    pub stretches: Vec<[f64; 2]>,
    /// The length of what is so short that rounding decides what it shows.
    pub grazed: f64,
    /// The ray's `t` from which `t` is counted.
    pub anchor: f64,
}

/// A part of a crossing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub t: [f64; 2],
    /// Where it begins and ends on the ray.
    pub ends: [Mark; 2],
    /// Whether the places of the ends matter.
    pub loose: [bool; 2],
    /// Bound on the error of the ends.
    pub dt: f64,
    /// The highest opacity of what may hide at its beginning.
    hidden: f64,
    pub what: What,
}

/// What a part is made of.
#[derive(Clone, Copy, Debug)]
pub(super) enum What {
    /// Fields that are linear along it.
    Numbers([Linear; 4]),
    /// A line through the samples of a volume.
    Volume(Line),
}

impl Carried {
    /// Numbers of `count` vertices for the fields of a medium. Vertices beyond the attribute's,
    /// which are a tessellation's own, have none.
    pub fn numbers(medium: &Medium, count: usize, scalars: &Attribute, opacity_scalars: Option<&Attribute>) -> Self {
        let list = |source| {
            let (attribute, component) = match source {
                Source::OpacityScalars => (opacity_scalars.unwrap_or(scalars), 0),
                Source::Scalars(c) | Source::Component(c) | Source::Classified(c) => (scalars, c),
            };
            (0..count).map(|v| attribute.value(v, component)).collect()
        };
        Self::Numbers(medium.fields.iter().map(|f| list(f.source)).collect())
    }

    /// A volume with texture coordinates for the vertices.
    pub fn volume(texture: VolumeTexture, grid: Grid, coordinates: impl Iterator<Item = DVec3>) -> Self {
        Self::Volume(Volume { texture, grid, coordinates: coordinates.collect() })
    }

    /// Whether what lies at the end of one crossing is what lies at the beginning of another.
    fn goes_on(&self, from: &Crossing, to: &Crossing) -> bool {
        let near = |a: f64, b: f64, size: f64| (a - b).abs() <= 64.0 * EPS * size;
        match self {
            Self::Numbers(fields) => fields.iter().all(|list| {
                let (a, b) = (corners(list, from), corners(list, to));
                let size = a.iter().chain(&b).fold(0.0, |m: f64, v| m.max(v.abs()));
                near(from.values(&a)[1], to.values(&b)[0], size)
            }),
            Self::Volume(volume) => (0..3).all(|a| {
                let [from, to] = [from, to].map(|c| volume.along(c, a));
                near(from.ends[1].hi, to.ends[0].hi, from.size.max(to.size))
            }),
        }
    }

    /// Whether anything changes on a crossing.
    fn changes(&self, crossing: &Crossing) -> bool {
        match self {
            Self::Numbers(fields) => fields.iter().any(|list| {
                let corners = corners(list, crossing);
                let [a, b] = crossing.values(&corners);
                (a - b).abs() > 64.0 * EPS * corners.iter().fold(0.0, |m: f64, v| m.max(v.abs()))
            }),
            Self::Volume(volume) => (0..3).any(|a| {
                let along = volume.along(crossing, a);
                (along.ends[0].hi - along.ends[1].hi).abs() > 1e-9
            }),
        }
    }

    /// The highest opacity that a crossing may show.
    fn opacity(&self, medium: &Medium, crossing: &Crossing) -> f64 {
        let of_field = |(i, list): (usize, &Vec<f64>)| {
            let [a, b] = crossing.values(&corners(list, crossing));
            let field = &medium.fields[i];
            let known = field.drives[3] && !a.is_nan() && !b.is_nan();
            known.then(|| field.knots.bounds(a.min(b), a.max(b))[3][1])
        };
        match self {
            Self::Numbers(fields) => fields.iter().enumerate().find_map(of_field).unwrap_or(0.0),
            Self::Volume(_) => medium.max_opacity(),
        }
    }
}

fn corners(list: &[f64], crossing: &Crossing) -> [f64; 4] {
    crossing.corners.map(|v| list[v as usize])
}

impl Cells {
    /// How a ray goes through what `left` holds of the mesh; see [`Trace::stretches`] for `gap`.
    pub fn meet(&self, medium: &Medium, sight: &Sight, gap: f64, left: &Stretches) -> Way {
        let trace = self.mesh.trace(sight);
        let stretches = trace.stretches(gap).meet(left);
        let inside = stretches.as_slice().iter().map(|s| s.map(|m| m.from(trace.anchor)));
        let mut way = Way { anchor: trace.anchor, stretches: inside.collect(), ..Way::default() };
        let goes_on = |a: &Crossing, b: &Crossing| self.carried.goes_on(a, b);
        for track in trace.tracks(goes_on, |c| self.carried.changes(c)) {
            let mut parts = Vec::new();
            for step in restrict(&track, &stretches, trace.anchor) {
                let hidden = step.hidden.map_or(0.0, |h| self.carried.opacity(medium, &trace.crossings[h]));
                match self.part(medium, &trace, &step) {
                    Some(part) => parts.push(Part { hidden, ..part }),
                    None if self.is_vague(&trace, &step) => way.grazed += step.t[1] - step.t[0] + 2.0 * trace.dt,
                    None => {}
                }
            }
            way.tracks.push(parts);
        }
        way.tracks.retain(|parts| !parts.is_empty());
        if let Carried::Volume(_) = self.carried {
            way.stretches = joined(way.tracks.iter().flatten().map(|p| p.t), gap * trace.reach);
        }
        way
    }

    /// A step with what is carried there; `None` where that is nothing.
    fn part(&self, medium: &Medium, trace: &Trace, step: &Step) -> Option<Part> {
        let crossing = &trace.crossings[step.crossing];
        let made = Part {
            t: step.t,
            ends: step.ends,
            loose: step.loose,
            dt: trace.dt,
            hidden: 0.0,
            what: What::Numbers([Linear { values: [0.0; 2], range: [0.0; 2], error: 0.0 }; 4]),
        };
        match &self.carried {
            Carried::Numbers(fields) => {
                let mut linear = [Linear { values: [0.0; 2], range: [0.0; 2], error: 0.0 }; 4];
                for (linear, list) in linear.iter_mut().zip(fields).take(medium.fields.len()) {
                    *linear = numbers(crossing, step, corners(list, crossing))?;
                }
                Some(Part { what: What::Numbers(linear), ..made })
            }
            Carried::Volume(volume) => volume.part(trace, crossing, made),
        }
    }

    /// Whether a step is so short that its way through a volume is not known.
    fn is_vague(&self, trace: &Trace, step: &Step) -> bool {
        let crossing = &trace.crossings[step.crossing];
        match &self.carried {
            Carried::Numbers(_) => false,
            Carried::Volume(volume) => !volume.line(crossing, step.ends, trace.dt).is_sharp(),
        }
    }
}

/// Stretches made one where they are no further apart than `gap`.
fn joined(stretches: impl Iterator<Item = [f64; 2]>, gap: f64) -> Vec<[f64; 2]> {
    let mut all: Vec<_> = stretches.collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut made: Vec<[f64; 2]> = Vec::new();
    for [start, end] in all {
        match made.last_mut() {
            Some(last) if start <= last[1] + gap => last[1] = last[1].max(end),
            _ => made.push([start, end]),
        }
    }
    made
}

/// A field along a step, from its numbers at the corners; `None` where one is NaN.
fn numbers(crossing: &Crossing, step: &Step, mut corners: [f64; 4]) -> Option<Linear> {
    if corners.iter().any(|v| v.is_nan()) {
        return None;
    }
    tame_infinities(&mut corners)?;
    let range = corners.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
    if range[0] == range[1] {
        return Some(Linear { values: range, range, error: 0.0 });
    }
    let ends = crossing.values(&corners);
    let at = |place: &Mark| {
        let value = ends[0] + (ends[1] - ends[0]) * crossing.part(place);
        value.clamp(range[0], range[1])
    };
    let values = [at(&step.ends[0]), if step.t[1] == crossing.t[1] { ends[1] } else { at(&step.ends[1]) }];
    let (spread, most) = (range[1] - range[0], range[0].abs().max(range[1].abs()));
    let error = 2.0 * crossing.loose() * spread + 16.0 * EPS * spread + 4.0 * EPS * most;
    Some(Linear { values, range, error: error.min(spread) })
}

/// A texture coordinate along a crossing.
struct Along {
    /// Where the ray comes in and goes out.
    ends: [Dd; 2],
    /// Bound on their error.
    error: f64,
    /// Lowest and highest at the corners.
    range: [f64; 2],
    /// The largest magnitude.
    size: f64,
}

impl Volume {
    fn along(&self, crossing: &Crossing, axis: usize) -> Along {
        let corners = crossing.corners.map(|v| self.coordinates[v as usize][axis]);
        let range = corners.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
        let size = range[0].abs().max(range[1].abs());
        let error = 2.0 * crossing.loose() * (range[1] - range[0]) + FINE * size;
        Along { ends: crossing.passes.each_ref().map(|p| p.fine_value(&corners)), error, range, size }
    }

    fn part(&self, trace: &Trace, crossing: &Crossing, made: Part) -> Option<Part> {
        let mut made = made;
        for axis in 0..3 {
            let along = self.along(crossing, axis);
            if along.range[0] < 0.0 || along.range[1] > 1.0 {
                made = cut(crossing, &along, made, trace.anchor)?;
            }
        }
        let line = self.line(crossing, made.ends, made.dt);
        line.is_sharp().then_some(Part { what: What::Volume(line), ..made })
    }

    /// The way through the samples between two places, with `t` counted from the first.
    fn line(&self, crossing: &Crossing, ends: [Mark; 2], dt: f64) -> Line {
        let roi = self.texture.data_roi();
        let length = distance(&ends[0], &ends[1]);
        let parts = ends.each_ref().map(|place| crossing.part(place));
        let mut line = Line {
            anchor: ends[0].t.hi,
            t: [0.0, length],
            ends,
            dt,
            index: [Dd::default(); 3],
            step: [0.0; 3],
            dp: [0.0; 3],
        };
        for axis in 0..3 {
            let along = self.along(crossing, axis);
            let (low, count) = (roi.min[axis] as f64, (roi.max[axis] - roi.min[axis]) as f64);
            let change = along.ends[1].add(along.ends[0].negate()).hi;
            let start = along.ends[0].add(Dd::product(change, parts[0]));
            line.index[axis] = start.scale(count).add(Dd::new(low));
            if along.range[0] < along.range[1] {
                let moved = change * (parts[1] - parts[0]) * count;
                let spread = (along.range[1] - along.range[0]) * count;
                let round = 16.0 * EPS * (1.0 + count * along.size + spread);
                line.step[axis] = moved / length;
                line.dp[axis] = round + 2.0 * crossing.loose() * spread;
            }
        }
        line
    }
}

impl Line {
    /// Whether positions are known well.
    fn is_sharp(&self) -> bool {
        self.dp.iter().all(|&d| d <= VAGUE)
    }
}

/// Cuts a part to where a texture coordinate is between 0 and 1, ends included: what is 0 or 1 to
/// double-double precision is so.
fn cut(crossing: &Crossing, along: &Along, part: Part, anchor: f64) -> Option<Part> {
    let from = |limit: f64, end: Dd| {
        let apart = end.add(Dd::new(-limit));
        if apart.hi.abs() <= along.error { Dd::default() } else { apart }
    };
    let mut made = part;
    for (limit, inside) in [(0.0, 1.0), (1.0, -1.0)] {
        // How far inside both ends are.
        let [a, b] = along.ends.map(|end| from(limit, end).scale(inside));
        if a.hi < 0.0 && b.hi < 0.0 || a.hi <= 0.0 && b.hi <= 0.0 && a.hi != b.hi {
            return None;
        }
        if a.hi.min(b.hi) >= 0.0 {
            continue;
        }
        let change = b.add(a.negate());
        let [start, end] = &crossing.ends;
        let length = end.t.add(start.t.negate());
        let t = start.t.add(length.times(a.negate().over(change)));
        let error = 2.0 * along.error / change.hi.abs() * length.hi + start.error.max(end.error);
        let mark = Mark { t, error, fine: error <= 1e-20 * (t.hi.abs() + anchor.abs()) };
        let side = usize::from(a.hi > 0.0);
        let further = if side == 0 { mark.order(&made.ends[0]).is_gt() } else { mark.order(&made.ends[1]).is_lt() };
        if further {
            (made.t[side], made.ends[side], made.loose[side]) = (mark.from(anchor), mark, true);
            made.dt = made.dt.max(error);
        }
    }
    (made.t[0] < made.t[1]).then_some(made)
}

impl Part {
    /// For pieces of linear fields.
    pub fn stretch(&self) -> Stretch {
        Stretch { t: self.t, dt: self.dt, loose: self.loose, apart: false, stretched: self.rounding() }
    }

    /// Bound on the error of the length between two places on it, rounded to f64.
    pub fn rounding(&self) -> f64 {
        4.0 * EPS * self.t[0].abs().max(self.t[1].abs())
    }

    /// Where a place on its line through the samples is.
    pub fn place(&self, t: f64, line: &Line) -> f64 {
        if t == line.t[1] { self.t[1] } else { (self.t[0] + t).min(self.t[1]) }
    }

    /// Has the first of its pieces cover what may hide before it: over a length within the error
    /// of places, of that opacity and any colour.
    pub fn cover(&self, piece: &mut Piece, brightest: f64) {
        if self.hidden <= 0.0 || piece.t[0] != self.t[0] {
            return;
        }
        let depth = -(-self.hidden.min(1.0)).ln_1p() * 8.0 * self.dt;
        if let Kind::Opaque { .. } = piece.kind {
            piece.color_error += brightest * (depth / piece.unit).min(1.0);
        } else {
            let spread = 2.0 * depth / (piece.t[1] - piece.t[0]);
            piece.edge += spread;
            piece.edge_color += spread * brightest;
        }
    }
}
