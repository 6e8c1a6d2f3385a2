//! The `over` shapes of sixteen rays.
//!
//! Where no ray meets two at the same place, and nothing without thickness lies inside one, each
//! gets passes of its kernel from front to back, which go on from what the ones before left;
//! otherwise they are put together by a [`sweep`]. The cells of a mesh that is the only
//! shape have no lattice: they are passed up to each such thing, and then from there on.

use volact_core::lattice::Lattice;

use super::{
    dispatch,
    limits::Ends,
    over::{Job, Pixels},
    packet::{Bundle, Span},
    part::{Aimed, Content, Part, lane},
    simd::{LANES, Unit},
    sweep::{
        self, Layer, Look, Scene,
        piece::{Hit, Piece, Sight},
    },
    walk::Counts,
};

/// Distance within which places are one, as a part of themselves.
const SNAP: f64 = 1e-13;

/// The `over` shapes of a picture.
#[derive(Debug)]
pub struct Over<'a> {
    /// In rising order of their identities, which is that of sums.
    pub parts: Vec<Part<'a>>,
    /// The vector unit.
    pub unit: Unit,
    /// The frame's lattice.
    pub lattice: Lattice,
    /// Rays end where less than this is left to see.
    pub termination: f32,
    /// The opacity at which depth is taken.
    pub threshold: f32,
}

/// A stretch of a ray inside a part: of which one, and the how-manieth.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stretch {
    t: [f64; 2],
    part: usize,
    number: usize,
}

