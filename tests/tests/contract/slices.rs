//! Slice plane sets: textured cuts, opaque or blended, with and without the volume.

use std::sync::Arc;

use volact_conformance::{
    meshes::{bent, look as look_attribute, scalars},
    metrics::{identical, max_error, within},
    rig::Setup,
    scene::{along_y, ball, colors, look, square, volume},
};
use volact_core::{
    Appearance, Block, Clip, ClipRegion, Geometry, LookupTable, Plane, ScalarType, Shape, SliceStyle, Sliced, Slices,
    VolumeTexture, glam::DVec3,
};

fn actions() -> [(&'static str, Setup, f64); 3] {
    let source = Setup::post(0.05).with("recognise", false);
    // Colours that change along a mesh's cells are sampled there, not integrated.
    [("reference", Setup::exact(), 6e-8), ("cpu", Setup::post(0.05), 3e-6), ("cpu, by source", source, 2e-5)]
}

fn sliced(geometry: Arc<dyn Geometry>, at: &[(DVec3, DVec3)], style: SliceStyle, with_volume: bool) -> Sliced {
    let planes = at.iter().map(|(point, normal)| Plane::new(*point, *normal).unwrap()).collect();
    Sliced::new(geometry, Slices { planes, style, volume: with_volume }).unwrap()
}

/// Value y along the ray, 0 to 4; red falls, green rises; opacity 0.3.
fn table() -> LookupTable {
    colors(&[(0.0, [1.0, 0.0, 0.2], 0.3), (4.0, [0.0, 1.0, 0.2], 0.3)])
}

fn rgba(y: f64, alpha: f64) -> [f64; 4] {
    [(1.0 - y / 4.0) * alpha, y / 4.0 * alpha, 0.2 * alpha, alpha]
}

fn over(front: [f64; 4], back: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|c| front[c] + (1.0 - front[3]) * back[c])
}

/// The same field as a volume in a block and as the numbers of a mesh.
fn shapes(at: &[(DVec3, DVec3)], style: SliceStyle, with_volume: bool) -> [Shape; 2] {
    let data = volume([3, 5, 3], ScalarType::F32, |p| p.y);
    let block = Block::new(DVec3::ZERO, DVec3::new(2.0, 4.0, 2.0)).unwrap();
    let mesh = bent([2, 4, 3], DVec3::new(2.0, 4.0, 2.0), 0.1);
    let numbers = scalars(mesh.points(), |p| p.y);
    let lut = look("lut", table(), 1.0).with("volume", VolumeTexture::new(&data));
    [
        Shape::new(sliced(Arc::new(block), at, style, with_volume), lut),
        Shape::new(sliced(Arc::new(mesh), at, style, with_volume), look_attribute(numbers, table(), 1.0)),
    ]
}

const AT_1: (DVec3, DVec3) = (DVec3::new(0.0, 1.0, 0.0), DVec3::Y);
const AT_3: (DVec3, DVec3) = (DVec3::new(0.0, 3.0, 0.0), DVec3::NEG_Y);

#[test]
fn opaque_slices_hide_what_is_behind_and_blended_ones_let_it_through() {
    let slope = (DVec3::new(0.7, 2.5, 0.7), DVec3::new(1.0, 1.0, 0.0));
    for (name, setup, tolerance) in actions() {
        for (planes, style, wanted) in [
            (vec![AT_3, AT_1], SliceStyle::Opaque, rgba(1.0, 1.0)),
            (vec![AT_3, AT_1], SliceStyle::Blended, over(rgba(1.0, 0.3), rgba(3.0, 0.3))),
            (vec![slope], SliceStyle::Opaque, rgba(2.5, 1.0)),
            // Behind the block and along the ray nothing is met.
            (vec![(DVec3::Y * 5.0, DVec3::Y), (DVec3::new(0.7, 0.0, 0.0), DVec3::X)], SliceStyle::Opaque, [0.0; 4]),
        ] {
            for shape in shapes(&planes, style, false) {
                let found = setup.pixel(&shape, &along_y(0.7, 0.7));
                within(&format!("{name} {style:?}"), max_error(&[found], &[wanted]), tolerance);
            }
        }
    }
}

