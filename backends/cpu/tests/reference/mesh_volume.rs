//! Volumes in meshes: by position as in a block, by texture coordinates as in a block that is
//! deformed; on the certified way and on lattices.

use volact_core::{
    Aabb, Appearance, Block, Camera, Clip, ClipRegion, Filter, FrameDesc, LookupTable, Mesh, Plane, Points, Roi, Shape,
    VolumeTexture,
    glam::{DAffine3, DMat3, DVec3},
};
use volact_cpu::reference::{Classification, Method, ReferenceOptions, ReferencePicture, integrate};

use super::{
    common::{along_z, certify, picture, point, resolve, table, volume_of},
    mesh_common::{Dice, Parts, agree, attribute, cube, field, grid, nasty, views},
};

fn layers() -> LookupTable {
    table(&[
        point(0.1, [0.0, 0.2, 0.9], 0.0),
        point(0.3, [0.9, 0.2, 0.1], 0.6),
        point(0.5, [0.2, 0.8, 0.3], 0.05),
        point(0.9, [0.7, 0.7, 0.2], 0.999),
    ])
}

/// A texture that fills the unit cube.
fn hills() -> VolumeTexture {
    let made =
        volume_of([5, 4, 6], |[x, y, z]| 0.5 + 0.5 * (1.3 * x as f64 + 2.1 * y as f64 + 0.7 * (z * z) as f64).sin());
    VolumeTexture::new(&made).with_geometry_roi(Aabb::new(DVec3::ZERO, DVec3::ONE)).unwrap()
}

fn look(shader: &str, texture: &VolumeTexture, table: LookupTable) -> Appearance {
    Appearance::new(shader).with("volume", texture.clone()).with("lookup_table", table).with("unit_distance", 0.1)
}

fn block() -> Block {
    Block::from(Aabb::new(DVec3::ZERO, DVec3::ONE))
}

/// Texture coordinates that put the volume where it is by position.
fn textured(parts: &Parts) -> Mesh {
    let coordinates: Points = parts.points.clone().into();
    parts.mesh().with_texture_coordinates(coordinates).unwrap()
}

fn meshes() -> Vec<Parts> {
    vec![cube(5), cube(24), grid(4, 0.0, 0), grid(3, 0.35, 1), nasty(2, 100, 2)]
}

#[test]
fn volume_in_a_mesh_is_the_volume_in_the_block() {
    for frame in views() {
        let truth = picture(&[Shape::new(block(), look("lut", &hills(), layers()))], &frame);
        for parts in meshes() {
            let carved = Shape::new(parts.mesh(), look("lut", &hills(), layers()));
            agree(&picture(&[carved], &frame), &truth);
            let carried = Shape::new(textured(&parts), look("lut", &hills(), layers()));
            agree(&picture(&[carried], &frame), &truth);
        }
    }
}

#[test]
fn every_shader_and_filter_is_the_same_in_a_mesh() {
    let grey = LookupTable::window_level(1.0, 0.5, 0.8).unwrap();
    let parts = nasty(2, 60, 4);
    let frames = views();
    for (i, shader) in ["simple", "lut", "mip", "minip", "average", "xray", "lut"].into_iter().enumerate() {
        for filter in [Filter::Linear, Filter::Nearest] {
            // The last: classified at the voxels.
            let table = if i == 6 { grey.clone().pre_interpolated() } else { grey.clone() };
            let texture = hills().with_filter(filter);
            let appearance = look(shader, &texture, table);
            for frame in [&frames[0], &frames[5], &frames[6]] {
                let truth = picture(&[Shape::new(block(), appearance.clone())], frame);
                agree(&picture(&[Shape::new(parts.mesh(), appearance.clone())], frame), &truth);
                agree(&picture(&[Shape::new(textured(&parts), appearance.clone())], frame), &truth);
            }
        }
    }
}

/// Points at 1.5·p − 0.25 with texture coordinates p' = (p − 0.5)·k + 0.5 …: what an affine map of
/// the points does, a shape's transform does.
#[test]
fn affine_deformation_is_a_transform() {
    let bend = DAffine3::from_mat3_translation(
        DMat3::from_cols(DVec3::new(1.1, 0.3, -0.2), DVec3::new(-0.4, 0.8, 0.1), DVec3::new(0.2, -0.1, -1.3)),
        DVec3::new(0.1, 0.2, 1.1),
    );
    let whole = Shape::new(block(), look("lut", &hills(), layers()));
    whole.set_transform(bend);
    let frame = FrameDesc::fit(&whole, volact_core::View::Iso, 13, 11);
    let truth = picture(&[whole], &frame);
    for parts in meshes() {
        let coordinates: Points = parts.points.clone().into();
        let moved = parts.moved(|p| bend.transform_point3(p));
        let mesh = moved.mesh().with_texture_coordinates(coordinates).unwrap();
        agree(&picture(&[Shape::new(mesh, look("lut", &hills(), layers()))], &frame), &truth);
    }
}

