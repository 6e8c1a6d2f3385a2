//! Runs: slabs, one behind the other, of shapes between which no other shape comes. What a rasteriser
//! draws of a frame: a convex polygon for each run, in the order from front to back.

use std::{borrow::Cow, sync::Arc};

use bytemuck::{Pod, Zeroable};
use volact_core::{
    ActionError, Block, FrameDesc, Geometry, ParameterValue,
    glam::{DVec2, DVec3},
    resolve::ResolvedShape,
    slicing::{Order, Sampling, Slicing, SlicingError, Solid},
};

use super::{
    is_deep,
    mesh::{Meshes, is_mesh},
    scene::{Item, Seen},
};

/// Rays may end where slabs of these numbers begin, and so do runs.
const WHOLE: i64 = 32;

/// The end of a run beyond which there is nothing of its shapes.
const OPEN: i32 = i32::MAX;

/// Slabs of some shapes.
#[derive(Clone, Debug, PartialEq)]
struct Run {
    /// The shapes that it is of, and those among them that reach into it.
    shapes: [usize; 2],
    there: Vec<usize>,
    /// The first slab, and the one after the last; open where there is none.
    first: Option<i64>,
    end: Option<i64>,
    levels: [f64; 2],
}

/// A corner of a run's polygon, as the vertex stage reads it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Corner {
    /// In clip space.
    pub place: [f32; 2],
    /// The first shape, the one after the last, the first slab, and the one after the last.
    pub run: [i32; 4],
    /// Where the slab from which the others are counted begins, seen from the anchor.
    pub rest: f32,
}

/// A run as a strip of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Polygon {
    /// The first of its corners.
    pub first: u32,
    /// How many it has.
    pub count: u32,
}

/// Which way y runs in clip space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Upward {
    /// As in pixels: down (Vulkan).
    No,
    /// Up (WebGPU, Metal, Direct3D).
    Yes,
}

/// What is to be drawn in slabs.
#[derive(Debug)]
pub struct Sliced<'a> {
    /// Items in the order of their module: those composited in depth first, by groups.
    pub items: Vec<Item<'a>>,
    /// What is sliced of them.
    pub solids: Vec<Solid>,
    /// How many are composited in depth: the first.
    deep: usize,
}

impl<'a> Sliced<'a> {
    /// Items, whose `meshes` are packed, with what is sliced of them; those of which nothing is there are left
    /// out. `action` is whose errors are told.
    ///
    /// # Errors
    /// If a geometry is damaged, or the frame cannot be sliced.
    pub fn new(
        action: &str,
        (mut items, meshes): (Vec<Item<'a>>, &Meshes),
        desc: &FrameDesc,
        sampling: &Sampling,
    ) -> Result<Self, ActionError> {
        // Those composited in depth come first, in an order that does not depend on that of drawing.
        items.sort_by_key(|i| if is_deep(i.program.compositing()) { (0, i.shape.id) } else { (1, 0) });
        let mut made = Self { items: Vec::with_capacity(items.len()), solids: Vec::new(), deep: 0 };
        for item in items {
            let Some(shape) = boxed(item.shape, meshes) else { continue };
            if let Some(solid) = Solid::new(&shape, None)? {
                made.deep += usize::from(is_deep(item.program.compositing()));
                made.solids.push(solid);
                made.items.push(item);
            }
        }
        if made.deep > 1 {
            let order = in_groups(&made.slicing(action, desc, sampling)?, made.deep).0;
            made.items = in_order(made.items, &order);
            made.solids = in_order(made.solids, &order);
        }
        Ok(made)
    }

    /// The plan of a frame.
    ///
    /// # Errors
    /// If it cannot be sliced.
    pub fn slicing(&self, action: &str, desc: &FrameDesc, sampling: &Sampling) -> Result<Slicing<'_>, ActionError> {
        Slicing::new(self.solids.iter().collect(), desc, sampling).map_err(|error| told(action, error))
    }

    /// Stretches of items that are drawn together, from front to back.
    pub fn groups(&self, slicing: &Slicing<'_>) -> Vec<[usize; 2]> {
        in_groups(slicing, self.deep).1
    }
}

