//! A mesh from one camera: everything that a packet of its picture needs.
#![expect(unsafe_code, reason = "calls kernels of a vector unit that was found")]

use std::cell::RefCell;

use volact_core::{
    Aabb,
    camera::LinearRays,
    glam::{DAffine3, DVec3},
};

use super::{
    super::{
        over::Pixels,
        packet::Span,
        simd::{LANES, Plain, Simd, Unit},
    },
    build::Linked,
    entries::{Entries, Hits},
    integrate::{Colours, Job},
    lengths::Lengths,
    project::{Slopes, View},
    walk::{Cells, Limits, walk},
};

/// A mesh from one camera.
#[derive(Debug)]
pub struct Shot<'a> {
    linked: &'a Linked,
    view: View,
    vertices: Vec<[f32; 4]>,
    entries: Entries,
    /// The doors of the cell that holds the eye.
    held: Option<[u32; 4]>,
    /// The eye lies in several cells, or too near to the boundary to tell.
    unclear: bool,
}

/// Memory that packets use again and again.
#[derive(Debug, Default)]
struct Scratch {
    hits: Hits,
    limits: Limits,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// What came of a packet.
#[derive(Clone, Copy, Debug, Default)]
pub struct Drawn {
    /// Rays that met the mesh.
    pub met: u32,
    /// Stretches that they crossed.
    pub crossings: u64,
    /// Rays that are left to the plain way, and unchanged.
    pub left: u32,
}

impl<'a> Shot<'a> {
    /// Sees a mesh through the rays of a viewport of `size`. `numbers` are the vertices', as a
    /// [`Table`](super::table::Table) counts them. `None` where f32 cannot tell cells apart.
    pub fn new(
        linked: &'a Linked,
        numbers: &[f32],
        to_world: &DAffine3,
        bounds: &Aabb,
        (rays, size): (&LinearRays, [usize; 2]),
        threads: usize,
    ) -> Option<Self> {
        let view = View::new(rays, size, to_world, bounds)?;
        let vertices = view.project(&linked.vertices, numbers, threads);
        let (held, unclear) = match rays.eye.map(|eye| to_world.inverse().transform_point3(eye)) {
            Some(eye) => holding(linked, eye, bounds),
            None => (None, false),
        };
        let held = held.map(|t| [0, 1, 2, 3].map(|c| 4 * t + c));
        let always = held.as_ref().map_or(&[][..], |doors| &doors[..]);
        let entries = Entries::new(linked, &vertices, &view, size, always);
        Some(Self { linked, view, vertices, entries, held, unclear })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.vertices.as_slice()) + self.entries.bytes()
    }

    /// Draws the pixels `x..x + 4`, `y..y + 4` in some intervals of their rays, in order and
    /// apart, going on from what pixels hold.
    pub fn draw(&self, unit: Unit, pixel: [usize; 2], spans: &[Span], job: &Job<'_>, pixels: &mut Pixels) -> Drawn {
        if self.entries.is_empty(pixel) {
            return Drawn::default();
        }
        let before = pixels.clone();
        let drawn = SCRATCH.with_borrow_mut(|scratch| {
            // SAFETY: units are only made by `Unit::detect` or after `Unit::available`.
            unsafe {
                match unit {
                    #[cfg(target_arch = "x86_64")]
                    Unit::Avx512 => draw_avx512(self, pixel, spans, job, pixels, scratch),
                    #[cfg(target_arch = "x86_64")]
                    Unit::Avx2 => draw_avx2(self, pixel, spans, job, pixels, scratch),
                    _ => draw_plain(self, pixel, spans, job, pixels, scratch),
                }
            }
        });
        for l in (0..LANES).filter(|l| drawn.left >> l & 1 == 1) {
            (pixels.color[l], pixels.depth[l]) = (before.color[l], before.depth[l]);
        }
        drawn
    }

    /// The world lengths that the rays of a packet pass inside cells, by the way that draws.
    pub fn lengths(&self, unit: Unit, pixel: [usize; 2], spans: &[Span]) -> ([f64; LANES], Drawn) {
        let mut lengths = [0.0; LANES];
        let drawn = SCRATCH.with_borrow_mut(|scratch| {
            // SAFETY: as above.
            unsafe {
                match unit {
                    #[cfg(target_arch = "x86_64")]
                    Unit::Avx512 => lengths_avx512(self, pixel, spans, &mut lengths, scratch),
                    #[cfg(target_arch = "x86_64")]
                    Unit::Avx2 => lengths_avx2(self, pixel, spans, &mut lengths, scratch),
                    _ => lengths_plain(self, pixel, spans, &mut lengths, scratch),
                }
            }
        });
        (lengths, drawn)
    }

    #[inline(always)]
    unsafe fn draw_by<S: Simd>(
        &self,
        pixel: [usize; 2],
        spans: &[Span],
        job: &Job<'_>,
        pixels: &mut Pixels,
        scratch: &mut Scratch,
    ) -> Drawn {
        let slopes = self.view.slopes(pixel);
        // SAFETY: the caller's promises.
        unsafe {
            let active = self.aim::<S>(pixel, spans, &slopes, scratch);
            if active == 0 {
                return Drawn { left: self.left_alone(spans), ..Drawn::default() };
            }
            let mut along = Colours::<S>::new(job, &slopes, pixels);
            let cells = Cells { linked: self.linked, vertices: &self.vertices };
            let tally = walk::<S, _>(&cells, &slopes, &scratch.limits, &mut scratch.hits, &mut along);
            along.finish();
            Drawn { met: active, crossings: tally.crossings, left: tally.overlap | self.left_alone(spans) }
        }
    }

