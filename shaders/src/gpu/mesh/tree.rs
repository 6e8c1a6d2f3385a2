//! A tree of boxes that is gone through without a stack: nodes lie depth first, and each knows which to go
//! on with where it is missed.

use super::Row;

/// Items of a leaf at most.
const LEAF: usize = 4;

/// An item's box.
#[derive(Clone, Copy, Debug)]
pub struct Seed {
    /// Its number.
    pub item: u32,
    low: [f32; 3],
    high: [f32; 3],
}

impl Seed {
    /// The box around places, of which there is at least one.
    pub fn around(item: u32, places: &[[f32; 3]]) -> Self {
        let start = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let wider =
            |(low, high): ([f32; 3], [f32; 3]), p: &[f32; 3]| (each(low, *p, f32::min), each(high, *p, f32::max));
        let (low, high) = places.iter().fold(start, wider);
        Self { item, low, high }
    }

    /// Twice the middle.
    fn middle(&self, axis: usize) -> f32 {
        self.low[axis] + self.high[axis]
    }
}

fn each(a: [f32; 3], b: [f32; 3], choose: fn(f32, f32) -> f32) -> [f32; 3] {
    [0, 1, 2].map(|i| choose(a[i], b[i]))
}

/// A box with those inside of it behind it.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// The node to go on with where this one is missed.
    skip: u32,
    /// 8 times the first item and the number of items of a leaf, else 0.
    leaf: u32,
}

/// Items are halved at the median of their middles along the longest axis.
#[derive(Debug, Default)]
pub struct Tree(Vec<Node>);

impl Tree {
    /// The tree over boxes, which it puts in the order of its leaves.
    pub fn new(seeds: &mut [Seed]) -> Self {
        let mut made = Self::default();
        made.build(seeds, 0);
        made
    }

    /// The number of nodes.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Two rows a node: lowest corner and the node to go on with, highest corner and leaf.
    pub fn rows(&self) -> Vec<Row> {
        let row = |[x, y, z]: [f32; 3], w| [x.to_bits(), y.to_bits(), z.to_bits(), w];
        self.0.iter().flat_map(|n| [row(n.low, n.skip), row(n.high, n.leaf)]).collect()
    }

    /// Adds the nodes over seeds, of which the first has that place in the order.
    fn build(&mut self, seeds: &mut [Seed], first: usize) {
        let Some(one) = seeds.first() else { return };
        let whole = (one.low, one.high);
        let (low, high) = seeds.iter().fold(whole, |(l, h), s| (each(l, s.low, f32::min), each(h, s.high, f32::max)));
        let at = self.0.len();
        self.0.push(Node { low, high, skip: 0, leaf: 0 });
        if seeds.len() <= LEAF {
            self.0[at].leaf = (8 * first + seeds.len()) as u32;
        } else {
            let axis = longest(seeds);
            let half = seeds.len() / 2;
            seeds.select_nth_unstable_by(half, |a, b| a.middle(axis).total_cmp(&b.middle(axis)));
            let (left, right) = seeds.split_at_mut(half);
            self.build(left, first);
            self.build(right, first + half);
        }
        self.0[at].skip = self.0.len() as u32;
    }
}

/// The axis along which the middles are farthest apart.
fn longest(seeds: &[Seed]) -> usize {
    let extent = |a: usize| {
        let start = (f32::INFINITY, f32::NEG_INFINITY);
        let (low, high) = seeds.iter().fold(start, |(l, h), s| (l.min(s.middle(a)), h.max(s.middle(a))));
        high - low
    };
    (0..3).max_by(|a, b| extent(*a).total_cmp(&extent(*b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What a shader visits: items of leaves all of whose boxes hold a place.
    fn visited(tree: &Tree, seeds: &[Seed], place: [f32; 3]) -> Vec<u32> {
        let (mut found, mut at) = (Vec::new(), 0);
        while at < tree.len() {
            let node = tree.0[at];
            if (0..3).any(|a| place[a] < node.low[a] || place[a] > node.high[a]) {
                at = node.skip as usize;
                continue;
            }
            let first = (node.leaf / 8) as usize;
            found.extend(seeds[first..first + (node.leaf % 8) as usize].iter().map(|s| s.item));
            at += 1;
        }
        found
    }

    proptest! {
        #[test]
        fn every_box_that_holds_a_place_is_visited_once(
            boxes in prop::collection::vec([prop::array::uniform3(-9.0..9.0f32), prop::array::uniform3(-9.0..9.0f32)], 0..90),
            place in prop::array::uniform3(-9.0..9.0f32),
        ) {
            let mut seeds: Vec<_> = (0..).zip(&boxes).map(|(i, places)| Seed::around(i, places)).collect();
            let tree = Tree::new(&mut seeds);
            let mut found = visited(&tree, &seeds, place);
            found.sort_unstable();
            prop_assert!(found.windows(2).all(|w| w[0] < w[1]), "{found:?}");
            for seed in &seeds {
                let inside = (0..3).all(|a| seed.low[a] <= place[a] && place[a] <= seed.high[a]);
                prop_assert!(!inside || found.contains(&seed.item), "{seed:?}");
            }
            // No more nodes than items, but for one.
            prop_assert!(tree.len() <= seeds.len().max(1));
        }
    }

    #[test]
    fn boxes_in_one_place_are_all_found() {
        let mut seeds: Vec<_> = (0..1000).map(|i| Seed::around(i, &[[0.5; 3]])).collect();
        let tree = Tree::new(&mut seeds);
        assert_eq!(visited(&tree, &seeds, [0.5; 3]).len(), 1000);
    }
}
