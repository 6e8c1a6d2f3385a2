//! Polygons on sampling surfaces, and how clips cut them.
//!
//! Neighbours stay neighbours to the last bit: a vertex that comes from an edge is computed from the
//! edge's ends in one order, that of their coordinates, whichever polygon asks; and on which side of
//! a plane a vertex lies depends on nothing but the vertex. So an edge that two polygons share is cut
//! alike in both.

use glam::DVec3;

use crate::{
    Clip,
    geometry::{ClipRegion, Plane},
};

/// Numbers of a vertex before its attributes.
const FIXED: usize = 9;

/// A vertex of a polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolygonVertex<'a> {
    /// Where it lies in the world.
    pub position: DVec3,
    /// Where it lies in the shape's object space.
    pub object: DVec3,
    /// Texture coordinates: 0 to 1 over the data ROI of the shape's first volume; by position, unless
    /// the geometry has its own. Without a volume, 0 to 1 over the geometry's bounds.
    pub texture: DVec3,
    /// The numbers of the shape's attributes, one after another.
    pub attributes: &'a [f64],
}

/// One convex polygon of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// The first of its vertices.
    pub first: u32,
    /// How many it has.
    pub count: u32,
    /// The tetrahedron that it lies in, where it was cut from one.
    pub cell: Option<u32>,
    /// The gradient of the level in world space: the normal on planes. In a mesh, shells are flat in
    /// each cell; the length of a ray between them is then `step / |gradient·direction|`.
    pub gradient: DVec3,
}

/// Convex polygons with positions, texture coordinates and attributes; filled again and again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygons {
    attributes: usize,
    numbers: Vec<f64>,
    faces: Vec<Face>,
    ring: Vec<u32>,
    other: Vec<u32>,
}

impl Polygons {
    /// No polygons.
    pub fn new() -> Self {
        Self::default()
    }

    /// The polygons.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The number of vertices of all polygons.
    pub fn vertex_count(&self) -> usize {
        self.numbers.len() / self.stride()
    }

