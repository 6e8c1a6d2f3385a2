//! The same picture as the reference, on the lattice of rays and on that of planes.

use std::slice::from_ref;

use volact_conformance::{
    metrics::within,
    scene::{ball, colors, lut, lut_of, placed, shaded, square, volume},
};
use volact_core::{
    Aabb, Appearance, Camera, Clip, ClipRegion, ControlPoint, Filter, FrameDesc, LookupTable, Opaque, OpaqueDepth,
    Plane, Roi, ScalarType, Shape, SliceStyle, Sliced, Slices, Viewport, VolumeDesc, VolumeTexture,
    glam::{DAffine3, DVec3},
};

use crate::common::all_errors;

const STEP: f64 = 0.31;

/// Rounding: places are known to some 2⁻²² of a scene of size 10, the tables' opacities rise by at
/// most 0.02 a unit of value and values by some 100 a voxel, so that the extinction of a sample is
/// wrong by some 1e-5; over 30 samples of either sign less is left of it.
const ROUNDING: f64 = 2e-5;

fn warm() -> LookupTable {
    colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (99.0, [0.2; 3], 0.8), (200.0, [1.0; 3], 1.0)])
}

fn cold() -> LookupTable {
    colors(&[(0.0, [0.0, 0.2, 0.5], 0.0), (4.0, [0.1, 0.6, 1.0], 0.4), (9.0, [1.0; 3], 0.1)])
}

fn view() -> FrameDesc {
    square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 24)
}

fn near() -> FrameDesc {
    FrameDesc::new(Camera::perspective(DVec3::new(9.0, -11.0, 7.0), DVec3::splat(4.0), DVec3::Z, 50.0), 24, 20)
}

fn a_ball() -> VolumeTexture {
    VolumeTexture::new(&ball([9, 8, 10], ScalarType::U8))
}

fn agree(what: &str, shapes: &[Shape], desc: &FrameDesc) {
    for (method, [color, depth]) in all_errors(shapes, desc, STEP) {
        within(&format!("{what}, {method}, colour"), color, ROUNDING);
        // Where opacity rises slowly its threshold is reached anywhere near.
        within(&format!("{what}, {method}, depth"), depth, 1e-4);
    }
}

#[test]
fn tables_through_all_cameras() {
    let shape = lut_of(&a_ball(), warm(), 1.0);
    agree("orthographic", from_ref(&shape), &view());
    agree("perspective", from_ref(&shape), &near());
    let inside = Camera::perspective(DVec3::splat(4.0), DVec3::new(0.0, 9.0, 5.0), DVec3::Z, 80.0);
    agree("inside", &[shape], &FrameDesc::new(inside, 16, 16));
}

#[test]
fn tables_before_interpolation() {
    let other =
        volume([9, 8, 10], ScalarType::F32, |p| if p.x == 3.0 && p.z > 5.0 { f64::NAN } else { 9.0 * p.x + 5.0 * p.y });
    for table in [warm(), cold()] {
        for texture in [a_ball(), a_ball().with_filter(Filter::Nearest), VolumeTexture::new(&other)] {
            agree("before", &[lut_of(&texture, table.clone().pre_interpolated(), 1.0)], &view());
        }
    }
}

#[test]
fn every_type_of_voxel() {
    for scalar in ScalarType::ALL {
        let shape = lut(&ball([9, 8, 10], scalar), warm(), 1.0);
        let shape = if scalar == ScalarType::I8 {
            lut(&volume([9, 8, 10], scalar, |p| p.x * 9.0 - 20.0), warm(), 1.0)
        } else {
            shape
        };
        agree(scalar.name(), &[shape], &view());
    }
}