    #[inline(always)]
    unsafe fn lengths_by<S: Simd>(
        &self,
        pixel: [usize; 2],
        spans: &[Span],
        lengths: &mut [f64; LANES],
        scratch: &mut Scratch,
    ) -> Drawn {
        let slopes = self.view.slopes(pixel);
        // SAFETY: the caller's promises.
        unsafe {
            let active = self.aim::<S>(pixel, spans, &slopes, scratch);
            let mut along = Lengths::new(&slopes);
            let cells = Cells { linked: self.linked, vertices: &self.vertices };
            let tally = walk::<S, _>(&cells, &slopes, &scratch.limits, &mut scratch.hits, &mut along);
            *lengths = along.lengths();
            Drawn { met: active, crossings: tally.crossings, left: tally.overlap | self.left_alone(spans) }
        }
    }

    /// Finds where rays enter and between which depths they count; returns those that enter.
    #[inline(always)]
    unsafe fn aim<S: Simd>(&self, pixel: [usize; 2], spans: &[Span], slopes: &Slopes, scratch: &mut Scratch) -> u32 {
        let active = spans.iter().fold(0, |all, s| all | s.active) & !self.left_alone(spans);
        let spans_of = &mut scratch.limits.spans;
        spans_of.clear();
        spans_of.extend(spans.iter().map(|span| depths(span, slopes)));
        // SAFETY: the caller's promises.
        unsafe { self.entries.find::<S>(pixel, slopes, active, &mut scratch.hits) };
        let hits = &mut scratch.hits;
        if let (Some(doors), [[from, _], ..]) = (&self.held, spans_of.as_slice()) {
            hits.drop_before(hits.held, doors, from);
        }
        hits.begin()
    }

    /// Rays that the walk cannot follow.
    fn left_alone(&self, spans: &[Span]) -> u32 {
        if self.unclear { spans.iter().fold(0, |all, s| all | s.active) } else { 0 }
    }
}

/// Intervals of `t` as depths of rays; nothing where a ray has none.
#[inline(always)]
fn depths(span: &Span, slopes: &Slopes) -> [[f32; LANES]; 2] {
    let [mut from, mut to] = [[f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]];
    for (l, (from, to)) in from.iter_mut().zip(&mut to).enumerate() {
        if span.active >> l & 1 == 1 {
            let depth = |t: f64| ((t - slopes.zero[l]) / slopes.length[l]) as f32;
            (*from, *to) = (depth(span.start[l]), depth(span.end[l]));
        }
    }
    [from, to]
}

/// The cell that holds a point, and whether that is unclear: along three lines through the point
/// the same one cell must hold it.
fn holding(linked: &Linked, point: DVec3, bounds: &Aabb) -> (Option<u32>, bool) {
    let grown = bounds.size() * 1e-6;
    let inside = point.cmpge(bounds.min - grown).all() && point.cmple(bounds.max + grown).all();
    if !inside {
        return (None, false);
    }
    let mut found: Vec<Option<u32>> = Vec::new();
    let near = 1e-9 * bounds.size().length();
    for axis in [DVec3::new(1.0, 0.3, 0.2), DVec3::new(-0.2, 1.0, 0.3), DVec3::new(0.3, -0.2, 1.0)] {
        let mut cells = Vec::new();
        linked.trace(point, axis, [-near, near], |crossing| {
            cells.push((crossing.tetrahedron as u32, crossing.span));
            std::ops::ControlFlow::Continue(())
        });
        found.push(match cells.as_slice() {
            [] => None,
            [(cell, [a, b])] if *a <= -near && *b >= near => Some(*cell),
            _ => return (None, true),
        });
    }
    if found.iter().all(|c| *c == found[0]) { (found[0], false) } else { (None, true) }
}

macro_rules! for_unit {
    ($draw:ident, $lengths:ident, $unit:ty $(, $features:literal)?) => {
        $(#[target_feature(enable = $features)])?
        unsafe fn $draw(
            shot: &Shot<'_>,
            pixel: [usize; 2],
            spans: &[Span],
            job: &Job<'_>,
            pixels: &mut Pixels,
            scratch: &mut Scratch,
        ) -> Drawn {
            // SAFETY: compiled for the unit; the caller has found it.
            unsafe { shot.draw_by::<$unit>(pixel, spans, job, pixels, scratch) }
        }

        $(#[target_feature(enable = $features)])?
        unsafe fn $lengths(
            shot: &Shot<'_>,
            pixel: [usize; 2],
            spans: &[Span],
            lengths: &mut [f64; LANES],
            scratch: &mut Scratch,
        ) -> Drawn {
            // SAFETY: as above.
            unsafe { shot.lengths_by::<$unit>(pixel, spans, lengths, scratch) }
        }
    };
}

#[cfg(target_arch = "x86_64")]
for_unit!(draw_avx512, lengths_avx512, super::super::simd::Avx512, "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma");
#[cfg(target_arch = "x86_64")]
for_unit!(draw_avx2, lengths_avx2, super::super::simd::Avx2, "avx2,fma");
for_unit!(draw_plain, lengths_plain, Plain);