#[test]
fn texture_coordinates_end_at_the_volume() {
    let shape = Shape::new(block(), look("lut", &hills(), layers()));
    let grown = |p: DVec3| 1.75 * p - DVec3::new(0.25, 0.5, 0.375);
    for (i, frame) in views().into_iter().enumerate() {
        let truth = picture(std::slice::from_ref(&shape), &frame);
        for (number, parts) in meshes().into_iter().enumerate() {
            // By position the geometry ROI ends it.
            let mesh = parts.moved(grown).mesh();
            agree(&picture(&[Shape::new(mesh, look("lut", &hills(), layers()))], &frame), &truth);
            // Rays in the volume's faces are in them only where points are exact numbers.
            if number < 3 || [0, 5, 6].contains(&i) {
                let mesh = textured(&parts.moved(grown));
                agree(&picture(&[Shape::new(mesh, look("lut", &hills(), layers()))], &frame), &truth);
            }
        }
    }
}

#[test]
fn deformed_constant_volume_is_its_mesh() {
    let flat = volume_of([3; 3], |_| 0.5);
    let texture = VolumeTexture::new(&flat).with_data_roi(Roi { min: [1, 0, 0], max: [2, 2, 1] }).unwrap();
    let parts = grid(3, 0.3, 9);
    let bent = |p: DVec3| p + 0.2 * DVec3::new((2.0 * p.y).sin(), (3.0 * p.z).cos(), p.x * p.y);
    let coordinates: Points = parts.points.clone().into();
    let mesh = parts.moved(bent).mesh().with_texture_coordinates(coordinates).unwrap();
    let shape = Shape::new(mesh, look("lut", &texture, layers()));
    let same = field(&parts.moved(bent), |_| 0.5, layers(), 0.1);
    for frame in views() {
        agree(&picture(std::slice::from_ref(&shape), &frame), &picture(std::slice::from_ref(&same), &frame));
    }
}

#[test]
fn stretches_are_cut_by_clips() {
    let region = ClipRegion::plane(Plane::new(DVec3::splat(0.5), DVec3::new(1.0, 0.4, -0.3)).unwrap());
    let hole = ClipRegion::crop(Aabb::new(DVec3::splat(0.25), DVec3::splat(0.75))).cut();
    let clip = Clip::new([region, hole]);
    let parts = nasty(2, 80, 12);
    let wave = |p: DVec3| 0.5 + 0.5 * (9.0 * p.x + 5.0 * p.y * p.z).sin();
    for frame in views() {
        let cut = |shape: Shape| {
            shape.set_clip(clip.clone());
            picture(&[shape], &frame)
        };
        let truth = cut(Shape::new(block(), look("lut", &hills(), layers())));
        agree(&cut(Shape::new(parts.mesh(), look("lut", &hills(), layers()))), &truth);
        agree(&cut(Shape::new(textured(&parts), look("lut", &hills(), layers()))), &truth);
        // Numbers: the scene's clip does what the shape's does.
        let whole = field(&parts, wave, layers(), 0.1);
        let framed = frame.clone().with_clip(clip.clone());
        agree(&cut(whole.clone().named("cut")), &picture(&[whole], &framed));
    }
}

#[test]
fn mesh_in_a_volume_adds_its_extinction() {
    let thin = table(&[point(0.0, [0.2, 0.4, 0.6], 0.3)]);
    let around = Shape::new(
        Block::from(Aabb::new(DVec3::splat(-0.5), DVec3::splat(1.5))),
        look("lut", &hills().with_geometry_roi(Aabb::new(DVec3::splat(-0.5), DVec3::splat(1.5))).unwrap(), layers()),
    );
    let parts = nasty(2, 60, 13);
    for frame in views() {
        let inner = Shape::new(block(), look("lut", &hills(), thin.clone()));
        let truth = picture(&[around.clone(), inner], &frame);
        let mesh = field(&parts, |_| 1.0, thin.clone(), 0.1);
        agree(&picture(&[mesh, around.clone()], &frame), &truth);
    }
}

fn sampled(shape: &Shape, frame: &FrameDesc, method: Method, classification: Classification) -> ReferencePicture {
    let options = ReferenceOptions { method, classification, sample_distance: 0.07, ..Default::default() };
    integrate(&resolve(std::slice::from_ref(shape)), frame, &options).unwrap()
}

#[track_caller]
fn near(a: &ReferencePicture, b: &ReferencePicture, bound: f64) {
    for (a, b) in a.color.iter().zip(&b.color) {
        assert!((0..4).all(|c| (a[c] - b[c]).abs() <= bound), "{a:?} {b:?}");
    }
}