    /// A vertex by its number.
    ///
    /// # Panics
    /// If there is no such vertex.
    pub fn vertex(&self, index: u32) -> PolygonVertex<'_> {
        let at = index as usize * self.stride();
        let numbers = &self.numbers[at..at + self.stride()];
        let vector = |i: usize| DVec3::from_slice(&numbers[3 * i..]);
        PolygonVertex { position: vector(0), object: vector(1), texture: vector(2), attributes: &numbers[FIXED..] }
    }

    /// The vertices of a polygon in order around.
    pub fn vertices(&self, face: &Face) -> impl ExactSizeIterator<Item = PolygonVertex<'_>> + use<'_> {
        (face.first..face.first + face.count).map(|i| self.vertex(i))
    }

    /// A polygon as triangles, by the numbers of their vertices.
    pub fn triangles(&self, face: &Face) -> impl ExactSizeIterator<Item = [u32; 3]> + use<> {
        let first = face.first;
        (1..face.count.max(2) - 1).map(move |i| [first, first + i, first + i + 1])
    }

    /// The area of a polygon in the world.
    pub fn area(&self, face: &Face) -> f64 {
        let at = |i: u32| self.vertex(i).position;
        let twice = |[a, b, c]: [u32; 3]| (at(b) - at(a)).cross(at(c) - at(a));
        self.triangles(face).map(twice).sum::<DVec3>().length() / 2.0
    }

    fn stride(&self) -> usize {
        FIXED + self.attributes
    }

    /// Empties it for vertices with so many numbers of attributes.
    pub(super) fn clear(&mut self, attributes: usize) {
        self.attributes = attributes;
        self.numbers.clear();
        self.faces.clear();
    }

    /// Adds a vertex; `fill` writes its attributes.
    pub(super) fn push_vertex(&mut self, fixed: [DVec3; 3], fill: impl FnOnce(&mut [f64])) {
        self.numbers.extend(fixed.iter().flat_map(DVec3::to_array));
        let at = self.numbers.len();
        self.numbers.resize(at + self.attributes, 0.0);
        fill(&mut self.numbers[at..]);
    }

    /// Makes a polygon of the vertices from `first` on, cut by clips in object and in world space.
    pub(super) fn close(&mut self, first: usize, cell: Option<u32>, gradient: DVec3, clips: &Clips<'_>) {
        let count = self.vertex_count();
        if count < first + 3 {
            self.numbers.truncate(first * self.stride());
            return;
        }
        if clips.is_none() {
            self.faces.push(Face { first: first as u32, count: (count - first) as u32, cell, gradient });
            return;
        }
        let whole: Vec<u32> = (first as u32..count as u32).collect();
        let mut pieces = vec![whole];
        for (region, side) in clips.regions() {
            pieces = pieces.into_iter().flat_map(|ring| self.clip(ring, region, side)).collect();
        }
        self.gather(first, &pieces, cell, gradient);
    }

    /// Writes pieces as polygons of their own, in place of everything from `first` on.
    fn gather(&mut self, first: usize, pieces: &[Vec<u32>], cell: Option<u32>, gradient: DVec3) {
        let stride = self.stride();
        let mut numbers = Vec::with_capacity(pieces.iter().map(Vec::len).sum::<usize>() * stride);
        for ring in pieces {
            let at = first + numbers.len() / stride;
            for &v in ring {
                numbers.extend_from_slice(&self.numbers[v as usize * stride..(v as usize + 1) * stride]);
            }
            self.faces.push(Face { first: at as u32, count: ring.len() as u32, cell, gradient });
        }
        self.numbers.truncate(first * stride);
        self.numbers.append(&mut numbers);
    }

    /// What a region leaves of a ring: one piece of what it keeps, or disjoint pieces around what it
    /// cuts away.
    fn clip(&mut self, ring: Vec<u32>, region: &ClipRegion, space: Space) -> Vec<Vec<u32>> {
        let mut left = Vec::new();
        let mut rest = ring;
        for plane in region.bounding_planes() {
            if !region.keeps_inside() {
                let outside = self.half(&rest, plane, space, false);
                left.extend((outside.len() >= 3).then_some(outside));
            }
            rest = self.half(&rest, plane, space, true);
            if rest.len() < 3 {
                return left;
            }
        }
        if region.keeps_inside() { vec![rest] } else { left }
    }

    /// The part of a ring in front of a plane, or behind it (I. Sutherland, G. Hodgman, *Reentrant
    /// polygon clipping*, 1974).
    fn half(&mut self, ring: &[u32], plane: &Plane, space: Space, front: bool) -> Vec<u32> {
        let side = |polygons: &Self, v: u32| plane.distance(polygons.place(v, space));
        let mut kept = std::mem::take(&mut self.other);
        kept.clear();
        for (i, &a) in ring.iter().enumerate() {
            let b = ring[(i + 1) % ring.len()];
            let (da, db) = (side(self, a), side(self, b));
            if (da >= 0.0) == front {
                kept.push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                kept.push(self.between(a, b, da, db));
            }
        }
        let made = kept.clone();
        self.other = kept;
        made
    }

    fn place(&self, vertex: u32, space: Space) -> DVec3 {
        let v = self.vertex(vertex);
        if space == Space::World { v.position } else { v.object }
    }

    /// A new vertex on an edge where a number that is `fa` at one end and `fb` at the other is 0.
    fn between(&mut self, a: u32, b: u32, fa: f64, fb: f64) -> u32 {
        let swap = precedes(self.vertex(b).object, self.vertex(a).object);
        let ([a, b], [fa, fb]) = if swap { ([b, a], [fb, fa]) } else { ([a, b], [fa, fb]) };
        let (t, stride) = (fa / (fa - fb), self.stride());
        for i in 0..stride {
            let [u, v] = [a, b].map(|v| self.numbers[v as usize * stride + i]);
            self.numbers.push(mix(u, v, t));
        }
        (self.vertex_count() - 1) as u32
    }
}

/// In which space a clip's planes lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    Object,
    World,
}

/// What cuts polygons.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clips<'a> {
    pub object: &'a Clip,
    /// The texture's region.
    pub region: Option<&'a ClipRegion>,
    pub world: &'a Clip,
    /// The near and far planes, where the sampling surfaces do not follow them.
    pub ends: Option<&'a ClipRegion>,
}

impl<'a> Clips<'a> {
    fn is_none(&self) -> bool {
        self.object.is_none() && self.world.is_none() && self.region.is_none() && self.ends.is_none()
    }

