//! Clips: planes, crop boxes and convex regions, kept or cut away.

use proptest::prelude::*;
use volact_core::{
    Aabb, Appearance, Block, Clip, FrameDesc, LookupTable, Plane, Shape, View, Volume, VolumeTexture,
    geometry::ClipRegion,
    glam::{DAffine3, DMat3, DVec3},
};
use volact_cpu::reference::{Method, ReferenceOptions, ReferencePicture, integrate};

use super::common::{along_z, certify, lut, one_ray, picture, point, resolve, table, volume_of};

const ORANGE: [f64; 3] = [1.0, 0.5, 0.0];

/// A slab of 4³ that lets q = 1 − 0.3 through a unit of length.
fn slab() -> Shape {
    lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, ORANGE, 0.3)]), 1.0)
}

fn through(length: f64) -> [f64; 4] {
    let a = 1.0 - 0.7f64.powf(length);
    [a * ORANGE[0], a * ORANGE[1], a * ORANGE[2], a]
}

fn plane(at: [f64; 3], normal: [f64; 3]) -> ClipRegion {
    ClipRegion::plane(Plane::new(DVec3::from(at), DVec3::from(normal)).unwrap())
}

fn crop(min: [f64; 3], max: [f64; 3]) -> ClipRegion {
    ClipRegion::crop(Aabb::new(DVec3::from(min), DVec3::from(max)))
}

fn clipped(shape: &Shape, clip: Clip) -> Shape {
    let made = shape.named("clipped");
    made.set_clip(clip);
    made
}

fn hills(seed: f64) -> Volume {
    volume_of([5, 4, 6], |[x, y, z]| 0.5 + 0.5 * (seed + 1.3 * x as f64 + 2.1 * y as f64 + 0.7 * (z * z) as f64).sin())
}

fn layers() -> LookupTable {
    table(&[
        point(0.1, [0.0, 0.2, 0.9], 0.0),
        point(0.3, [0.9, 0.2, 0.1], 0.6),
        point(0.5, [0.2, 0.8, 0.3], 0.05),
        point(0.9, [0.7, 0.7, 0.2], 0.999),
    ])
}

/// Both enclose the same truth, and narrowly.
#[track_caller]
fn agree(a: &ReferencePicture, b: &ReferencePicture) {
    assert_eq!((a.not_certified, b.not_certified), (0, 0), "widest {:e} {:e}", a.widest, b.widest);
    for i in 0..a.color.len() {
        for c in 0..4 {
            let apart = (a.color[i][c] - b.color[i][c]).abs();
            let reach = 0.5 * (a.upper[i][c] - a.lower[i][c] + b.upper[i][c] - b.lower[i][c]);
            assert!(apart <= reach + 1e-13, "pixel {i}, channel {c}: {:?} {:?}", a.color[i], b.color[i]);
        }
    }
}

fn view(shape: &Shape) -> FrameDesc {
    FrameDesc::fit(shape, View::Iso, 12, 10)
}

#[test]
fn plane_leaves_the_half_in_front_of_it() {
    for (normal, length) in [([0.0, 0.0, 1.0], 2.5), ([0.0, 0.0, -2.0], 1.5)] {
        certify(
            &[clipped(&slab(), Clip::NONE.with(plane([9.0, 0.0, 1.5], normal)))],
            &along_z(0.3, 0.4),
            through(length),
        );
    }
    // At 45 degrees through (2, ·, 2): where x is 0.3, z is 3.7 and the front above it.
    let oblique = clipped(&slab(), Clip::NONE.with(plane([2.0, 0.0, 2.0], [1.0, 0.0, 1.0])));
    certify(&[oblique], &along_z(0.3, 0.4), through(0.3));
}

#[test]
fn crop_box_is_kept_or_cut() {
    let inner = || crop([-1.0, 0.2, 1.0], [3.0, 3.0, 3.25]);
    let ray = along_z(0.3, 0.4);
    certify(&[clipped(&slab(), Clip::NONE.with(inner()))], &ray, through(2.25));
    certify(&[clipped(&slab(), Clip::NONE.with(inner().cut()))], &ray, through(1.75));
    // Beside it nothing is kept, and nothing cut.
    let beside = along_z(0.3, 0.1);
    certify(&[clipped(&slab(), Clip::NONE.with(inner()))], &beside, [0.0; 4]);
    certify(&[clipped(&slab(), Clip::NONE.with(inner().cut()))], &beside, through(4.0));
}