/// A shape for its slabs: of a mesh the box around it, in which fragments find the mesh themselves.
/// `None` where it has no extent.
fn boxed<'a>(shape: &'a ResolvedShape, meshes: &Meshes) -> Option<Cow<'a, ResolvedShape>> {
    if !is_mesh(shape) {
        return Some(Cow::Borrowed(shape));
    }
    let bounds = meshes.bounds(shape)?;
    let block: Arc<dyn Geometry> = Arc::new(Block::new(bounds.min, bounds.size()).ok()?);
    let mut made = shape.clone();
    made.state.geometry = block;
    made.parameters.retain(|_, value| !matches!(value, ParameterValue::Attribute(_)));
    Some(Cow::Owned(made))
}

/// Things in another order.
fn in_order<T>(things: Vec<T>, order: &[usize]) -> Vec<T> {
    let mut things: Vec<Option<T>> = things.into_iter().map(Some).collect();
    order.iter().filter_map(|i| things[*i].take()).collect()
}

/// Why a frame cannot be sliced, as an error of an action.
fn told(action: &str, error: SlicingError) -> ActionError {
    match error {
        SlicingError::Camera(error) => ActionError::Frame(error.into()),
        SlicingError::TooMany { shape, found, wanted } => ActionError::Limit {
            action: action.into(),
            what: format!("number of planes, one each sample distance, through shape {shape:?}"),
            found,
            wanted: format!("at most {wanted}"),
        },
        other => ActionError::Backend { action: action.into(), source: Box::new(other) },
    }
}

/// The slab from which slabs are counted on the device, and its level seen from the anchor.
pub fn border(seen: &Seen, step: f64) -> (i64, f64) {
    let linear = seen.grid.linear();
    let level = linear.axis.dot(seen.anchor.point - linear.eye.unwrap_or(DVec3::ZERO));
    let base = 32.0 * (level / (32.0 * step)).round();
    (base as i64, base * step - level)
}

/// The slabs of a shape: numbers of the first and of the one after the last, and levels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reach {
    numbers: [i64; 2],
    levels: [f64; 2],
}

/// Shapes in an order in which each group of shapes that are composited in depth is a stretch, which does
/// not depend on the view; then the others as they are. With it the groups from front to back, as
/// stretches of that order. `deep` is how many are composited in depth: the first.
fn in_groups(slicing: &Slicing<'_>, deep: usize) -> (Vec<usize>, Vec<[usize; 2]>) {
    let members = |group: &Vec<usize>| group.iter().copied().filter(|i| *i < deep).collect::<Vec<_>>();
    let groups: Vec<Vec<usize>> = slicing.groups().iter().map(members).filter(|g| !g.is_empty()).collect();
    let mut lasting = groups.clone();
    lasting.sort_unstable();
    let order: Vec<usize> = lasting.into_iter().flatten().chain(deep..slicing.solids().len()).collect();
    let mut places = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, i)| places[*i] = place);
    let stretch = |g: &Vec<usize>| [places[g[0]], places[g[0]] + g.len()];
    let groups = groups.iter().map(stretch).collect();
    (order, groups)
}

/// The runs of a plan from front to back, as polygons of corners; then one for each shape that is a picture
/// of its own; between these, where there are `surfaces`, one of no shape over the whole picture. `groups` are
/// stretches of shapes, as of [`Sliced::groups`]. Slabs are counted from `base`;
/// `rest` is where that one begins, seen from the anchor, as of [`border`].
pub fn corners(
    slicing: &Slicing<'_>,
    groups: &[[usize; 2]],
    (base, rest): (i64, f64),
    surfaces: bool,
    upward: Upward,
) -> (Vec<Corner>, Vec<Polygon>) {
    let sign = if upward == Upward::Yes { DVec2::new(1.0, -1.0) } else { DVec2::ONE };
    let (mut all, mut polygons) = (Vec::new(), Vec::new());
    let number = |n: Option<i64>, open: i32| n.map_or(open, |n| (n - base) as i32);
    for run in runs(slicing, groups, surfaces) {
        let hull = covered(slicing, &run);
        if hull.len() < 3 {
            continue;
        }
        polygons.push(Polygon { first: all.len() as u32, count: hull.len() as u32 });
        let [from, to] = run.shapes.map(|s| s as i32);
        let numbers = [from, to, number(run.first, -OPEN), number(run.end, OPEN)];
        all.extend(strip(hull.len()).map(|i| {
            let place = sign * (2.0 * hull[i] / slicing.pixel_map().size() - DVec2::ONE);
            Corner { place: place.as_vec2().to_array(), run: numbers, rest: rest as f32 }
        }));
    }
    (all, polygons)
}