#[test]
fn slices_lie_in_the_volume_around_them() {
    // Before the slice the medium of 0.3 a unit, whose colour is linear: ∫ by fine midpoints.
    let medium = |from: f64, to: f64| {
        let n = 200_000;
        let h = (to - from) / f64::from(n);
        let alpha = 1.0 - 0.7f64.powf(h);
        (0..n).fold([0.0; 4], |c, i| over(c, rgba(from + (f64::from(i) + 0.5) * h, alpha)))
    };
    for (style, wanted) in [
        (SliceStyle::Opaque, over(medium(0.0, 3.0), rgba(3.0, 1.0))),
        (SliceStyle::Blended, over(over(medium(0.0, 3.0), rgba(3.0, 0.3)), medium(3.0, 4.0))),
    ] {
        for (name, setup, tolerance) in actions() {
            for shape in shapes(&[AT_3], style, true) {
                let found = setup.pixel(&shape, &along_y(0.7, 0.7));
                // `cpu` sums midpoints 0.05 apart.
                let tolerance = if name == "cpu" { 3e-5 } else { tolerance };
                within(&format!("{name} {style:?}"), max_error(&[found], &[wanted]), tolerance);
            }
        }
    }
}

#[test]
fn coincident_slices_do_not_depend_on_the_order_of_drawing() {
    let desc = square(DVec3::new(1.0, 2.0, 1.0), DVec3::new(4.0, -9.0, 5.0), 5.0, 16);
    let [a, b] = shapes(&[AT_1, AT_3], SliceStyle::Blended, true);
    b.set_parameter("lookup_table", colors(&[(0.0, [0.0, 0.0, 1.0], 0.6)]));
    for (name, setup, _) in actions() {
        let one = setup.draw(&[a.clone(), b.clone()], &desc);
        assert!(identical(&one, &setup.draw(&[b.clone(), a.clone()], &desc)), "{name}");
    }
}

#[test]
fn clips_cut_slices() {
    let clip = Clip::new([ClipRegion::plane(Plane::new(DVec3::Y * 2.0, DVec3::Y).unwrap())]);
    for (name, setup, tolerance) in actions() {
        for shape in shapes(&[AT_1, AT_3], SliceStyle::Opaque, false) {
            shape.set_clip(clip.clone());
            let found = setup.pixel(&shape, &along_y(0.7, 0.7));
            within(name, max_error(&[found], &[rgba(3.0, 1.0)]), tolerance);
        }
    }
}

#[test]
fn whole_pictures_of_slices_agree() {
    let data = ball([9, 8, 10], ScalarType::U8);
    let table = colors(&[(0.0, [0.1, 0.1, 0.3], 0.1), (90.0, [1.0, 0.6, 0.1], 0.5), (200.0, [1.0; 3], 0.9)]);
    let planes = [
        (DVec3::new(3.0, 3.0, 5.0), DVec3::new(0.3, 1.0, 0.2)),
        (DVec3::new(4.0, 3.0, 5.0), DVec3::X),
        (DVec3::new(4.0, 3.0, 4.2), DVec3::Z),
    ];
    let block: Arc<dyn Geometry> = Arc::new(Block::new(DVec3::ZERO, DVec3::new(8.0, 7.0, 9.0)).unwrap());
    let desc = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 24);
    for style in [SliceStyle::Opaque, SliceStyle::Blended] {
        for with_volume in [false, true] {
            let look: Appearance = look("lut", table.clone(), 1.0).with("volume", VolumeTexture::new(&data));
            let shape = [Shape::new(sliced(Arc::clone(&block), &planes, style, with_volume), look)];
            let (found, wanted) = (Setup::post(0.23).colors(&shape, &desc), Setup::rays(0.23).colors(&shape, &desc));
            within(&format!("{style:?} {with_volume}"), max_error(&found, &wanted), 1e-5);
            assert!(found.iter().any(|c| c[3] > 0.05));
        }
    }
}

#[test]
fn slices_of_flat_pictures_are_refused() {
    for (name, setup, _) in actions() {
        let [shape, _] = shapes(&[AT_1], SliceStyle::Opaque, false);
        shape.set_shader("mip");
        let error = setup.action().manage(&shape).expect_err(name).to_string();
        assert!(error.contains("slice") && error.contains("mip"), "{error}");
    }
}