#[test]
fn lattices_sample_meshes_as_blocks() {
    let parts = nasty(2, 60, 6);
    let whole = volume_of([2; 3], |[x, y, z]| 0.3 * x as f64 + 0.45 * y as f64 + 0.25 * z as f64);
    let whole = VolumeTexture::new(&whole);
    for frame in [&views()[0], &views()[5], &views()[6]] {
        for method in [Method::Rays, Method::Planes] {
            for classification in [Classification::Post, Classification::PreIntegrated] {
                let drawn = |shape: Shape| sampled(&shape, frame, method, classification);
                for shader in ["lut", "average", "mip"] {
                    let truth = drawn(Shape::new(block(), look(shader, &hills(), layers())));
                    near(&drawn(Shape::new(parts.mesh(), look(shader, &hills(), layers()))), &truth, 1e-12);
                    near(&drawn(Shape::new(textured(&parts), look(shader, &hills(), layers()))), &truth, 1e-12);
                    let grown = parts.moved(|p| 1.75 * p - 0.375);
                    near(&drawn(Shape::new(textured(&grown), look(shader, &hills(), layers()))), &truth, 1e-12);
                }
                let truth = drawn(Shape::new(block(), look("lut", &whole, layers())));
                let slope = |p: DVec3| p.dot(DVec3::new(0.3, 0.45, 0.25));
                near(&drawn(field(&parts, slope, layers(), 0.1)), &truth, 1e-12);
            }
        }
    }
}

#[test]
fn cells_smaller_than_a_pixel_count_in_full() {
    // A cube of a billionth's size in the middle of a pixel.
    let size = 1e-9;
    let parts = grid(3, 0.3, 14).moved(|p| (p - 0.5) * size);
    let shape = field(&parts, |_| 1.0, table(&[point(0.0, [1.0; 3], 0.5)]), size);
    let middle = FrameDesc::new(Camera::orthographic(DVec3::new(0.0, 0.0, -3.0), DVec3::ZERO, DVec3::Y, 1.0), 3, 3);
    let made = picture(&[shape], &middle);
    assert!((made.color[4][3] - 0.5).abs() < 1e-6, "{:?}", made.color[4]);
    assert!((0..9).all(|i| i == 4 || made.color[i] == [0.0; 4]));
}

#[test]
fn far_meshes_keep_their_digits() {
    let far = DVec3::new(3e6, -1e7, 2e6);
    let parts = grid(2, 0.3, 15);
    let wave = |p: DVec3| 0.5 + 0.5 * (9.0 * p.x + 5.0 * p.y * p.z).sin();
    let frame = |at: DVec3| {
        FrameDesc::new(Camera::orthographic(at + DVec3::new(-2.0, -1.5, 3.0), at + 0.5, DVec3::Z, 2.0), 7, 7)
    };
    let shape = field(&parts, wave, layers(), 0.1);
    let near = picture(std::slice::from_ref(&shape), &frame(DVec3::ZERO));
    shape.set_transform(DAffine3::from_translation(far));
    let made = picture(&[shape], &frame(far));
    for (a, b) in near.color.iter().zip(&made.color) {
        // The rays themselves are rounded: 1e-16 · 1e7.
        assert!((0..4).all(|c| (a[c] - b[c]).abs() < 1e-6), "{a:?} {b:?}");
    }
    assert_eq!(made.not_certified, 0);
}

#[test]
fn what_is_wrong_with_a_mesh_is_named() {
    use volact_cpu::reference::check;
    let shape = Shape::new(
        block(),
        Appearance::new("attribute").with("scalars", attribute(vec![1.0; 7])).with("lookup_table", layers()),
    );
    let error = check(&resolve(&[shape])[0]).unwrap_err().to_string();
    assert!(error.contains("scalars") && error.contains("7 vertices") && error.contains('8'), "{error}");
    let shape = field(&cube(6), |_| 1.0, layers(), 1.0);
    shape.set_parameter("component", 1i64);
    let error = check(&resolve(&[shape])[0]).unwrap_err().to_string();
    assert!(error.contains("component 1"), "{error}");
}

#[test]
fn blocks_have_attributes_at_their_corners() {
    let look = Appearance::new("attribute").with("scalars", attribute(vec![0.5; 8])).with("unit_distance", 0.5);
    let shape = Shape::new(block(), look.with("lookup_table", table(&[point(0.0, [1.0; 3], 0.5)])));
    certify(&[shape], &along_z(0.3, 0.4), [0.75; 4]);
}

#[test]
fn cells_are_not_met_twice_from_any_direction() {
    let mut dice = Dice(5);
    let parts = nasty(3, 400, 77);
    let shape = field(&parts, |_| 1.0, table(&[point(0.0, [1.0; 3], 0.5)]), 1.0);
    for _ in 0..40 {
        let to = dice.direction();
        let frame =
            FrameDesc::new(Camera::orthographic(DVec3::splat(0.5) - 3.0 * to, DVec3::splat(0.5), DVec3::Z, 1.8), 6, 6);
        let whole = Shape::new(block(), look("lut", &hills(), table(&[point(0.0, [1.0; 3], 0.5)])));
        whole.set_parameter("unit_distance", 1.0);
        agree(&picture(std::slice::from_ref(&shape), &frame), &picture(&[whole], &frame));
    }
}