/// The corners of a convex polygon as a strip of triangles: from one side to the other and back.
fn strip(count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |i| if i % 2 == 0 { i / 2 } else { count - 1 - i / 2 })
}

/// What a run covers: the hull of one shape, the rectangle around those of several, all where it is of none.
fn covered(slicing: &Slicing<'_>, run: &Run) -> Vec<DVec2> {
    let mut hull = Vec::new();
    if run.there.is_empty() {
        let size = slicing.pixel_map().size();
        return vec![DVec2::ZERO, DVec2::new(size.x, 0.0), size, DVec2::new(0.0, size.y)];
    }
    if let [shape] = run.there[..] {
        slicing.cover(shape, run.levels, &mut hull);
        return hull;
    }
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for &shape in &run.there {
        slicing.cover(shape, run.levels, &mut hull);
        (low, high) = hull.iter().fold((low, high), |(a, b), p| (a.min(*p), b.max(*p)));
    }
    if low.cmplt(high).all() {
        vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
    } else {
        Vec::new()
    }
}

fn runs(slicing: &Slicing<'_>, groups: &[[usize; 2]], surfaces: bool) -> Vec<Run> {
    let reaches = reaches(slicing);
    let mut made: Vec<Run> = Vec::new();
    for &shapes in groups {
        let members = || (shapes[0]..shapes[1]).filter_map(|s| Some((s, reaches[s]?)));
        let first = members().map(|(_, r)| r.numbers[0]).min().unwrap_or(0);
        let end = members().map(|(_, r)| r.numbers[1]).max().unwrap_or(0);
        for chunk in first.div_euclid(WHOLE)..(end + WHOLE - 1).div_euclid(WHOLE) {
            let [a, b] = [chunk * WHOLE, (chunk + 1) * WHOLE];
            let inside = || members().filter(|(_, r)| r.numbers[0] < b && a < r.numbers[1]);
            let slabs = |shape: usize| [slicing.slabs(shape).slab(a)[0], slicing.slabs(shape).slab(b)[0]];
            let levels = inside().map(|(s, r)| {
                let [low, high] = slabs(s);
                [low.max(r.levels[0]), high.min(r.levels[1])]
            });
            let levels = levels.reduce(|x, y| [x[0].min(y[0]), x[1].max(y[1])]);
            let Some(levels) = levels else { continue };
            let there = inside().map(|(s, _)| s).collect();
            made.push(Run { shapes, there, first: (a > first).then_some(a), end: (b < end).then_some(b), levels });
        }
    }
    let deep = groups.iter().map(|g| g[1]).max().unwrap_or(0);
    if surfaces {
        made.push(Run { shapes: [deep; 2], there: Vec::new(), first: None, end: None, levels: [0.0; 2] });
    }
    let alone =
        |s: usize| Some(Run { shapes: [s, s + 1], there: vec![s], first: None, end: None, levels: reaches[s]?.levels });
    made.extend((deep..reaches.len()).filter_map(alone));
    made
}

