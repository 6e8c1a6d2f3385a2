//! What the tetrahedra of a mesh tell a program: numbers of their vertices, and where volumes are
//! read. Both are linear in a tetrahedron.
//!
//! With texture coordinates a volume is deformed with the mesh: positions stay where they are, and
//! a volume is read where the tetrahedron's map, which is affine, takes them, whatever position it
//! is asked for. Its gradient goes back by the transpose of that map.

use volact_core::{
    ParameterType, ParameterValue, Tessellation,
    glam::{DAffine3, DMat3, DVec3},
    resolve::ResolvedShape,
};
use volact_shaders::{Program, eval::Field};

use super::program::{Course, Source};
use crate::reference::{
    cubic::Cubic,
    line::EPS,
    mark::{Mark, Stretches},
    mesh::{Crossing, Mesh, Step, Trace, restrict},
    met::GAP,
    sight::Sight,
};

/// Stretches that are no further apart than this part of the distances on a ray are one.
const NEAR: f64 = 64.0 * EPS;

/// What a mesh carries.
pub(in crate::reference) struct Carried {
    numbers: Vec<(Field, Vec<f64>)>,
    /// Of the vertices.
    places: Option<Places>,
}

/// Vertices in local space and their texture coordinates.
struct Places {
    vertices: Vec<DVec3>,
    coordinates: Vec<DVec3>,
    /// Whether the shape ends where the texture coordinates of a volume do.
    ends: bool,
}

/// A part of a ray in one tetrahedron.
#[derive(Clone, Debug)]
pub(in crate::reference) struct Cell {
    pub t: [f64; 2],
    /// Numbers where the part begins, and their change for one unit of `t`.
    numbers: Vec<(Field, [f64; 2])>,
    /// From local space to texture coordinates.
    pub bent: Option<DAffine3>,
}

/// A stretch inside a shape.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct Stretch {
    pub t: [f64; 2],
    /// Where it begins on the ray.
    pub start: Mark,
    /// Bound on the error of its ends.
    pub dt: f64,
}

/// Parts of a ray that do not overlap.
#[derive(Clone, Debug, Default)]
pub(in crate::reference) struct Lane {
    /// The tetrahedra, in order; none where nothing depends on them.
    pub cells: Vec<Cell>,
    pub stretches: Vec<Stretch>,
}

impl Cell {
    /// A number of a vertex, interpolated.
    pub fn number(&self, field: Field, t: f64) -> f64 {
        let found = self.numbers.iter().find(|(f, _)| *f == field);
        // One that was left out is 0.
        found.map_or(0.0, |(_, [start, slope])| start + slope * (t - self.t[0]))
    }
}

impl Cell {
    /// The numbers of vertices between two places, as cubics over 0 to 1.
    pub fn linear(&self, [start, end]: [f64; 2]) -> impl Iterator<Item = Cubic> {
        let numbers = self.numbers.iter().filter(|(field, _)| matches!(field, Field::Attribute(_)));
        numbers.map(move |(_, [first, slope])| [first + slope * (start - self.t[0]), slope * (end - start), 0.0, 0.0])
    }
}

impl Lane {
    /// Whether a place lies in it, ends included; `None` where rounding decides.
    pub fn holds(&self, t: f64) -> Option<bool> {
        let inside = |s: &&Stretch| s.t[0] - s.dt <= t && t <= s.t[1] + s.dt;
        let held = self.stretches.iter().find(inside);
        held.map_or(Some(false), |s| (s.t[0] + s.dt < t && t < s.t[1] - s.dt).then_some(true))
    }
}

impl Carried {
    /// What a shape's mesh carries; `None` where that is nothing.
    pub fn new(shape: &ResolvedShape, program: &Program, source: &Source, made: &Tessellation) -> Option<Self> {
        let mut numbers = Vec::new();
        let component = shape.int("component").and_then(|c| usize::try_from(c).ok()).unwrap_or(0);
        for (i, p) in program.declaration().parameters.iter().enumerate() {
            let Some(ParameterValue::Attribute(attribute)) = shape.parameters.get(&p.name) else { continue };
            let list = |c: usize| (0..made.vertices.len()).map(|v| attribute.value(v, c)).collect();
            numbers.push((Field::Attribute(i), list(component)));
            let all = (0..attribute.components.min(4)).map(|c| (Field::AttributeComponent(i, c as u8), list(c)));
            numbers.extend(all);
        }
        let volumes = shape.parameters.values().any(|v| v.kind() == ParameterType::Volume);
        let places = made.texture_coordinates.as_ref().filter(|_| volumes).map(|coordinates| Places {
            vertices: made.vertices.iter().map(|v| source.to_local(v)).collect(),
            coordinates: coordinates.iter().collect(),
            ends: shape.first_volume().is_some(),
        });
        (!numbers.is_empty() || places.is_some()).then_some(Self { numbers, places })
    }