#[test]
fn many_regions_leave_many_stretches() {
    // Nine slots of 0.1 across the ray.
    let slots = (0..9).map(|i| {
        let z = 0.2 + 0.4 * f64::from(i);
        crop([-9.0, -9.0, z], [9.0, 9.0, z + 0.1]).cut()
    });
    let clip: Clip = slots.collect();
    certify(&[clipped(&slab(), clip)], &along_z(0.3, 0.4), through(3.1));
}

/// A face's value decides what is seen first: the colour must be that of the cut, not of the face.
#[test]
fn cut_shows_what_is_inside() {
    let ramp = volume_of([2, 2, 5], |[_, _, z]| z as f64 / 4.0);
    let shape = lut(&ramp, table(&[point(0.0, [0.0; 3], 1.0), point(1.0, [1.0; 3], 1.0)]), 1.0);
    let cut = clipped(&shape, Clip::NONE.with(plane([0.0, 0.0, 2.5], [0.0, 0.0, 1.0])));
    certify(&[cut], &along_z(0.3, 0.4), [0.625, 0.625, 0.625, 1.0]);
}

#[test]
fn edges_and_planes_that_the_ray_only_touches_are_settled() {
    let ray = along_z(0.3, 0.4);
    // In the plane: kept. Behind it by an ulp: gone.
    certify(&[clipped(&slab(), Clip::NONE.with(plane([0.0, 0.4, 0.0], [0.0, 1.0, 0.0])))], &ray, through(4.0));
    certify(&[clipped(&slab(), Clip::NONE.with(plane([0.0, 0.4f64.next_up(), 0.0], [0.0, 1.0, 0.0])))], &ray, [0.0; 4]);
    // A roof whose ridge the ray crosses in a point.
    let roof = ClipRegion::planes(
        [[0.0, 1.0, 1.0], [0.0, 1.0, -1.0]].map(|n| Plane::new(DVec3::new(0.0, 0.4, 2.0), DVec3::from(n)).unwrap()),
    );
    let kept = picture(&[clipped(&slab(), Clip::NONE.with(roof.clone()))], &ray);
    assert!(kept.upper[0][3] < 1e-12, "{:?}", kept.upper[0]);
    let cut = picture(&[clipped(&slab(), Clip::NONE.with(roof.cut()))], &ray);
    assert!((cut.color[0][3] - through(4.0)[3]).abs() < 1e-12 && cut.not_certified == 0);
}

/// An opaque shape that is met along less than rounding can tell is not certified.
#[test]
fn what_rounding_decides_is_counted() {
    let opaque = lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, ORANGE, 1.0)]), 1.0);
    let sliver = crop([-9.0, -9.0, 1.0], [9.0, 9.0, 1.0 + 4e-16]);
    let made = picture(&[clipped(&opaque, Clip::NONE.with(sliver.clone()))], &along_z(0.3, 0.4));
    assert_eq!((made.not_certified, made.lower[0], made.upper[0][3]), (1, [0.0; 4], 1.0));
    // What is not opaque shows next to nothing along it, and that is certain.
    let thin = picture(&[clipped(&slab(), Clip::NONE.with(sliver))], &along_z(0.3, 0.4));
    assert_eq!(thin.not_certified, 0);
    assert!(thin.upper[0][3] < 1e-13);
}