/// What slabs each shape reaches into.
fn reaches(slicing: &Slicing<'_>) -> Vec<Option<Reach>> {
    let mut made: Vec<Option<Reach>> = vec![None; slicing.solids().len()];
    let mut sweep = slicing.sweep(Order::FrontToBack);
    while let Some(slice) = sweep.next_slice() {
        let (number, slab) = (slice.number, slice.slab);
        let reach = made[slice.shape].get_or_insert(Reach { numbers: [number, number + 1], levels: slab });
        reach.numbers = [reach.numbers[0].min(number), reach.numbers[1].max(number + 1)];
        reach.levels = [reach.levels[0].min(slab[0]), reach.levels[1].max(slab[1])];
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{
        Appearance, FrameDesc, Registry, ScalarType, Shape, View, Volume, VolumeDesc,
        glam::{DAffine3, DVec3},
        resolve::ResolvedShape,
        slicing::{Rate, Sampling, Solid},
    };

    fn solids(shifts: &[DVec3]) -> (Vec<Solid>, FrameDesc) {
        let volume = Volume::new(VolumeDesc::new([9; 3], ScalarType::U8, 1), vec![0u8; 729]).unwrap();
        let shape = |shift: &DVec3| {
            let shape = Shape::around(&volume, Appearance::new("simple"));
            shape.set_transform(DAffine3::from_translation(*shift));
            shape
        };
        let shapes: Vec<Shape> = shifts.iter().map(shape).collect();
        let frame = FrameDesc::fit_all(&shapes, View::Iso, 64, 48);
        let registry = Registry::with_core();
        let solid = |s: &Shape| {
            let resolved = ResolvedShape::new(s, registry.shaders()).unwrap();
            Solid::new(&resolved, None).unwrap().unwrap()
        };
        (shapes.iter().map(solid).collect(), frame)
    }

    #[test]
    fn runs_of_one_shape_end_where_rays_may() {
        let (solids, frame) = solids(&[DVec3::ZERO]);
        let sampling = Sampling { rate: Rate::Distance(0.1), ..Sampling::default() };
        let slicing = Slicing::new(solids.iter().collect(), &frame, &sampling).unwrap();
        let (order, groups) = in_groups(&slicing, 1);
        assert_eq!((order, &groups[..]), (vec![0], &[[0, 1]][..]));
        let all = runs(&slicing, &groups, false);
        assert!(all.len() > 3 && all.windows(2).all(|r| r[0].end == r[1].first && r[1].first.unwrap() % WHOLE == 0));
        assert!(all[0].first.is_none() && all[all.len() - 1].end.is_none());
        let slabs: f64 = all.iter().map(|r| (r.levels[1] - r.levels[0]) / 0.1).sum();
        assert_eq!(slabs.round() as usize, slicing.step().planes);
        let (corners, polygons) = corners(&slicing, &groups, (64, 0.25), false, Upward::No);
        assert_eq!(polygons.len(), all.len());
        assert!(corners.iter().all(|c| c.place.iter().all(|v| v.abs() < 1.1) && c.rest == 0.25));
        // The same polygons, turned upside down.
        let (turned, _) = super::corners(&slicing, &groups, (64, 0.25), false, Upward::Yes);
        assert!(corners.iter().zip(&turned).all(|(a, b)| a.place == [b.place[0], -b.place[1]] && a.run == b.run));
        let second = &corners[polygons[1].first as usize];
        assert_eq!(i64::from(second.run[2]), all[1].first.unwrap() - 64);
    }

    #[test]
    fn strips_cover_convex_polygons_once() {
        for count in 3..12 {
            let corner = |i: usize| {
                let turn = std::f64::consts::TAU * i as f64 / count as f64;
                DVec2::new(turn.cos(), turn.sin())
            };
            let all: Vec<DVec2> = strip(count).map(corner).collect();
            let area = |t: &[DVec2]| 0.5 * (t[1] - t[0]).perp_dot(t[2] - t[0]).abs();
            let sum: f64 = all.windows(3).map(area).sum();
            let whole = 0.5 * count as f64 * (std::f64::consts::TAU / count as f64).sin();
            assert!((sum - whole).abs() < 1e-12, "{count}: {sum} {whole}");
        }
    }

    #[test]
    fn shapes_that_overlap_share_runs_and_others_have_their_own() {
        let (solids, frame) = solids(&[DVec3::ZERO, DVec3::splat(-30.0), DVec3::splat(0.4)]);
        let sampling = Sampling { rate: Rate::Distance(0.1), ..Sampling::default() };
        let slicing = Slicing::new(solids.iter().collect(), &frame, &sampling).unwrap();
        let (order, groups) = in_groups(&slicing, 3);
        // The first and the third are together, whichever group is in front.
        assert_eq!(order, [0, 2, 1]);
        let mut all = groups;
        all.sort_unstable();
        assert_eq!(all, [[0, 2], [2, 3]]);
    }

    #[test]
    fn pictures_of_their_own_are_one_run_behind_all_others() {
        let (solids, frame) = solids(&[DVec3::ZERO, DVec3::splat(0.4)]);
        let slicing = Slicing::new(solids.iter().collect(), &frame, &Sampling::default()).unwrap();
        let (_, groups) = in_groups(&slicing, 1);
        let all = runs(&slicing, &groups, false);
        let last = &all[all.len() - 1];
        assert_eq!((last.shapes, last.first, last.end), ([1, 2], None, None));
        assert!(all[..all.len() - 1].iter().all(|r| r.shapes == [0, 1]));
    }
}
