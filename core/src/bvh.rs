//! Which boxes a line meets: a bounding volume hierarchy.
//!
//! A binary tree over boxes, split at the median of their middles along the longest axis, so that
//! its depth and memory are known beforehand: at most 36 bytes a box, and a node's box in f32
//! relative to the whole, rounded outward. A query visits every box that the line meets, and now
//! and then one that it misses: exact answers are for the caller to find.

use std::ops::Range;

use glam::DVec3;

use crate::Aabb;

/// Items in a leaf at most; at least half as many, so that there are fewer nodes than items.
const LEAF: usize = 4;

/// Levels at most: a tree over 2³² items has 31.
const DEPTH: usize = 40;

/// A tree over boxes.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    /// Depth first: the left child follows its parent.
    nodes: Vec<Node>,
    /// The items, leaf by leaf.
    items: Vec<u32>,
    /// Boxes are stored as (p − center) / scale, between −1 and 1; the scale is a power of two.
    center: DVec3,
    scale: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    min: [f32; 3],
    max: [f32; 3],
    /// The right child, or the first item of a leaf.
    link: u32,
    /// Items of a leaf, 0 for an inner node.
    count: u32,
}

/// A node as others see it who go through the tree themselves.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// The box around all items below it.
    pub bounds: Aabb,
    /// The node to go on with where the box is missed; where it is met, that is the next one.
    pub skip: usize,
    /// The places in [`Bvh::items`] of a leaf's items; empty for an inner node.
    pub items: Range<usize>,
}

/// An item while the tree is made: the middle of its box, and its number.
#[derive(Clone, Copy)]
struct Seed {
    middle: [f32; 3],
    item: u32,
}

impl Bvh {
    /// A tree over boxes with finite corners; empty ones are never visited.
    ///
    /// Takes time in proportion to the number of boxes times the tree's depth.
    ///
    /// # Panics
    /// If there are 2³² boxes or more.
    pub fn new(boxes: &[Aabb]) -> Self {
        assert!(u32::try_from(boxes.len()).is_ok(), "{} boxes", boxes.len());
        let all = boxes.iter().filter(|b| !b.is_empty()).fold(Aabb::EMPTY, |all, b| all.union(b));
        if all.is_empty() {
            return Self::default();
        }
        // Halves first: a sum of corners may overflow.
        let center = all.min / 2.0 + all.max / 2.0;
        let scale = power_of_two((all.max / 2.0 - all.min / 2.0).max_element());
        let middle = |b: &Aabb| (((b.min / 2.0 + b.max / 2.0) - center) / scale).to_array().map(|v| v as f32);
        let seeds = boxes.iter().enumerate().filter(|(_, b)| !b.is_empty());
        let mut seeds: Vec<_> = seeds.map(|(i, b)| Seed { middle: middle(b), item: i as u32 }).collect();
        let mut tree = Self { nodes: Vec::with_capacity(seeds.len()), items: Vec::new(), center, scale };
        tree.items.reserve_exact(seeds.len());
        tree.build(boxes, &mut seeds);
        tree.nodes.shrink_to_fit();
        tree
    }

    /// Whether there is nothing to meet.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// The bytes that it holds.
    pub fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.items.capacity() * size_of::<u32>()
    }

    /// The items, by their numbers, leaf by leaf.
    pub fn items(&self) -> &[u32] {
        &self.items
    }

    /// The nodes, depth first, for who goes through them without a stack: from one to the next where its box
    /// is met, else to the one it says.
    pub fn nodes(&self) -> Vec<Visit> {
        // A subtree ends where that of its right child does, which lies behind it.
        let mut ends = vec![0; self.nodes.len()];
        for (at, node) in self.nodes.iter().enumerate().rev() {
            ends[at] = if node.count > 0 { at + 1 } else { ends[node.link as usize] };
        }
        let absolute = |p: [f32; 3]| DVec3::from(p.map(f64::from)) * self.scale + self.center;
        let visit = |(node, skip): (&Node, usize)| {
            let first = if node.count > 0 { node.link as usize } else { 0 };
            let bounds = Aabb::new(absolute(node.min), absolute(node.max));
            Visit { bounds, skip, items: first..first + node.count as usize }
        };
        self.nodes.iter().zip(ends).map(visit).collect()
    }

    /// Visits every item whose box the line `origin + t·direction` meets for a `t` within `span`,
    /// and perhaps others whose boxes are near it; each once, in no particular order.
    ///
    /// `direction` has any length but zero.
    pub fn line(&self, origin: DVec3, direction: DVec3, span: [f64; 2], mut visit: impl FnMut(usize)) {
        if self.nodes.is_empty() {
            return;
        }
        let query = Query::new(self, origin, direction, span);
        let mut stack = [0u32; DEPTH];
        let (mut top, mut at) = (0, 0usize);
        loop {
            let node = &self.nodes[at];
            if query.meets(node) {
                if node.count == 0 {
                    stack[top] = node.link;
                    top += 1;
                    at += 1;
                    continue;
                }
                let first = node.link as usize;
                self.items[first..first + node.count as usize].iter().for_each(|&item| visit(item as usize));
            }
            if top == 0 {
                return;
            }
            top -= 1;
            at = stack[top] as usize;
        }
    }

    /// Makes the tree over seeds; returns the box around them, relative and rounded outward.
    fn build(&mut self, boxes: &[Aabb], seeds: &mut [Seed]) -> [[f32; 3]; 2] {
        let at = self.nodes.len();
        self.nodes.push(Node { min: [0.0; 3], max: [0.0; 3], link: self.items.len() as u32, count: 0 });
        let [min, max] = if seeds.len() <= LEAF {
            self.nodes[at].count = seeds.len() as u32;
            self.items.extend(seeds.iter().map(|s| s.item));
            let around = seeds.iter().map(|s| self.outward(&boxes[s.item as usize]));
            around.reduce(union).unwrap_or_default()
        } else {
            let axis = longest_axis(seeds);
            let half = seeds.len() / 2;
            seeds.select_nth_unstable_by(half, |a, b| a.middle[axis].total_cmp(&b.middle[axis]));
            let (left, right) = seeds.split_at_mut(half);
            let left = self.build(boxes, left);
            self.nodes[at].link = self.nodes.len() as u32;
            union(left, self.build(boxes, right))
        };
        (self.nodes[at].min, self.nodes[at].max) = (min, max);
        [min, max]
    }

    /// A box relative to the whole, rounded outward.
    fn outward(&self, b: &Aabb) -> [[f32; 3]; 2] {
        let relative = |p: DVec3| ((p - self.center) / self.scale).to_array().map(|v| v as f32);
        [relative(b.min).map(f32::next_down), relative(b.max).map(f32::next_up)]
    }
}

