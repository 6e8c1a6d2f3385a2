//! Which shape lies before which, and which overlap.
//!
//! Shapes that do not overlap have a true order in each slab that both reach into: bricks of a
//! volume come as they lie. Shapes that do overlap have none, and alternate.

use glam::{DAffine3, DVec3};

use crate::Aabb;

/// Up to so many shapes, every pair is looked at; beyond, the distance of their middles orders
/// them, which is true of bricks of one grid.
const MOST_PAIRED: usize = 1024;

/// Where the eye is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sight {
    Eye(DVec3),
    Along(DVec3),
}

/// How two boxes lie to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    Before,
    Behind,
    /// No ray meets both.
    Apart,
    Overlap,
}

/// A box in the world, its axes at any angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Solidly {
    corners: [DVec3; 8],
    edges: [DVec3; 3],
    center: DVec3,
}

impl Solidly {
    pub fn new(bounds: Aabb, transform: &DAffine3) -> Self {
        let corners = bounds.corners().map(|c| transform.transform_point3(c));
        let edges = [1, 2, 4].map(|i| corners[i] - corners[0]);
        Self { corners, edges, center: corners[0].midpoint(corners[7]) }
    }

    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// The world box around it.
    pub fn around(&self) -> Aabb {
        self.corners.iter().fold(Aabb::EMPTY, |b, &c| Aabb { min: b.min.min(c), max: b.max.max(c) })
    }

    fn extent(&self, axis: DVec3) -> [f64; 2] {
        let along = self.corners.iter().map(|c| axis.dot(*c));
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
    }

    /// How it lies to another, by planes between them (S. Gottschalk et al., *OBBTree*, 1996).
    pub fn relation(&self, other: &Self, sight: Sight) -> Relation {
        let [a, b, c] = self.edges;
        let [d, e, f] = other.edges;
        let faces = [a.cross(b), b.cross(c), c.cross(a), d.cross(e), e.cross(f), f.cross(d)];
        let edges = self.edges.iter().flat_map(|u| other.edges.map(|v| u.cross(v)));
        let mut apart = false;
        for axis in faces.into_iter().chain(edges).filter_map(DVec3::try_normalize) {
            let (own, others) = (self.extent(axis), other.extent(axis));
            // Bricks that meet may overlap by rounding.
            let slack = 1e-9 * (own[1] - own[0]).min(others[1] - others[0]);
            let (low, between) = if own[1] <= others[0] + slack {
                (true, own[1].midpoint(others[0]))
            } else if others[1] <= own[0] + slack {
                (false, others[1].midpoint(own[0]))
            } else {
                continue;
            };
            apart = true;
            let side = match sight {
                Sight::Eye(eye) => between - axis.dot(eye),
                Sight::Along(direction) => axis.dot(direction),
            };
            if side != 0.0 {
                return if (side > 0.0) == low { Relation::Before } else { Relation::Behind };
            }
        }
        if apart { Relation::Apart } else { Relation::Overlap }
    }
}

/// The order of shapes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Depths {
    /// The places of shapes from front to back, twice: where there is no true order, the first goes by
    /// rising identity and the second by falling.
    pub ranks: [Vec<usize>; 2],
    /// Shapes in groups from front to back, of which each lies wholly before the next: in a group they
    /// overlap, or hide one another in a circle.
    pub groups: Vec<Vec<usize>>,
}