/// The planes of a dodecahedron around the ball of radius 1.5 in the middle of the slab.
fn dodecahedron() -> Vec<Plane> {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let center = DVec3::splat(2.0);
    let mut normals = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        normals.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]].map(DVec3::from));
    }
    normals.into_iter().map(|n| Plane::new(center - 1.5 * n.normalize(), n).unwrap()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn twelve_planes_leave_the_chord_of_their_polytope(
        from in prop::array::uniform3(-5.0..9.0f64),
        to in prop::array::uniform3(0.5..3.5f64),
    ) {
        let (from, to) = (DVec3::from(from), DVec3::from(to));
        prop_assume!((to - from).length() > 1.0);
        let shape = clipped(&slab(), Clip::NONE.with(ClipRegion::planes(dodecahedron())));
        let frame = one_ray(from, to);
        let ray = frame.camera.rays(&frame.viewport()).unwrap().ray(0.5, 0.5);
        // The chord by the definition, in f64.
        let (mut enter, mut leave) = (ray.near, f64::INFINITY);
        for plane in dodecahedron() {
            let (d, slope) = (plane.distance(ray.origin), plane.normal().dot(ray.direction));
            if slope > 0.0 { enter = enter.max(-d / slope) } else { leave = leave.min(-d / slope) }
        }
        let (kept, whole) = ((leave - enter).max(0.0), picture(&[slab()], &frame));
        let made = picture(&[shape], &frame);
        prop_assert_eq!(made.not_certified, 0);
        prop_assert!((made.color[0][3] - through(kept)[3]).abs() < 1e-12, "{} {:?}", kept, made.color[0]);
        // Cut away, it is missing from the whole.
        let rest = picture(&[clipped(&slab(), Clip::NONE.with(ClipRegion::planes(dodecahedron()).cut()))], &frame);
        let missing = (1.0 - whole.color[0][3]) / (1.0 - through(kept)[3]);
        prop_assert!((1.0 - rest.color[0][3] - missing).abs() < 1e-12);
    }

    /// Mirrored, sheared and nested: a crop box in object space is the block of that box.
    #[test]
    fn crop_box_is_the_block_of_that_box(
        columns in prop::array::uniform9(-1.5..1.5f64),
        turn in -3.0..3.0f64,
        min in prop::array::uniform3(0.0..1.5f64),
        size in prop::array::uniform3(0.5..2.5f64),
    ) {
        let matrix = DMat3::from_cols_array(&columns);
        prop_assume!(matrix.determinant().abs() > 0.2);
        let nested = DAffine3::from_mat3(matrix)
            * DAffine3::from_rotation_x(turn)
            * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 2.0))
            * DAffine3::from_translation(DVec3::new(0.3, -4.0, 1.0));
        let bounds = Aabb::new(DVec3::from(min), DVec3::from(min) + DVec3::from(size));
        let whole = lut(&hills(1.0), layers(), 0.8);
        whole.set_transform(nested);
        let block = whole.named("block");
        block.set_geometry(Block::from(bounds));
        let cropped = clipped(&whole, Clip::NONE.with(ClipRegion::crop(bounds)));
        let frame = view(&block);
        agree(&picture(&[cropped], &frame), &picture(&[block], &frame));
    }
}

#[test]
fn scene_clip_is_the_shape_clip_through_its_transform() {
    let shape = lut(&hills(2.0), layers(), 0.8);
    shape.set_transform(
        DAffine3::from_mat3(DMat3::from_cols_array(&[1.0, 0.2, 0.0, -0.4, 1.1, 0.3, 0.0, 0.5, -0.9]))
            * DAffine3::from_translation(DVec3::new(3.0, -2.0, 1.0)),
    );
    let clip =
        Clip::NONE.with(plane([2.0, 1.0, 2.0], [0.3, -0.5, 1.0])).with(crop([1.0, 0.5, 1.0], [3.0, 2.0, 2.5]).cut());
    let frame = view(&shape);
    let world = clip.transformed(&shape.state().transform);
    let by_scene = picture(std::slice::from_ref(&shape), &frame.clone().with_clip(world));
    assert!(by_scene.color.iter().filter(|c| c[3] > 0.1).count() > 10);
    agree(&picture(&[clipped(&shape, clip)], &frame), &by_scene);
}