/// A line relative to a tree.
struct Query {
    origin: [f64; 3],
    /// Infinite where the line is parallel to the axis' planes: then the slab test comes to
    /// whether the origin is between them.
    inverse: [f64; 3],
    /// What boxes have to grow by to make up for rounding.
    grow: [f64; 3],
    span: [f64; 2],
}

impl Query {
    fn new(tree: &Bvh, origin: DVec3, direction: DVec3, span: [f64; 2]) -> Self {
        let origin = (origin - tree.center) / tree.scale;
        let inverse = (direction / tree.scale).recip();
        // The origin is off by half a unit in the last place of itself, a plane's distance by one
        // of its own, and t by as much as if the plane were off by two more.
        let grow = (origin.abs() + 1.0) * (8.0 * f64::EPSILON);
        Self { origin: origin.to_array(), inverse: inverse.to_array(), grow: grow.to_array(), span }
    }

    /// The slab test (T. Kay, J. Kajiya, *Ray tracing complex scenes*, 1986). `min` and `max`
    /// pass over NaN, which is 0·∞: a line in a plane of the box.
    fn meets(&self, node: &Node) -> bool {
        let [mut t0, mut t1] = self.span;
        for a in 0..3 {
            let lo = (f64::from(node.min[a]) - self.grow[a] - self.origin[a]) * self.inverse[a];
            let hi = (f64::from(node.max[a]) + self.grow[a] - self.origin[a]) * self.inverse[a];
            t0 = t0.max(lo.min(hi));
            t1 = t1.min(lo.max(hi));
        }
        t0 <= t1
    }
}

fn union([a, b]: [[f32; 3]; 2], [c, d]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    [[0, 1, 2].map(|i| a[i].min(c[i])), [0, 1, 2].map(|i| b[i].max(d[i]))]
}

fn longest_axis(seeds: &[Seed]) -> usize {
    let start = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    let [lo, hi] = seeds.iter().fold(start, |b, s| union(b, [s.middle; 2]));
    (0..3).max_by(|&a, &b| (hi[a] - lo[a]).total_cmp(&(hi[b] - lo[b]))).unwrap_or(0)
}

