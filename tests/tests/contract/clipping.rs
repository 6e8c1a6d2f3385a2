//! Clip planes and crop boxes, for a shape and for a scene.

use std::slice::from_ref;

use volact_conformance::{
    meshes::{bent, field},
    metrics::{identical, max_error, outside, within},
    rig::{Setup, truth},
    scene::{along_y, ball, colors, constant, greys, look, lut, square},
};
use volact_core::{
    Aabb, Block, Clip, ClipRegion, FrameDesc, Plane, ScalarType, Shape, Volume, VolumeTexture,
    glam::{DAffine3, DMat3, DVec3},
};

fn actions() -> [(&'static str, Setup, f64); 2] {
    [("reference", Setup::exact(), 6e-8), ("cpu", Setup::post(0.1), 3e-6)]
}

fn plane(point: DVec3, normal: DVec3) -> Plane {
    Plane::new(point, normal).unwrap()
}

fn absorbed(length: f64) -> [[f64; 4]; 1] {
    [[1.0 - 0.6f64.powf(length); 4]]
}

fn slab() -> Shape {
    lut(&constant(1.0, [4, 4, 4]), greys(&[(1.0, 1.0, 0.4)]), 1.0)
}

fn mesh() -> Shape {
    field(bent([4, 3, 5], DVec3::splat(4.0), 0.1), |_| 1.0, greys(&[(1.0, 1.0, 0.4)]), 1.0)
}

#[test]
fn planes_and_boxes_leave_their_lengths() {
    let crop = ClipRegion::crop(Aabb::new(DVec3::new(1.0, 1.5, 0.0), DVec3::new(3.0, 2.75, 4.0)));
    let slope = plane(DVec3::new(2.0, 2.0, 2.0), DVec3::new(1.0, 1.0, 0.0));
    // (x, length) along y at z = 1.3.
    let cases: [(Clip, &[(f64, f64)]); 5] = [
        (Clip::new([ClipRegion::plane(plane(DVec3::Y, DVec3::Y))]), &[(0.5, 3.0), (2.0, 3.0)]),
        (Clip::new([ClipRegion::plane(slope)]), &[(1.0, 1.0), (3.5, 3.5)]),
        (Clip::new([crop.clone()]), &[(0.5, 0.0), (2.0, 1.25)]),
        (Clip::new([crop.clone().cut()]), &[(0.5, 4.0), (2.0, 2.75)]),
        (Clip::new([ClipRegion::plane(slope), crop.cut()]), &[(0.5, 0.5), (1.5, 1.25), (3.5, 3.5)]),
    ];
    for (name, setup, tolerance) in actions() {
        for (clip, rays) in &cases {
            for shape in [slab(), mesh()] {
                for &(x, length) in *rays {
                    let wanted = absorbed(length);
                    let desc = along_y(x, 1.3).with_clip(clip.clone());
                    within(name, max_error(&[setup.pixel(&shape, &desc)], &wanted), tolerance);
                    shape.set_clip(clip.clone());
                    within(name, max_error(&[setup.pixel(&shape, &along_y(x, 1.3))], &wanted), tolerance);
                    shape.set_clip(Clip::NONE);
                }
            }
        }
    }
}

/// Twelve planes around a point: a ray meets the dodecahedron's chord.
#[test]
fn many_planes_at_once() {
    let middle = DVec3::splat(2.0);
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let normals = [DVec3::new(0.0, 1.0, g), DVec3::new(1.0, g, 0.0), DVec3::new(g, 0.0, 1.0)];
    let normals: Vec<DVec3> = normals
        .iter()
        .flat_map(|n| [*n, n.with_x(-n.x).with_y(if n.x == 0.0 { -n.y } else { n.y })])
        .flat_map(|n| [n, -n])
        .map(DVec3::normalize)
        .collect();
    assert_eq!(normals.len(), 12);
    let region = ClipRegion::planes(normals.iter().map(|n| plane(middle - *n * 1.5, *n)));
    for (keep, region) in [(true, region.clone()), (false, region.cut())] {
        for (x, z) in [(2.0, 2.0), (1.3, 2.4), (2.9, 1.1), (0.2, 0.2)] {
            let at = |y: f64| normals.iter().all(|n| n.dot(DVec3::new(x, y, z) - middle) >= -1.5);
            // The chord by bisection from inside.
            let edge = |mut inside: f64, mut outside: f64| {
                for _ in 0..80 {
                    let y = 0.5 * (inside + outside);
                    if at(y) { inside = y } else { outside = y }
                }
                inside
            };
            let chord = if at(2.0) { edge(2.0, 4.0) - edge(2.0, 0.0) } else { 0.0 };
            let length = if keep { chord } else { 4.0 - chord };
            for (name, setup, tolerance) in actions() {
                for shape in [slab(), mesh()] {
                    let desc = along_y(x, z).with_clip(Clip::new([region.clone()]));
                    within(name, max_error(&[setup.pixel(&shape, &desc)], &absorbed(length)), tolerance);
                }
            }
        }
    }
}

fn view() -> FrameDesc {
    square(DVec3::new(3.5, 3.5, 4.0), DVec3::new(4.0, -9.0, 5.0), 13.0, 24)
}

fn data() -> Volume {
    ball([8, 9, 10], ScalarType::U8)
}

fn table() -> volact_core::LookupTable {
    colors(&[(10.0, [0.2, 0.4, 1.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.5), (200.0, [1.0; 3], 0.9)])
}

#[test]
fn a_crop_box_is_a_smaller_block() {
    let data = data();
    let shape = lut(&data, table(), 1.0);
    let bounds = Aabb::new(DVec3::new(1.3, 2.1, 0.7), DVec3::new(5.9, 7.0, 6.4));
    shape.set_clip(Clip::new([ClipRegion::crop(bounds)]));
    let small = Shape::new(Block::from(bounds), look("lut", table(), 1.0).with("volume", VolumeTexture::new(&data)));
    within("reference", outside(&truth(from_ref(&shape), &view()).color, &truth(from_ref(&small), &view())), 1e-8);
    for step in [0.5, 0.17] {
        let setup = Setup::post(step);
        within(
            "cpu",
            max_error(&setup.colors(from_ref(&shape), &view()), &setup.colors(from_ref(&small), &view())),
            1e-5,
        );
    }
}

#[test]
fn clips_follow_mirrored_and_sheared_shapes() {
    let shear = DMat3::from_cols(DVec3::new(-1.0, 0.3, 0.0), DVec3::new(0.2, 0.9, -0.4), DVec3::new(0.1, 0.0, 1.1));
    let nested = DAffine3::from_translation(DVec3::new(4.0, 1.0, -1.0))
        * DAffine3::from_rotation_z(0.7)
        * DAffine3::from_mat3(shear)
        * DAffine3::from_scale(DVec3::new(1.0, 0.8, 1.3));
    let clip = Clip::new([
        ClipRegion::plane(plane(DVec3::new(3.0, 3.0, 3.0), DVec3::new(1.0, -0.5, 0.3))),
        ClipRegion::crop(Aabb::new(DVec3::new(4.0, 2.0, 1.0), DVec3::new(9.0, 6.0, 5.0))).cut(),
    ]);
    let desc = square(nested.transform_point3(DVec3::splat(4.0)), DVec3::new(4.0, -9.0, 5.0), 15.0, 24);
    let shape = lut(&data(), table(), 1.0);
    shape.set_transform(nested);
    let by_scene = desc.clone().with_clip(clip.transformed(&nested));
    for setup in [Setup::exact(), Setup::post(0.3)] {
        let wanted = setup.colors(from_ref(&shape), &by_scene);
        shape.set_clip(clip.clone());
        within(&format!("{setup:?}"), max_error(&setup.colors(from_ref(&shape), &desc), &wanted), 1e-5);
        shape.set_clip(Clip::NONE);
    }
}

#[test]
fn cpu_clips_as_the_reference_does_with_every_compositing() {
    let clip = Clip::new([
        ClipRegion::plane(plane(DVec3::new(2.0, 3.0, 3.0), DVec3::new(1.0, 0.5, 0.3))),
        ClipRegion::crop(Aabb::new(DVec3::new(3.0, 2.0, 3.0), DVec3::new(6.0, 6.0, 7.0))).cut(),
    ]);
    for shader in ["lut", "mip", "minip", "average", "xray", "simple"] {
        let shape = lut(&data(), table(), if shader == "xray" { 9.0 } else { 1.0 });
        shape.set_shader(shader);
        let desc = view().with_clip(clip.clone());
        let (found, wanted) = (Setup::post(0.3), Setup::rays(0.3));
        let (found, wanted) = (found.draw(from_ref(&shape), &desc), wanted.draw(from_ref(&shape), &desc));
        use volact_conformance::metrics::wide;
        within(shader, max_error(&wide(&found), &wide(&wanted)), 1e-5);
    }
}

#[test]
fn clipped_pictures_are_the_same_bits_with_and_without_skipping_and_for_any_threads() {
    let clip = Clip::new([ClipRegion::crop(Aabb::new(DVec3::new(3.0, 2.0, 3.0), DVec3::new(6.0, 6.0, 7.0))).cut()]);
    let desc = view().with_clip(clip);
    let shape = [lut(&data(), table(), 1.0)];
    let one = Setup::new("cpu").step(0.3).with("threads", 1i64).draw(&shape, &desc);
    for setup in [Setup::cpu().step(0.3), Setup::cpu().step(0.3).with("skipping", false)] {
        assert!(identical(&one, &setup.draw(&shape, &desc)), "{setup:?}");
    }
}