    fn regions(&self) -> impl Iterator<Item = (&'a ClipRegion, Space)> + use<'a> {
        let object = self.region.into_iter().chain(self.object.regions()).map(|r| (r, Space::Object));
        object.chain(self.ends.into_iter().chain(self.world.regions()).map(|r| (r, Space::World)))
    }
}

/// The order of an edge's ends, the same for all who share it.
pub(super) fn precedes(a: DVec3, b: DVec3) -> bool {
    let [a, b] = [a, b].map(|p| p.to_array());
    (0..3).find(|&i| a[i] != b[i]).is_some_and(|i| a[i] < b[i])
}

/// Between two numbers; exact at both ends, where the other does not matter.
pub(super) fn mix(a: f64, b: f64, t: f64) -> f64 {
    if t <= 0.0 {
        a
    } else if t >= 1.0 {
        b
    } else {
        a + t * (b - a)
    }
}

/// As [`mix`], for places.
pub(super) fn mix_places(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    DVec3::new(mix(a.x, b.x, t), mix(a.y, b.y, t), mix(a.z, b.z, t))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use proptest::prelude::*;

    fn regular(n: usize, radius: f64, tilt: f64) -> Polygons {
        let mut made = Polygons::new();
        made.clear(1);
        for i in 0..n {
            let a = std::f64::consts::TAU * i as f64 / n as f64;
            let p = DVec3::new(radius * a.cos(), radius * a.sin(), tilt * a.cos());
            made.push_vertex([p; 3], |numbers| numbers[0] = p.x);
        }
        made
    }

    const FREE: Clip = Clip::NONE;

    proptest! {
        #[test]
        fn a_polygon_clipped_to_a_box_gains_six_vertices_at_most(
            n in 3usize..30, radius in 0.1..3.0f64, tilt in -2.0..2.0f64,
            low in prop::array::uniform3(-2.0..1.0f64), size in prop::array::uniform3(0.01..3.0f64),
        ) {
            let mut made = regular(n, radius, tilt);
            let bounds = Aabb::new(DVec3::from(low), DVec3::from(low) + DVec3::from(size));
            let object = Clip::new([ClipRegion::crop(bounds)]);
            made.close(0, None, DVec3::Z, &Clips { object: &object, region: None, world: &FREE, ends: None });
            prop_assert!(made.faces().len() <= 1);
            for face in made.faces() {
                prop_assert!(face.count as usize <= n + 6);
                for v in made.vertices(face) {
                    prop_assert!(v.position.cmpge(bounds.min - 1e-9).all() && v.position.cmple(bounds.max + 1e-9).all());
                    prop_assert!((v.attributes[0] - v.position.x).abs() < 1e-9);
                }
            }
        }

        #[test]
        fn what_is_kept_and_what_is_cut_make_the_whole(
            n in 3usize..12, tilt in -1.0..1.0f64, low in prop::array::uniform3(-1.0..0.5f64), world in any::<bool>(),
        ) {
            let low = DVec3::from(low);
            let region = ClipRegion::crop(Aabb::new(low, low + 0.6));
            let mut areas = [0.0; 3];
            let clips = [FREE, Clip::new([region.clone()]), Clip::new([region.cut()])];
            for (area, clip) in areas.iter_mut().zip(&clips) {
                let mut made = regular(n, 1.0, tilt);
                let (object, world) = if world { (&FREE, clip) } else { (clip, &FREE) };
                made.close(0, Some(3), DVec3::Z, &Clips { object, region: None, world, ends: None });
                *area = made.faces().iter().map(|f| made.area(f)).sum();
                prop_assert!(made.faces().iter().all(|f| f.count >= 3 && f.cell == Some(3)));
            }
            prop_assert!((areas[0] - areas[1] - areas[2]).abs() < 1e-9, "{areas:?}");
        }
    }

    #[test]
    fn an_edge_is_cut_alike_from_both_sides() {
        let plane = Plane::new(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.7, 0.2, 0.5)).unwrap();
        let (a, b) = (DVec3::new(-1.0, 0.3, 0.2), DVec3::new(1.7, -0.9, 1.1));
        let mut made = Polygons::new();
        made.clear(0);
        [a, b].iter().for_each(|p| made.push_vertex([*p; 3], |_| ()));
        let (da, db) = (plane.distance(a), plane.distance(b));
        let there = made.between(0, 1, da, db);
        let back = made.between(1, 0, db, da);
        assert_eq!(made.vertex(there), made.vertex(back));
    }

    #[test]
    fn numbers_at_an_end_do_not_see_the_other() {
        assert_eq!(mix(2.0, f64::NAN, 0.0), 2.0);
        assert_eq!(mix(f64::NAN, 2.0, 1.0), 2.0);
        assert_eq!(mix(2.0, 4.0, 0.5), 3.0);
    }
}