/// The smallest power of two that is not below `size`; 1 for 0.
fn power_of_two(size: f64) -> f64 {
    let power = size.log2().ceil().exp2();
    if power > 0.0 && power.recip().is_normal() && power.is_normal() { power } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn visited(tree: &Bvh, origin: DVec3, direction: DVec3, span: [f64; 2]) -> Vec<usize> {
        let mut found = Vec::new();
        tree.line(origin, direction, span, |i| found.push(i));
        found.sort_unstable();
        found
    }

    /// Items of leaves all of whose boxes hold a place, as found without a stack.
    fn holding(tree: &Bvh, place: DVec3) -> Vec<u32> {
        let (nodes, mut found, mut at) = (tree.nodes(), Vec::new(), 0);
        while let Some(node) = nodes.get(at) {
            let holds = node.bounds.min.cmple(place).all() && node.bounds.max.cmpge(place).all();
            if holds {
                found.extend(&tree.items()[node.items.clone()]);
            }
            at = if holds { at + 1 } else { node.skip };
        }
        found.sort_unstable();
        found
    }

    fn meets(b: &Aabb, origin: DVec3, direction: DVec3, span: [f64; 2]) -> bool {
        b.clip_line(origin, direction).is_some_and(|[t0, t1]| t0 <= span[1] && t1 >= span[0])
    }

    /// On a coarse grid, so that lines run in faces and through edges and corners.
    fn coordinate() -> impl Strategy<Value = f64> {
        (-4..5i32).prop_map(f64::from)
    }

    proptest! {
        #[test]
        fn every_box_that_a_line_meets_is_visited_once(
            corners in prop::collection::vec((prop::array::uniform3(coordinate()), prop::array::uniform3(0..4i32)), 0..80),
            origin in prop::array::uniform3(coordinate()),
            direction in prop::array::uniform3(coordinate()),
            start in coordinate(),
            scale in prop::sample::select(vec![1e-200, 1e-9, 1.0, 1e7, 1e200]),
            shift in prop::sample::select(vec![0.0, 1e7]),
        ) {
            let direction = DVec3::from(direction);
            prop_assume!(direction != DVec3::ZERO);
            let place = |p: DVec3| (p + shift) * scale;
            let boxes: Vec<_> = corners.iter().map(|&(at, size)| {
                let at = DVec3::from(at);
                Aabb::new(place(at), place(at + DVec3::from(size.map(f64::from))))
            }).collect();
            let tree = Bvh::new(&boxes);
            prop_assert!(tree.bytes() <= 36 * boxes.len());
            let (origin, direction, span) = (place(DVec3::from(origin)), direction * scale, [start, start + 3.0]);
            let found = visited(&tree, origin, direction, span);
            prop_assert!(found.windows(2).all(|w| w[0] < w[1]), "{found:?}");
            for (i, b) in boxes.iter().enumerate() {
                prop_assert!(!meets(b, origin, direction, span) || found.contains(&i), "{i} {b:?}");
                // What is visited in vain is near: its leaf's box is no larger than the whole.
                let all = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
                let grown = Aabb::new(all.min - 1e-6 * scale, all.max + 1e-6 * scale);
                prop_assert!(!found.contains(&i) || meets(&grown, origin, direction, span), "{i} {b:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn every_box_that_holds_a_place_is_found_without_a_stack(
            boxes in prop::collection::vec([prop::array::uniform3(-9.0..9.0f64), prop::array::uniform3(-9.0..9.0f64)], 0..90),
            place in prop::array::uniform3(-9.0..9.0f64),
        ) {
            let place = DVec3::from(place);
            let boxes = boxes.iter().map(|&[a, b]| {
                let (a, b) = (DVec3::from(a), DVec3::from(b));
                Aabb::new(a.min(b), a.max(b))
            });
            let boxes: Vec<_> = boxes.collect();
            let tree = Bvh::new(&boxes);
            let found = holding(&tree, place);
            prop_assert!(found.windows(2).all(|w| w[0] < w[1]), "{found:?}");
            for (i, b) in (0..).zip(&boxes) {
                let inside = b.min.cmple(place).all() && b.max.cmpge(place).all();
                prop_assert!(!inside || found.contains(&i), "{i} {b:?}");
            }
            // No more nodes than items, but for one.
            prop_assert!(tree.nodes().len() <= boxes.len().max(1));
        }
    }

    #[test]
    fn a_tree_over_nothing_is_empty() {
        for boxes in [vec![], vec![Aabb::EMPTY; 9]] {
            let tree = Bvh::new(&boxes);
            assert!(tree.is_empty());
            assert!(visited(&tree, DVec3::ZERO, DVec3::X, [f64::NEG_INFINITY, f64::INFINITY]).is_empty());
        }
    }

    #[test]
    fn boxes_in_one_place_are_all_found() {
        let boxes = vec![Aabb::new(DVec3::ONE, DVec3::ONE); 1000];
        let tree = Bvh::new(&boxes);
        assert_eq!(visited(&tree, DVec3::ZERO, DVec3::ONE, [0.0, 2.0]).len(), 1000);
        assert!(visited(&tree, DVec3::ZERO, -DVec3::ONE, [0.0, 2.0]).is_empty());
        assert_eq!(holding(&tree, DVec3::ONE).len(), 1000);
    }

    #[test]
    fn few_of_many_boxes_are_visited() {
        let n = 24;
        let at = |i: usize| DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64);
        let boxes: Vec<_> = (0..n * n * n).map(|i| Aabb::new(at(i), at(i) + 1.0)).collect();
        let tree = Bvh::new(&boxes);
        let found = visited(&tree, DVec3::new(-9.0, 3.3, 5.4), DVec3::X, [0.0, f64::INFINITY]);
        assert!((n..=8 * n).contains(&found.len()), "{}", found.len());
        let near = visited(&tree, DVec3::new(-9.0, 3.3, 5.4), DVec3::X, [12.1, 12.2]);
        assert!((1..=16).contains(&near.len()), "{}", near.len());
    }
}
