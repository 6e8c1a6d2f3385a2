//! Cameras, regions and maps at random: `cpu` against the reference on the same lattice.

use proptest::prelude::*;
use volact_conformance::{
    metrics::outside,
    rig::{Setup, on_rays},
    scene::{ball, colors, look, shaded},
};
use volact_core::{
    Aabb, Appearance, Block, Camera, FrameDesc, LookupTable, Roi, ScalarType, Shape, VolumeTexture,
    glam::{DAffine3, DMat3, DVec3},
};

const SIZE: f64 = 12.0;
/// f32 interpolation of values of 200 through a table as steep as 1 in 60; edges of a block, where
/// f64 decides whether a ray meets it, are the same for both.
const TOLERANCE: f64 = 2e-5;

fn table() -> LookupTable {
    colors(&[(0.0, [0.2, 0.1, 0.3], 0.01), (60.0, [1.0, 0.4, 0.2], 0.2), (200.0, [0.3, 0.9, 1.0], 0.8)])
}

fn vector(lo: f64, hi: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(lo..hi).prop_map(DVec3::from_array)
}

fn camera() -> impl Strategy<Value = Camera> {
    let up = prop_oneof![Just(DVec3::Z), Just(DVec3::Y), Just(DVec3::new(1.0, 0.3, 0.2))];
    (vector(-30.0, 40.0), vector(2.0, 10.0), up, 5.0..170.0f64, any::<bool>()).prop_filter_map(
        "a view with an up",
        |(eye, target, up, size, parallel)| {
            let axis = (target - eye).try_normalize()?;
            (axis.cross(up.normalize()).length() > 0.05).then(|| match parallel {
                true => Camera::orthographic(eye, target, up, size / 6.0),
                false => Camera::perspective(eye, target, up, size),
            })
        },
    )
}

fn map() -> impl Strategy<Value = DAffine3> {
    (prop::array::uniform3(vector(-1.0, 1.0)), vector(-6.0, 6.0)).prop_filter_map("a map of some volume", |(m, t)| {
        let matrix = DMat3::from_cols(m[0], m[1], m[2]);
        (matrix.determinant().abs() > 0.1).then_some(DAffine3::from_mat3_translation(matrix, t))
    })
}

fn agree(shapes: &[Shape], camera: Camera, size: [usize; 2], step: f64) -> Result<(), TestCaseError> {
    let desc = FrameDesc::new(camera, size[0], size[1]);
    let found = Setup::post(step).colors(shapes, &desc);
    let error = outside(&found, &on_rays(shapes, &desc, step));
    prop_assert!(error <= TOLERANCE, "{error:e}");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_camera_and_map(camera in camera(), map in map(), step in 0.2..3.0f64, size in [1usize..12, 1..12], shader in 0usize..5) {
        let shader = ["lut", "mip", "minip", "average", "xray"][shader];
        let texture = VolumeTexture::new(&ball([11, 13, 12], ScalarType::U8));
        let shape = shaded(shader, &texture, table(), 2.0);
        shape.set_transform(map);
        agree(&[shape], camera, size, step)?;
    }

    #[test]
    fn any_regions_and_blocks(
        camera in camera(),
        ends in prop::array::uniform6(0usize..12),
        at in vector(-4.0, 10.0),
        size in vector(0.5, 14.0),
        block in (vector(-2.0, 8.0), vector(0.5, SIZE)),
        scalar in prop::sample::select(&ScalarType::ALL[..]),
    ) {
        let roi = Roi {
            min: [0, 1, 2].map(|a| ends[a].min(ends[a + 3])),
            max: [0, 1, 2].map(|a| ends[a].max(ends[a + 3])),
        };
        let data = ball([12, 12, 12], scalar);
        let texture = VolumeTexture::new(&data).with_data_roi(roi).unwrap();
        let texture = texture.with_geometry_roi(Aabb::new(at, at + size)).unwrap();
        let look: Appearance = look("lut", table(), 2.0).with("volume", texture);
        agree(&[Shape::new(Block::new(block.0, block.1).unwrap(), look)], camera, [8, 8], 0.37)?;
    }

    #[test]
    fn any_overlap(camera in camera(), a in map(), b in map(), step in 0.3..2.0f64) {
        let texture = VolumeTexture::new(&ball([10, 9, 11], ScalarType::U8));
        let shape = |map| {
            let shape = shaded("lut", &texture, table(), 2.0);
            shape.set_transform(map);
            shape
        };
        agree(&[shape(a), shape(b)], camera, [8, 8], step)?;
    }

    #[test]
    fn skipping_changes_no_bit(camera in camera(), map in map(), step in 0.2..3.0f64, pre in any::<bool>()) {
        let sparse = colors(&[(40.0, [0.2, 0.1, 0.3], 0.0), (60.0, [1.0, 0.4, 0.2], 0.2), (70.0, [0.3, 0.9, 1.0], 0.0)]);
        let shape = shaded("lut", &VolumeTexture::new(&ball([31, 23, 27], ScalarType::I16)), sparse, 2.0);
        shape.set_transform(map * DAffine3::from_scale(DVec3::splat(0.5)));
        let desc = FrameDesc::new(camera, 9, 7);
        let setup = if pre { Setup::pre_integrated(step) } else { Setup::post(step) };
        let draw = |on: bool| setup.clone().with("skipping", on).draw(std::slice::from_ref(&shape), &desc);
        prop_assert!(volact_conformance::metrics::identical(&draw(true), &draw(false)));
    }
}