/// The parts that sixteen rays meet.
type Met<'p, 'a> = [(&'p Part<'a>, Aimed<'a>)];

impl Over<'_> {
    /// Draws sixteen rays where `span` holds them, with what ends them; returns those that met
    /// something.
    pub fn draw(
        &self,
        bundle: &Bundle,
        span: &Span,
        ends: Option<Ends>,
        pixels: &mut Pixels,
        counts: &mut Counts,
    ) -> u32 {
        let aimed = self.parts.iter().filter_map(|p| Some((p, p.region.aim(self.unit, bundle, span)?)));
        let mut aimed: Vec<(&Part<'_>, Aimed<'_>)> = aimed.collect();
        let ended = ends.as_ref().map_or(0, |e| e.met);
        let met = aimed.iter().fold(ended, |met, (_, a)| met | a.stretches.active());
        let hits = ends.map(|e| e.hits).filter(|_| ended != 0);
        if let [(part, only)] = aimed.as_slice()
            && let Content::Field(field) = &part.content
            && field.seen.is_some()
        {
            let hits = self.hits(bundle, &aimed, hits, counts);
            return ended | self.cells(bundle, part, only, &hits, pixels, counts);
        }
        let sliced = aimed.iter().any(|(part, _)| part.has_hits());
        if let ([(part, only)], None, false) = (aimed.as_slice(), &hits, sliced)
            && let Content::Voxels(job) = &part.content
            && only.bent.is_none()
        {
            self.alone(job, only, pixels, counts);
            return met;
        }
        if let ([(part, only)], None, false) = (aimed.as_slice(), &hits, sliced)
            && let Content::Shaded(shaded) = &part.content
        {
            let ends = (self.termination, self.threshold);
            shaded.alone(only.rays(bundle), &only.packets(), ends, pixels, counts);
            return met;
        }
        let hits = self.hits(bundle, &aimed, hits, counts);
        aimed.retain(|(part, _)| part.volume);
        match self.stretches(&aimed, &hits) {
            Some(stretches) => self.in_order(bundle, &aimed, &stretches, &hits, pixels, counts),
            None => self.together(bundle, &aimed, &hits, pixels, counts),
        }
        met
    }

    /// Draws the only part there is.
    fn alone(&self, job: &Job<'_>, aimed: &Aimed<'_>, pixels: &mut Pixels, counts: &mut Counts) {
        for span in aimed.stretches.spans() {
            dispatch::draw(job, &aimed.packet.within(span), pixels, counts);
        }
    }

    /// Draws the cells of a mesh, and hits among them; returns the rays that met either.
    fn cells(
        &self,
        bundle: &Bundle,
        part: &Part<'_>,
        aimed: &Aimed<'_>,
        hits: &[Vec<Hit>; LANES],
        pixels: &mut Pixels,
        counts: &mut Counts,
    ) -> u32 {
        let (mut from, mut next, mut met) = ([f64::NEG_INFINITY; LANES], [0; LANES], 0);
        loop {
            let mut to = [f64::INFINITY; LANES];
            for (l, to) in to.iter_mut().enumerate() {
                *to = hits[l].get(next[l]).map_or(f64::INFINITY, |h| h.t);
            }
            if part.volume {
                let spans = aimed.stretches.spans().iter().map(|s| s.between(&from, &to));
                let spans: Vec<Span> = spans.filter(|s| s.active != 0).collect();
                met |= self.walk(bundle, part, &spans, pixels, counts);
            }
            if to.iter().all(|t| t.is_infinite()) {
                return met;
            }
            for l in (0..LANES).filter(|&l| to[l].is_finite()) {
                self.meet(l, &hits[l], &mut next[l], to[l], pixels);
                met |= 1 << l;
            }
            from = to;
        }
    }

    /// Draws the cells of a mesh on some stretches; returns the rays that met them.
    fn walk(&self, bundle: &Bundle, part: &Part<'_>, spans: &[Span], pixels: &mut Pixels, counts: &mut Counts) -> u32 {
        let Content::Field(field) = &part.content else { return 0 };
        let (Some(seen), false) = (&field.seen, spans.is_empty()) else { return 0 };
        let drawn = seen.shot.draw(self.unit, bundle.pixel, spans, &seen.job, pixels);
        counts.samples += drawn.crossings;
        counts.lattice += drawn.crossings;
        if drawn.left == 0 {
            return drawn.met;
        }
        // Cells overlap there, or the eye is on a face.
        let rays = bundle.through(&part.region.place.to_object);
        let mut pieces: [Vec<Piece>; LANES] = Default::default();
        let mut cuts = Vec::new();
        for (l, pieces) in pieces.iter_mut().enumerate().filter(|(l, _)| drawn.left >> l & 1 == 1) {
            for span in spans.iter().filter(|s| s.active >> l & 1 == 1) {
                field.pieces(lane(&rays, l), [span.start[l], span.end[l]], &mut cuts, pieces);
            }
        }
        self.sweep(Vec::new(), &mut pieces, &Default::default(), drawn.left, pixels, counts);
        drawn.met | drawn.left
    }

    /// All hits by lane, in order.
    fn hits(
        &self,
        bundle: &Bundle,
        aimed: &Met<'_, '_>,
        at_ends: Option<[Vec<Hit>; LANES]>,
        counts: &mut Counts,
    ) -> [Vec<Hit>; LANES] {
        let mut hits = at_ends.unwrap_or_default();
        for (part, aimed) in aimed.iter().filter(|(part, _)| part.has_hits()) {
            part.hits(bundle, aimed, &mut hits, counts);
        }
        // Where sums are made in the order of colours they depend on no other order.
        let order = |a: &Hit, b: &Hit| {
            let colors = a.color.iter().zip(&b.color).map(|(a, b)| a.total_cmp(b));
            colors.fold(a.t.total_cmp(&b.t), std::cmp::Ordering::then)
        };
        hits.iter_mut().for_each(|hits| hits.sort_by(order));
        hits
    }

    /// The stretches of each lane in order; `None` where some overlap, hold a hit, or have no kernel
    /// of their own.
    fn stretches(&self, aimed: &Met<'_, '_>, hits: &[Vec<Hit>; LANES]) -> Option<[Vec<Stretch>; LANES]> {
        let alone = |(part, aimed): &(&Part<'_>, Aimed<'_>)| match &part.content {
            Content::Voxels(_) => aimed.bent.is_none(),
            Content::Field(field) => field.seen.is_some(),
            Content::Shaded(_) | Content::Crossings(_) => false,
        };
        if !aimed.iter().all(alone) {
            return None;
        }
        let mut all: [Vec<Stretch>; LANES] = Default::default();
        for (l, lane) in all.iter_mut().enumerate() {
            for (part, (_, aimed)) in aimed.iter().enumerate() {
                let stretches = aimed.stretches.lane(l).enumerate();
                lane.extend(stretches.map(|(number, t)| Stretch { t, part, number }));
            }
            lane.sort_by(|a, b| a.t[0].total_cmp(&b.t[0]));
            let near = |t: f64| SNAP * t.abs();
            let overlap = lane.windows(2).any(|s| s[1].t[0] < s[0].t[1] - near(s[0].t[1]));
            let inside = |h: &Hit, s: &Stretch| s.t[0] + near(h.t) < h.t && h.t < s.t[1] - near(h.t);
            if overlap || hits[l].iter().any(|h| lane.iter().any(|s| inside(h, s))) {
                return None;
            }
        }
        Some(all)
    }

    /// Draws stretches that are apart, those of several rays together where they are next in the
    /// same part.
    fn in_order(
        &self,
        bundle: &Bundle,
        aimed: &Met<'_, '_>,
        stretches: &[Vec<Stretch>; LANES],
        hits: &[Vec<Hit>; LANES],
        pixels: &mut Pixels,
        counts: &mut Counts,
    ) {
        let (mut next, mut met) = ([0; LANES], [0; LANES]);
        loop {
            for l in 0..LANES {
                let until = stretches[l].get(next[l]).map_or(f64::INFINITY, |s| s.t[0] + SNAP * s.t[0].abs());
                self.meet(l, &hits[l], &mut met[l], until, pixels);
            }
            let head = |l: usize| stretches[l].get(next[l]).map(|s| (s.part, s.number));
            let Some((part, number)) = (0..LANES).find_map(head) else { return };
            let mut span = aimed[part].1.stretches.spans()[number];
            span.active = (0..LANES).fold(0, |lanes, l| lanes | u32::from(head(l) == Some((part, number))) << l);
            let (drawn, Aimed { packet, .. }) = &aimed[part];
            match &drawn.content {
                Content::Voxels(job) => dispatch::draw(job, &packet.within(&span), pixels, counts),
                Content::Field(_) => drop(self.walk(bundle, drawn, &[span], pixels, counts)),
                // Without a kernel of its own it is never here: see `stretches`.
                Content::Shaded(_) | Content::Crossings(_) => {}
            }
            (0..LANES).for_each(|l| next[l] += (span.active >> l & 1) as usize);
        }
    }

    /// Adds a lane's hits up to some `t`, those of one place at once.
    fn meet(&self, l: usize, hits: &[Hit], met: &mut usize, until: f64, pixels: &mut Pixels) {
        while let Some(first) = hits.get(*met).filter(|h| h.t <= until) {
            let same = hits[*met..].partition_point(|h| h.t <= first.t + SNAP * first.t.abs());
            let group = &hits[*met..*met + same];
            *met += same;
            if 1.0 - pixels.color[l][3] < self.termination {
                continue;
            }
            let color = pixels.color[l].map(f64::from);
            let mut sight = Sight { color, depth: pixels.depth[l], threshold: f64::from(self.threshold) };
            sight.meet(group);
            (pixels.color[l], pixels.depth[l]) = (sight.color.map(|v| v as f32), sight.depth);
        }
    }

    /// Draws parts that meet.
    fn together(
        &self,
        bundle: &Bundle,
        aimed: &Met<'_, '_>,
        hits: &[Vec<Hit>; LANES],
        pixels: &mut Pixels,
        counts: &mut Counts,
    ) {
        let mut pieces: [Vec<Piece>; LANES] = Default::default();
        let mut cuts = Vec::new();
        let mut layers = Vec::new();
        let mut active = hits.iter().enumerate().fold(0, |a, (l, hits)| a | u32::from(!hits.is_empty()) << l);
        for (part, aimed) in aimed {
            active |= aimed.stretches.active();
            match &part.content {
                Content::Voxels(job) => layers.push(Layer {
                    look: Look::Voxels { job, bent: aimed.bent.as_deref() },
                    packet: &aimed.packet,
                    stretches: &aimed.stretches,
                }),
                Content::Shaded(shaded) => layers.push(Layer {
                    look: Look::Shaded { shaded: shaded.as_ref(), rays: aimed.rays(bundle) },
                    packet: &aimed.packet,
                    stretches: &aimed.stretches,
                }),
                // Their hits are all there is of them.
                Content::Crossings(_) => {}
                Content::Field(field) => {
                    let rays = bundle.through(&part.region.place.to_object);
                    for (l, pieces) in pieces.iter_mut().enumerate() {
                        for span in aimed.stretches.lane(l) {
                            field.pieces(lane(&rays, l), span, &mut cuts, pieces);
                        }
                    }
                }
            }
        }
        self.sweep(layers, &mut pieces, hits, active, pixels, counts);
    }

    fn sweep(
        &self,
        layers: Vec<Layer<'_>>,
        pieces: &mut [Vec<Piece>; LANES],
        hits: &[Vec<Hit>; LANES],
        active: u32,
        pixels: &mut Pixels,
        counts: &mut Counts,
    ) {
        pieces.iter_mut().for_each(|p| p.sort_by(|a, b| a.t[0].total_cmp(&b.t[0])));
        let scene = Scene {
            layers,
            pieces,
            hits,
            active,
            step: self.lattice.step,
            termination: self.termination,
            threshold: self.threshold,
        };
        sweep::draw(self.unit, &scene, pixels, counts);
    }
}
