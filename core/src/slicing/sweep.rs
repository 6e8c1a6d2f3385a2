//! Slices in order of depth.

use std::{
    cmp::Ordering,
    collections::{BinaryHeap, VecDeque},
};

use glam::{DVec2, DVec3};

use super::{
    Levels, Polygons, Slicing,
    cells::Active,
    plan::{Form, Part},
    polygon::Clips,
};

/// In which order slices come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Order {
    /// The nearest first, for blending under what is there.
    FrontToBack,
    /// The farthest first, for blending over it.
    #[default]
    BackToFront,
}

/// Goes through the slices of a [`Slicing`].
#[derive(Debug)]
pub struct Sweep<'s> {
    slicing: &'s Slicing<'s>,
    order: Order,
    /// Clusters and sides of the eye still to come, the next last.
    stages: Vec<(usize, usize)>,
    side: usize,
    heads: BinaryHeap<Head>,
    /// Slices of one level that come next.
    ready: VecDeque<Head>,
    active: Vec<Active>,
    corners: Vec<DVec3>,
}

/// A shape's next slab.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Head {
    key: f64,
    shape: usize,
    position: usize,
}

impl Eq for Head {}

impl Ord for Head {
    /// The heap's greatest is the one that comes first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.key.total_cmp(&self.key).then(other.shape.cmp(&self.shape))
    }
}

impl PartialOrd for Head {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// One shape in one slab.
#[derive(Debug)]
pub struct Slice<'w> {
    /// The shape, by its place in what [`Slicing::new`] was given.
    pub shape: usize,
    /// The slab's number.
    pub number: i64,
    /// The levels at which the slab begins and ends, the lower first; where it holds the eye, the part
    /// on one side.
    pub slab: [f64; 2],
    part: &'w Part<'w>,
    slicing: &'w Slicing<'w>,
    active: &'w Active,
    corners: &'w mut Vec<DVec3>,
}

impl<'s> Sweep<'s> {
    pub(super) fn new(slicing: &'s Slicing<'s>, order: Order) -> Self {
        let clusters = 0..slicing.clusters.len();
        let stage = |c: usize| [(c, 0), (c, 1)];
        let mut stages: Vec<_> = clusters.flat_map(stage).collect();
        if order == Order::FrontToBack {
            stages.reverse();
        }
        let active = slicing.parts.iter().map(|_| Active::default()).collect();
        let (heads, ready) = (BinaryHeap::new(), VecDeque::new());
        Self { slicing, order, stages, side: 0, heads, ready, active, corners: Vec::new() }
    }

    /// The next slice; `None` after the last.
    pub fn next_slice(&mut self) -> Option<Slice<'_>> {
        while self.ready.is_empty() {
            if self.heads.is_empty() {
                let (cluster, side) = self.stages.pop()?;
                self.begin(cluster, side);
            }
            self.gather();
        }
        let head = self.ready.pop_front()?;
        let part = &self.slicing.parts[head.shape];
        let number = self.number(part, head.position);
        if let Form::Cells(cells) | Form::Shelled(_, cells) = &part.shape {
            cells.advance(&mut self.active[head.shape], &part.slabs, head.position);
        }
        if let Some(next) = self.head(head.shape, head.position + 1) {
            self.heads.push(next);
        }
        let [a, b] = part.slabs.slab(number);
        let slab = match (self.slicing.has_eye(), self.side) {
            (true, 0) => [a.max(0.0), b],
            (true, _) => [a, b.min(0.0)],
            _ => [a, b],
        };
        let (slicing, active) = (self.slicing, &self.active[head.shape]);
        Some(Slice { shape: head.shape, number, slab, part, slicing, active, corners: &mut self.corners })
    }

    fn begin(&mut self, cluster: usize, side: usize) {
        self.side = side;
        let slicing = self.slicing;
        for &shape in &slicing.clusters[cluster] {
            let part = &slicing.parts[shape];
            let mut run = part.runs[side];
            if self.order == Order::BackToFront {
                run.first = run.number(run.count.saturating_sub(1));
                run.ascending = !run.ascending;
            }
            if let Form::Cells(cells) | Form::Shelled(_, cells) = &part.shape
                && run.count > 0
            {
                self.active[shape] = cells.start(&part.slabs, run);
            }
            self.heads.extend(self.head(shape, 0));
        }
    }

    fn number(&self, part: &Part<'_>, position: usize) -> i64 {
        let run = part.runs[self.side];
        run.number(if self.order == Order::FrontToBack { position } else { run.count - 1 - position })
    }

    fn head(&self, shape: usize, position: usize) -> Option<Head> {
        let part = &self.slicing.parts[shape];
        if position >= part.runs[self.side].count {
            return None;
        }
        let level = part.slabs.middle(self.number(part, position));
        let rising = (self.side == 0) == (self.order == Order::FrontToBack);
        Some(Head { key: if rising { level } else { -level }, shape, position })
    }

    /// Takes all slices of the next level, in their order in it.
    fn gather(&mut self) {
        let Some(first) = self.heads.pop() else { return };
        self.ready.push_back(first);
        while self.heads.peek().is_some_and(|h| h.key == first.key) {
            self.ready.extend(self.heads.pop());
        }
        if self.ready.len() > 1 {
            let number = self.number(&self.slicing.parts[first.shape], first.position);
            let ranks = &self.slicing.depths.ranks[(number & 1) as usize];
            let back = self.order == Order::BackToFront;
            let place = |h: &Head| if back { usize::MAX - ranks[h.shape] } else { ranks[h.shape] };
            self.ready.make_contiguous().sort_by_key(place);
        }
    }
}

impl Slice<'_> {
    /// Whether the shape is a block, to be drawn by its [`hull`](Self::hull).
    pub fn is_block(&self) -> bool {
        !matches!(self.part.shape, Form::Cells(_))
    }

    /// The level of the plane that stands for the slab: its middle.
    pub fn level(&self) -> f64 {
        self.part.slabs.middle(self.number)
    }

    /// The surfaces that cut the shape.
    pub fn levels(&self) -> &Levels {
        &self.part.levels
    }

    /// Writes what the block's slab covers: a convex polygon in pixels of the viewport, grown by
    /// [`MARGIN`](super::MARGIN), and clipped to one pixel around the viewport; nothing for meshes. Fragments
    /// cut their own segments, which may be empty.
    pub fn hull(&mut self, out: &mut Vec<DVec2>) {
        self.part.cover(&self.slicing.map, self.slab, self.corners, out);
    }

    /// Writes the polygons in which the slab's middle surface cuts the shape, clipped by the volume's
    /// region, clips and, where surfaces do not follow them, the near and far planes.
    pub fn polygons(&self, out: &mut Polygons) {
        let solid = self.part.solid;
        let clip = Clips {
            object: solid.clip(),
            region: solid.region(),
            world: &self.slicing.clip,
            ends: self.slicing.ends.as_ref(),
        };
        match &self.part.shape {
            Form::Cells(cells) | Form::Shelled(_, cells) => cells.cut(self.active, self.level(), &clip, out),
            Form::Block(block) => {
                out.clear(solid.attribute_numbers());
                let normal = self.part.levels.gradient(block.world()[0]);
                let push = |object, world| {
                    let texture = solid.texture(object);
                    out.push_vertex([world, object, texture], |_| ());
                };
                block.cut(self.level(), normal, push);
                out.close(0, None, normal, &clip);
            }
        }
    }
}
