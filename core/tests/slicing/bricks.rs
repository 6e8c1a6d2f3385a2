//! A volume cut into bricks by its user, and what clips leave.

use volact_core::{
    Aabb, Appearance, Clip, Plane, Roi, ScalarType, Shape, Volume, VolumeDesc, VolumeTexture,
    geometry::ClipRegion,
    glam::{DAffine3, DVec3},
    slicing::{Body, Order, Rate, Sampling, SamplingMode, Slicing},
};

use super::common::{along, bent, each, from_eye, solids, split_block};

fn volume() -> Volume {
    Volume::new(VolumeDesc::new([9; 3], ScalarType::U8, 1), vec![0u8; 729]).unwrap()
}

/// Eight bricks with a voxel in common, whose regions meet.
fn bricks(volume: &Volume) -> Vec<Shape> {
    let brick = |i: usize| {
        let min = [0, 1, 2].map(|a| 4 * (i >> a & 1));
        let texture = VolumeTexture::new(volume).with_data_roi(Roi { min, max: min.map(|v| v + 4) }).unwrap();
        let shape = Shape::around_texture(&texture, Appearance::new("simple"));
        shape.set_transform(bent());
        shape
    };
    (0..8).map(brick).collect()
}

/// The planes of bricks are those of the whole, to the last bit, and their polygons cover the
/// same area.
#[test]
fn bricks_share_the_planes_of_the_whole() {
    let data = volume();
    let whole = Shape::around(&data, Appearance::new("simple"));
    whole.set_transform(bent());
    let center = bent().transform_point3(DVec3::splat(4.0));
    for frame in [along(DVec3::new(1.0, 2.0, -1.0)), from_eye(center - DVec3::Y * 20.0, center)] {
        for mode in [SamplingMode::ViewportAligned, SamplingMode::AxisAligned] {
            let sampling = Sampling { mode, rate: Rate::Distance(0.37), ..Sampling::default() };
            let mut areas = std::collections::BTreeMap::<i64, [f64; 2]>::new();
            for (which, shapes) in [vec![whole.clone()], bricks(&data)].iter().enumerate() {
                each(shapes, &frame, &sampling, Order::FrontToBack, |_, k, p| {
                    areas.entry(k).or_default()[which] += p.faces().iter().map(|f| p.area(f)).sum::<f64>();
                })
                .unwrap();
            }
            assert!(areas.len() > 10);
            assert!(areas.values().all(|[a, b]| (a - b).abs() < 1e-9), "{areas:?}");
        }
    }
}

/// A ray's way through the whole is its way through the bricks, in order of depth also within a slab.
#[test]
fn rays_meet_bricks_one_after_another() {
    let made = solids(&bricks(&volume()));
    let center = bent().transform_point3(DVec3::splat(4.0));
    let frame = from_eye(center + DVec3::new(9.0, -14.0, 6.0), center);
    let rays = frame.camera.rays(&frame.viewport()).unwrap();
    let sampling = Sampling { rate: Rate::Distance(0.9), ..Sampling::default() };
    let slicing = Slicing::new(made.iter().collect(), &frame, &sampling).unwrap();
    for pixel in 0..40 {
        let ray = rays.ray((7 * pixel % 64) as f64 + 0.5, (11 * pixel % 64) as f64 + 0.5);
        let (mut sweep, mut last) = (slicing.sweep(Order::FrontToBack), None);
        while let Some(slice) = sweep.next_slice() {
            let solid = &made[slice.shape];
            let Body::Block(block) = solid.body() else { panic!("a brick is a block") };
            let to = solid.to_object();
            let inside = block.clip_line(to.transform_point3(ray.origin), to.transform_vector3(ray.direction));
            let (Some(t), Some(slab)) = (inside, slice.levels().cut(&ray, slice.slab)) else { continue };
            let (start, end) = (t[0].max(slab[0]), t[1].min(slab[1]));
            if end - start > 1e-9 {
                assert!(last.is_none_or(|l: f64| (l - start).abs() < 1e-9), "{last:?} {start}");
                last = Some(end);
            }
        }
    }
}

/// Clips in object and world space and a volume's region leave the same of a block and of its cells,
/// and of both what lies in them.
#[test]
fn clips_leave_the_same_of_blocks_and_cells() {
    let plane = |p: [f64; 3], n: [f64; 3]| Plane::new(p.into(), n.into()).unwrap();
    let region = ClipRegion::planes([
        plane([0.4; 3], [1.0, 0.2, 0.1]),
        plane([0.7; 3], [-0.3, -1.0, 0.2]),
        plane([0.2; 3], [0.1, 0.3, 1.0]),
    ]);
    let world = Clip::new([ClipRegion::plane(plane([0.5, 0.5, 0.6], [0.2, -0.4, -1.0]))]);
    let frame = along(DVec3::new(1.0, -0.7, 0.4)).with_clip(world.clone());
    let data = Volume::new(VolumeDesc::new([3; 3], ScalarType::U8, 1), vec![0u8; 27]).unwrap();
    let inner = Aabb::new(DVec3::new(0.1, -0.5, 0.0), DVec3::new(2.0, 0.9, 0.95));
    let texture = VolumeTexture::new(&data).with_geometry_roi(inner).unwrap();
    for clip in [Clip::new([region.clone()]), Clip::new([region.cut()])] {
        let appearance = || Appearance::new("simple").with("volume", texture.clone());
        let block = Shape::new(super::common::unit_block(), appearance());
        let cells = Shape::new(split_block(2, |_| DVec3::ZERO), appearance());
        let mut areas = [Vec::new(), Vec::new()];
        for (areas, shape) in areas.iter_mut().zip([block, cells]) {
            shape.set_clip(clip.clone());
            shape.set_transform(DAffine3::from_translation(DVec3::splat(0.01)));
            let sampling = Sampling { rate: Rate::Distance(0.02), ..Sampling::default() };
            each(&[shape], &frame, &sampling, Order::FrontToBack, |_, k, p| {
                let area: f64 = p.faces().iter().map(|f| p.area(f)).sum();
                if area > 0.0 {
                    areas.push((k, area));
                }
                for v in p.faces().iter().flat_map(|f| p.vertices(f)) {
                    assert!(v.object.cmpge(inner.min - 1e-9).all() && v.object.cmple(inner.max + 1e-9).all());
                    assert!(world.regions()[0].bounding_planes()[0].distance(v.position) > -1e-9);
                    assert!((v.texture - (v.object - inner.min) / inner.size()).length() < 1e-12);
                }
            })
            .unwrap();
        }
        let [block, cells] = areas;
        assert!(block.len() > 10 && block.len() == cells.len(), "{} {}", block.len(), cells.len());
        assert!(block.iter().zip(&cells).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-9));
    }
}