#[test]
fn every_built_in_shader() {
    for name in ["lut", "tangent_space", "gradient", "mip", "minip", "average"] {
        agree(name, &[shaded(name, &a_ball(), warm(), 1.0)], &near());
    }
    agree("xray", &[shaded("xray", &a_ball(), warm(), 5.0)], &near());
    agree("simple", &[Shape::around_texture(&a_ball(), Appearance::new("simple").with("unit_distance", 3.0))], &view());
    let other = VolumeTexture::new(&volume([9, 8, 10], ScalarType::F32, |p| p.x + p.y));
    let both = Appearance::new("blend2").with("lookup_table", warm()).with("lookup_table2", cold());
    let both = both.with("volume2", other).with("unit_distance", 1.0);
    agree("blend2", &[Shape::around_texture(&a_ball(), both)], &view());
    let two = Appearance::new("lut2d").with("lookup_table", warm()).with("gradient_table", warm());
    agree("lut2d", &[Shape::around_texture(&a_ball(), two.with("unit_distance", 1.0))], &view());
}

#[test]
fn surfaces_of_values() {
    let surfaces = colors(&[(30.0, [1.0, 0.4, 0.1], 0.4), (90.0, [0.3, 0.8, 0.2], 0.7)]);
    let shape = Shape::around_texture(&a_ball(), Appearance::new("isosurface").with("surfaces", surfaces));
    agree("isosurface", from_ref(&shape), &near());
    agree("isosurface in a table's haze", &[shape, lut_of(&a_ball(), cold(), 4.0)], &near());
}

#[test]
fn shapes_that_overlap() {
    let other = volume([6, 7, 8], ScalarType::F32, |p| (p - DVec3::splat(3.0)).length());
    let turned = lut(&other, cold(), 0.7);
    turned.set_transform(DAffine3::from_translation(DVec3::new(2.0, 1.0, 1.5)) * DAffine3::from_rotation_x(0.5));
    let shapes = [lut_of(&a_ball(), warm(), 1.0), turned];
    agree("two", &shapes, &view());
    let third = shaded("mip", &a_ball(), warm(), 1.0);
    agree("two and a picture", &[shapes[0].clone(), third, shapes[1].clone()], &near());
}

#[test]
fn regions_clips_and_slices() {
    let texture = a_ball().with_data_roi(Roi { min: [1, 2, 1], max: [7, 6, 8] }).unwrap();
    agree("data region", &[lut_of(&texture, warm(), 1.0)], &view());
    let moved = texture.with_geometry_roi(Aabb::new(DVec3::ZERO, DVec3::new(8.0, 6.0, 4.0))).unwrap();
    agree("geometry region", &[lut_of(&moved, warm(), 1.0)], &view());
    agree("nearest", &[lut_of(&a_ball().with_filter(Filter::Nearest), cold(), 20.0)], &view());
    let plane = ClipRegion::plane(Plane::new(DVec3::splat(4.0), DVec3::new(1.0, -0.3, 0.4)).unwrap());
    let hole = ClipRegion::crop(Aabb::new(DVec3::splat(3.0), DVec3::splat(5.0))).cut();
    let shape = lut_of(&a_ball(), warm(), 1.0);
    shape.set_clip(Clip::new([plane.clone(), hole.clone()]));
    shape.set_transform(DAffine3::from_rotation_y(0.3));
    agree("clipped shape", &[shape], &view());
    let shape = lut_of(&a_ball(), warm(), 1.0);
    agree("clipped scene", from_ref(&shape), &near().with_clip(Clip::new([plane, hole])));
    for style in [SliceStyle::Opaque, SliceStyle::Blended] {
        for volume in [false, true] {
            let planes = [(DVec3::Y, 3.3), (DVec3::X, 4.7)].map(|(n, at)| Plane::new(n * at, n).unwrap());
            let slices = Slices { planes: planes.to_vec(), style, volume };
            let geometry = Sliced::new(shape.state().geometry, slices).unwrap();
            let sliced = shape.named("sliced");
            sliced.set_geometry(geometry);
            agree(&format!("slices {style:?} {volume}"), &[sliced], &view());
        }
    }
}