impl Depths {
    /// The order of boxes with these identities.
    pub fn new(boxes: &[Solidly], ids: &[u64], sight: Sight) -> Self {
        let n = boxes.len();
        if n > MOST_PAIRED {
            let distance = |i: &usize| match sight {
                Sight::Eye(eye) => boxes[*i].center.distance(eye),
                Sight::Along(direction) => boxes[*i].center.dot(direction),
            };
            let mut order: Vec<usize> = (0..n).collect();
            order.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(ids[*a].cmp(&ids[*b])));
            let ranks = places(&order);
            return Self { ranks: [ranks.clone(), ranks], groups: order.into_iter().map(|i| vec![i]).collect() };
        }
        let mut behind: Vec<Vec<usize>> = vec![Vec::new(); n];
        let mut before = vec![0usize; n];
        let mut together = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                let (front, back) = match boxes[i].relation(&boxes[j], sight) {
                    Relation::Before => (i, j),
                    Relation::Behind => (j, i),
                    Relation::Overlap => {
                        together.push([i, j]);
                        continue;
                    }
                    Relation::Apart => continue,
                };
                behind[front].push(back);
                before[back] += 1;
            }
        }
        let ranks = [false, true].map(|falling| places(&sorted(&behind, before.clone(), ids, falling)));
        for [i, j] in together {
            behind[i].push(j);
            behind[j].push(i);
        }
        Self { ranks, groups: circles(&behind, ids) }
    }
}

/// The strongly connected components of a graph, in topological order (S. R. Kosaraju, after M. Sharir,
/// *A strong-connectivity algorithm and its applications in data flow analysis*, 1981).
fn circles(behind: &[Vec<usize>], ids: &[u64]) -> Vec<Vec<usize>> {
    let n = behind.len();
    let mut before = vec![Vec::new(); n];
    (0..n).for_each(|i| behind[i].iter().for_each(|j| before[*j].push(i)));
    let mut starts: Vec<usize> = (0..n).collect();
    starts.sort_by_key(|i| std::cmp::Reverse(ids[*i]));
    let mut seen = vec![false; n];
    let mut left = Vec::new();
    starts.into_iter().for_each(|i| walk(i, behind, &mut seen, &mut left));
    seen.fill(false);
    let mut groups = Vec::new();
    for i in left.into_iter().rev() {
        let mut group = Vec::new();
        walk(i, &before, &mut seen, &mut group);
        group.sort_unstable();
        groups.extend((!group.is_empty()).then_some(group));
    }
    groups
}

/// Goes through all that is reached from a place and was not seen, and tells of places as they are left.
fn walk(from: usize, next: &[Vec<usize>], seen: &mut [bool], left: &mut Vec<usize>) {
    if std::mem::replace(&mut seen[from], true) {
        return;
    }
    let mut path = vec![(from, 0)];
    while let Some((at, taken)) = path.last_mut() {
        match next[*at].get(*taken) {
            Some(&to) => {
                *taken += 1;
                if !std::mem::replace(&mut seen[to], true) {
                    path.push((to, 0));
                }
            }
            None => {
                left.push(*at);
                path.pop();
            }
        }
    }
}

/// A topological order; within a cycle by identity.
fn sorted(behind: &[Vec<usize>], mut before: Vec<usize>, ids: &[u64], falling: bool) -> Vec<usize> {
    let mut left: Vec<usize> = (0..before.len()).collect();
    left.sort_by_key(|i| if falling { u64::MAX - ids[*i] } else { ids[*i] });
    let mut order = Vec::with_capacity(left.len());
    while !left.is_empty() {
        let at = left.iter().position(|i| before[*i] == 0).unwrap_or(0);
        let chosen = left.remove(at);
        behind[chosen].iter().for_each(|i| before[*i] = before[*i].saturating_sub(1));
        order.push(chosen);
    }
    order
}