#[test]
fn shape_and_its_complement_are_the_shape() {
    let whole = lut(&hills(3.0), layers(), 0.8);
    let region = || {
        ClipRegion::planes([
            Plane::new(DVec3::new(1.0, 1.0, 1.0), DVec3::new(1.0, 0.3, -0.2)).unwrap(),
            Plane::new(DVec3::new(3.0, 2.0, 4.0), DVec3::new(-0.4, 0.3, -1.0)).unwrap(),
        ])
    };
    let parts = [clipped(&whole, Clip::NONE.with(region())), clipped(&whole, Clip::NONE.with(region().cut()))];
    let frame = view(&whole);
    agree(&picture(&parts, &frame), &picture(&[whole], &frame));
}

/// The clip of one shape does not cut another; the scene's cuts both.
#[test]
fn coincident_blocks_keep_their_own_clips() {
    let green = lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, [0.0, 1.0, 0.0], 1.0)]), 1.0);
    let half = clipped(&slab(), Clip::NONE.with(plane([0.0, 0.0, 2.0], [0.0, 0.0, -1.0])));
    let rest = clipped(&green, Clip::NONE.with(plane([0.0, 0.0, 2.0], [0.0, 0.0, 1.0])));
    let a = 1.0 - 0.7f64.powi(2);
    certify(&[half.clone(), rest.clone()], &along_z(0.3, 0.4), [a, 0.5 * a + 1.0 - a, 0.0, 1.0]);
    let near = Clip::NONE.with(plane([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]));
    certify(&[rest, half], &along_z(0.3, 0.4).with_clip(near), [0.3, 0.15 + 0.7, 0.0, 1.0]);
}

#[test]
fn pictures_of_one_value_see_what_is_left() {
    let ramp = volume_of([2, 2, 5], |[_, _, z]| z as f64);
    let grey = || table(&[point(0.0, [0.0; 3], 0.5), point(4.0, [1.0; 3], 0.5)]);
    let clip =
        Clip::NONE.with(plane([0.0, 0.0, 3.5], [0.0, 0.0, -1.0])).with(crop([-1.0, -1.0, 1.0], [2.0, 2.0, 2.0]).cut());
    // What is left of 0 to 4 is 0 to 1 and 2 to 3.5: ∫ z dz = 0.5 + 4.125 over a length of 2.5.
    for (shader, value) in [("mip", 3.5), ("minip", 0.0), ("average", 4.625 / 2.5), ("xray", 4.625 / 4.0)] {
        let texture = VolumeTexture::new(&ramp);
        let look = Appearance::new(shader).with("lookup_table", grey()).with("unit_distance", 4.0);
        let shape = clipped(&Shape::around_texture(&texture, look), clip.clone());
        let level = 0.5 * value / 4.0;
        certify(&[shape], &along_z(0.3, 0.4), [level, level, level, 0.5]);
    }
}

/// The lattice's segments are cut at all ends, and stay of second order.
#[test]
fn clipped_lattice_converges_with_the_square_of_the_step() {
    let data = volume_of([5, 5, 9], |[x, y, z]| 0.5 + 0.3 * (0.9 * x as f64 + 0.7 * y as f64 + 0.8 * z as f64).sin());
    let shape = lut(&data, table(&[point(0.0, [0.1, 0.4, 0.9], 0.02), point(1.0, [0.9, 0.5, 0.1], 0.7)]), 1.0);
    shape.set_clip(Clip::NONE.with(crop([1.1, 0.7, 2.3], [3.3, 3.1, 6.2]).cut()));
    let frame = view(&shape);
    let exact = picture(std::slice::from_ref(&shape), &frame);
    assert_eq!(exact.not_certified, 0);
    for method in [Method::Rays, Method::Planes] {
        let error = |step: f64| {
            let options = ReferenceOptions { method, sample_distance: step, ..ReferenceOptions::default() };
            let made = integrate(&resolve(std::slice::from_ref(&shape)), &frame, &options).unwrap();
            let wrong = made.color.iter().flatten().zip(exact.color.iter().flatten()).map(|(a, b)| (a - b).powi(2));
            wrong.sum::<f64>().sqrt()
        };
        let slope = (error(0.2) / error(0.0125)).log2() / 4.0;
        assert!((1.85..2.2).contains(&slope), "{method:?}: {slope}");
    }
}