    /// A ray's way through what is left of the mesh. For a lattice, whose segments faces do not cut,
    /// all lanes have the stretches of the whole.
    pub fn lanes(&self, mesh: &Mesh, sight: &Sight, course: &Course<'_>, left: &Stretches, whole: bool) -> Vec<Lane> {
        let trace = mesh.trace(sight);
        let inside = trace.stretches(if whole { GAP } else { 0.0 }).meet(left);
        let mut lanes: Vec<Lane> = Vec::new();
        for track in trace.tracks(|_, _| true, |_| false) {
            let mut lane = Lane::default();
            for step in restrict(&track, &inside, trace.anchor) {
                self.add(&mut lane, &trace, &step, course);
            }
            lanes.push(lane);
        }
        lanes.retain(|lane| !lane.stretches.is_empty());
        if whole {
            let mut all: Vec<Stretch> = lanes.iter().flat_map(|lane| lane.stretches.clone()).collect();
            all.sort_by(|a, b| a.t[0].total_cmp(&b.t[0]));
            let mut merged = Vec::new();
            all.into_iter().for_each(|stretch| join(&mut merged, stretch, GAP * trace.reach));
            lanes.iter_mut().for_each(|lane| lane.stretches.clone_from(&merged));
        }
        lanes
    }

    fn add(&self, lane: &mut Lane, trace: &Trace, step: &Step, course: &Course<'_>) {
        let crossing = &trace.crossings[step.crossing];
        let bent = self.places.as_ref().map(|places| places.map(crossing));
        let mut t = step.t;
        if let (Some(map), Some(Places { ends: true, .. })) = (&bent, &self.places) {
            let (at, way) = (map.transform_point3(course.at), map.transform_vector3(course.direction));
            t = (0..3).fold(t, |t, a| unit(t, at[a], way[a]));
        }
        if t[0] >= t[1] {
            return;
        }
        let length = crossing.t[1] - crossing.t[0];
        let number = |(field, list): &(Field, Vec<f64>)| {
            let [a, b] = crossing.values(&crossing.corners.map(|v| list[v as usize]));
            let slope = if length > 0.0 { (b - a) / length } else { 0.0 };
            (*field, [a + slope * (t[0] - crossing.t[0]), slope])
        };
        lane.cells.push(Cell { t, numbers: self.numbers.iter().map(number).collect(), bent });
        let start = if t[0] == step.t[0] { step.ends[0] } else { Mark { fine: false, ..place(trace, t[0]) } };
        join(&mut lane.stretches, Stretch { t, start, dt: trace.dt }, NEAR * trace.reach);
    }
}

fn place(trace: &Trace, t: f64) -> Mark {
    Mark { error: trace.dt, ..Mark::exact(trace.anchor + t) }
}

/// Adds a stretch to the last one where they are no further apart than `gap`.
fn join(stretches: &mut Vec<Stretch>, next: Stretch, gap: f64) {
    match stretches.last_mut() {
        Some(last) if next.t[0] <= last.t[1] + gap => last.t[1] = last.t[1].max(next.t[1]),
        _ => stretches.push(next),
    }
}

/// Leaves of a part where `at + way·t` is from 0 to 1, but for rounding.
fn unit([start, end]: [f64; 2], at: f64, way: f64) -> [f64; 2] {
    let edge = |limit: f64| (limit - at) / way;
    let round = 64.0 * EPS * (1.0 + at.abs());
    if way.abs() * start.abs().max(end.abs()).max(end - start) <= round {
        let outside = at < -round || at > 1.0 + round;
        return if outside { [start, start] } else { [start, end] };
    }
    let (first, last) = if way > 0.0 { (edge(0.0), edge(1.0)) } else { (edge(1.0), edge(0.0)) };
    let near = round / way.abs();
    // An end that is one to rounding stays what it is.
    [if first > start + near { first } else { start }, if last < end - near { last } else { end }]
}

impl Places {
    /// From local space to texture coordinates in a tetrahedron.
    fn map(&self, crossing: &Crossing) -> DAffine3 {
        let [p, q] = [&self.vertices, &self.coordinates].map(|list| crossing.corners.map(|v| list[v as usize]));
        let edges = |p: [DVec3; 4]| DMat3::from_cols(p[1] - p[0], p[2] - p[0], p[3] - p[0]);
        let linear = edges(q) * edges(p).inverse();
        DAffine3 { matrix3: linear, translation: q[0] - linear * p[0] }
    }
}