/// Something opaque in a part of the picture, of which light is left behind it.
#[test]
fn what_is_opaque_ends_rays_and_lies_behind_the_rest() {
    let viewport = Viewport { x: 5, y: 3, width: 21, height: 18 };
    let desc = FrameDesc { viewport: Some(viewport), ..FrameDesc::new(near().camera, 30, 24) };
    let pixels = desc.width * desc.height;
    let distance: Vec<f32> = (0..pixels).map(|i| if i % 3 == 0 { 15.0 } else { f32::INFINITY }).collect();
    let color: Vec<[f32; 4]> = (0..pixels).map(|i| [0.2, 0.1, (i % 5) as f32 * 0.1, 0.8]).collect();
    let opaque = Opaque { color: Some(color.into()), depth: OpaqueDepth::Distance(distance.into()) };
    let desc = desc.with_opaque(opaque);
    let [table, mip] = [lut_of(&a_ball(), warm(), 1.0), shaded("mip", &a_ball(), warm(), 1.0)];
    agree("a table", from_ref(&table), &desc);
    agree("a picture of its own", from_ref(&mip), &desc);
    agree("both", &[mip, table], &desc);
}

#[test]
fn components_of_all_counts() {
    for components in 1..=4 {
        let mut desc = VolumeDesc::new([5, 6, 7], ScalarType::U8, components);
        desc.spacing = DVec3::new(1.3, 1.0, 0.8);
        let bytes: Vec<u8> = (0..5 * 6 * 7 * components).map(|i| (i * 67 % 256) as u8).collect();
        let volume = volact_core::Volume::new(desc, bytes).unwrap();
        let simple = Appearance::new("simple").with("unit_distance", 2.0);
        agree(&format!("{components} components"), &[Shape::around(&volume, simple)], &view());
        let table = Appearance::new("lut").with("lookup_table", warm()).with("component", components as i64 - 1);
        agree(&format!("component {components}"), &[Shape::around(&volume, table.with("unit_distance", 2.0))], &view());
    }
}

#[test]
fn scales_and_places_far_away() {
    for (scale, shift) in [(1e-9, 0.0), (1.0, 1e7), (1e6, 0.0)] {
        let mut desc = VolumeDesc::new([9, 8, 10], ScalarType::U8, 1);
        desc.spacing = DVec3::splat(scale);
        desc.placement = DAffine3::from_translation(DVec3::splat(shift));
        let volume = placed(desc, |p| (40.0 + 20.0 * (p.x * 0.7).sin() + 9.0 * p.y).round());
        let shape = lut(&volume, warm(), scale);
        let target = DVec3::splat(4.0 * scale + shift);
        let eye = target + DVec3::new(4.0, -9.0, 5.0) * scale;
        let view = FrameDesc::new(Camera::perspective(eye, target, DVec3::Z, 60.0), 16, 16);
        let step = STEP * scale;
        for (method, [color, depth]) in all_errors(&[shape], &view, step) {
            within(&format!("scale {scale}, shift {shift}, {method}"), color, ROUNDING);
            within("depth", depth / scale, 1e-4);
        }
    }
}

#[test]
fn tables_of_points_anywhere() {
    let point = |value: f64, x: f64| ControlPoint { value, color: [x, 1.0 - x, 0.5], opacity: x * 0.3 };
    let many: Vec<_> = (0..500).map(|i| point(f64::from(i) * 0.4, f64::from(i * 7919 % 100) / 400.0)).collect();
    let uneven = [point(-1e6, 0.1), point(40.0, 0.2), point(41.0, 0.9), point(100.0, 0.0), point(1e6, 1.0)];
    for table in [LookupTable::from_points(many).unwrap(), LookupTable::from_points(uneven).unwrap()] {
        let smooth = volume([9, 8, 10], ScalarType::F32, |p| 10.0 * p.x + 5.0 * p.y);
        agree("table", &[lut(&smooth, table, 1.0)], &view());
    }
}