fn places(order: &[usize]) -> Vec<usize> {
    let mut ranks = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, i)| ranks[*i] = place);
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit_at(x: f64, y: f64, z: f64) -> Solidly {
        let low = DVec3::new(x, y, z);
        Solidly::new(Aabb::new(low, low + 1.0), &DAffine3::IDENTITY)
    }

    #[test]
    fn bricks_come_as_they_lie_whatever_their_identity() {
        let boxes = [unit_at(0.0, 2.0, 0.0), unit_at(0.0, 0.0, 0.0), unit_at(0.0, 1.0, 0.0)];
        let sight = Sight::Eye(DVec3::new(0.5, -5.0, 0.5));
        for ids in [[1, 2, 3], [3, 2, 1], [2, 3, 1]] {
            let made = Depths::new(&boxes, &ids, sight);
            assert_eq!(made.ranks, [vec![2, 0, 1], vec![2, 0, 1]]);
            assert_eq!(made.groups, [vec![1], vec![2], vec![0]]);
        }
        let back = Depths::new(&boxes, &[1, 2, 3], Sight::Along(DVec3::NEG_Y));
        assert_eq!(back.ranks[0], [0, 2, 1]);
    }

    #[test]
    fn overlapping_shapes_alternate() {
        let boxes = [unit_at(0.0, 0.0, 0.0), unit_at(0.5, 0.5, 0.5), unit_at(0.0, 4.0, 0.0)];
        let made = Depths::new(&boxes, &[7, 3, 1], Sight::Along(DVec3::Y));
        assert_eq!(made.ranks, [vec![1, 0, 2], vec![0, 1, 2]]);
        assert_eq!(made.groups, [vec![0, 1], vec![2]]);
    }

    /// Three bars, each over the next: seen from above none is the first.
    #[test]
    fn shapes_that_hide_one_another_in_a_circle_are_a_group() {
        let bar = |turn: f64| {
            let place = DAffine3::from_rotation_z(turn) * DAffine3::from_translation(DVec3::X);
            Solidly::new(
                Aabb::new(DVec3::new(-0.2, -9.0, -0.1), DVec3::new(0.2, 9.0, 0.1)),
                &(place * DAffine3::from_rotation_x(0.1)),
            )
        };
        let turn = std::f64::consts::TAU / 3.0;
        let boxes = [bar(0.0), bar(turn), bar(2.0 * turn), unit_at(0.0, 0.0, -9.0)];
        let made = Depths::new(&boxes, &[4, 3, 2, 1], Sight::Along(DVec3::NEG_Z));
        assert_eq!(made.groups, [vec![0, 1, 2], vec![3]]);
    }

    #[test]
    fn boxes_crossed_at_their_edges_are_apart() {
        let turned = DAffine3::from_translation(DVec3::new(0.0, 0.0, 1.42)) * DAffine3::from_rotation_x(0.7);
        let long = Aabb::new(DVec3::new(-9.0, -0.5, -0.5), DVec3::new(9.0, 0.5, 0.5));
        let other = DAffine3::from_rotation_z(1.2) * DAffine3::from_rotation_x(0.7);
        let [a, b] = [turned, other].map(|t| Solidly::new(long, &t));
        assert_ne!(a.relation(&b, Sight::Along(DVec3::Z)), Relation::Overlap);
        assert_eq!(a.relation(&b, Sight::Along(DVec3::Z)), Relation::Behind);
        assert_eq!(b.relation(&a, Sight::Along(DVec3::Z)), Relation::Before);
    }

    proptest! {
        /// A ray through two boxes of a grid meets them in the order found.
        #[test]
        fn rays_meet_bricks_in_their_order(
            eye in prop::array::uniform3(-6.0..9.0f64), towards in prop::array::uniform3(0.0..3.0f64), many in any::<bool>(),
        ) {
            let boxes: Vec<Solidly> = (0..27).map(|i| unit_at(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9))).collect();
            let ids: Vec<u64> = (0..27).map(|i| (i * 11) % 27).collect();
            let eye = DVec3::from(eye);
            let direction = DVec3::from(towards) - eye;
            let sight = if many { Sight::Eye(eye) } else { Sight::Along(direction) };
            let Depths { ranks: [ranks, _], groups } = Depths::new(&boxes, &ids, sight);
            prop_assert!(groups.len() == 27 && groups.iter().all(|g| g.len() == 1));
            let met = |i: i32| {
                let low = DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9));
                Aabb::new(low, low + 1.0).clip_line(eye, direction).filter(|t| t[1] - t[0] > 1e-6 && t[0] >= 0.0)
            };
            let mut along: Vec<(f64, usize)> = (0..27).filter_map(|i| Some((met(i)?[0], ranks[i as usize]))).collect();
            along.sort_by(|a, b| a.0.total_cmp(&b.0));
            prop_assert!(along.is_sorted_by_key(|m| m.1), "{along:?}");
        }
    }
}
