//! A tree of boxes as rows, which a shader goes through without a stack: nodes lie depth first, and each knows
//! which to go on with where it is missed.

use volact_core::{Aabb, bvh::Bvh, glam::DVec3};

use super::Row;

/// Rows of a mesh's head.
pub const HEAD: u32 = 2;

/// The box around places.
pub fn around(places: &[[f32; 3]]) -> Aabb {
    places.iter().fold(Aabb::EMPTY, |all, p| {
        let p = DVec3::from(p.map(f64::from));
        all.union(&Aabb::new(p, p))
    })
}

/// Two rows a node: lowest corner and the node to go on with, highest corner and leaf, which is 8 times the
/// place of its first item and the number of its items.
pub fn rows(tree: &Bvh) -> Vec<Row> {
    let mut rows = Vec::new();
    for node in tree.nodes() {
        let corner = |p: DVec3, outward: fn(f32) -> f32| p.to_array().map(|v| outward(v as f32));
        rows.push(row(corner(node.bounds.min, f32::next_down), node.skip as u32));
        let leaf = 8 * node.items.start + node.items.len();
        rows.push(row(corner(node.bounds.max, f32::next_up), leaf as u32));
    }
    rows
}

/// A head with room for more, and behind it triangles under their tree, and places.
pub fn triangles(faces: &[[u32; 3]], places: &[[f32; 3]]) -> Vec<Row> {
    let around = |face: &[u32; 3]| around(&face.map(|v| places[v as usize]));
    let tree = Bvh::new(&faces.iter().map(around).collect::<Vec<_>>());
    let mut all = vec![[0; 4]; HEAD as usize];
    let nodes = rows(&tree);
    let first_face = HEAD + nodes.len() as u32;
    let first_place = first_face + tree.items().len() as u32;
    all[0] = [nodes.len() as u32 / 2, HEAD, first_face, first_place];
    all.extend(nodes);
    all.extend(tree.items().iter().map(|&f| faces[f as usize]).map(|[a, b, c]| [a, b, c, 0]));
    all.extend(places.iter().map(|p| row(*p, 0)));
    all
}

/// A place and a word.
pub fn row([x, y, z]: [f32; 3], w: u32) -> Row {
    [x.to_bits(), y.to_bits(), z.to_bits(), w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// As meshes.wgsl goes through them.
        #[test]
        fn every_triangle_around_a_place_is_visited_once(
            faces in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1.0..1.0f32)), 0..60),
            place in prop::array::uniform3(-1.0..1.0f32),
        ) {
            let places: Vec<_> = faces.iter().flatten().copied().collect();
            let numbers: Vec<_> = (0..faces.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let rows = triangles(&numbers, &places);
            let [nodes, first, first_face, first_place] = rows[0];
            prop_assert_eq!(rows.len(), first_place as usize + places.len());
            let (mut at, mut found) = (0, Vec::new());
            while at < nodes {
                let [low, high] = [0, 1].map(|i| rows[(first + 2 * at + i) as usize]);
                let inside = |a: usize| f32::from_bits(low[a]) <= place[a] && place[a] <= f32::from_bits(high[a]);
                if !(0..3).all(inside) {
                    at = low[3];
                    continue;
                }
                found.extend((high[3] / 8..high[3] / 8 + high[3] % 8).map(|i| rows[(first_face + i) as usize]));
                at += 1;
            }
            found.sort_unstable();
            prop_assert!(found.windows(2).all(|w| w[0] < w[1]), "{found:?}");
            for ([a, b, c], corners) in numbers.into_iter().zip(&faces) {
                let held = around(corners);
                let place = DVec3::from(place.map(f64::from));
                let inside = held.min.cmple(place).all() && held.max.cmpge(place).all();
                prop_assert!(!inside || found.contains(&[a, b, c, 0]), "{corners:?}");
            }
        }
    }
}
