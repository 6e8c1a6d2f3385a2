//! Grids and regions of interest: where samples lie, and what is cut away.

use volact_core::{
    Aabb, Block, Camera, Filter, FrameDesc, LookupTable, Roi, ScalarType, Shape, VolumeDesc, VolumeTexture, glam::DVec3,
};

use super::stock::{AXES, around, rule, usual, warm, waves};
use crate::{
    case::{Case, Need, Topic, Verdict},
    rig::{How, Rig, Scene},
    scene::{look, lut, lut_of, placed, shaded},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("grids", &[Need::Shader("lut")]);
    ramps(&mut topic);
    dims(&mut topic);
    data_rois(&mut topic);
    geometry_rois(&mut topic);
    nearest(&mut topic);
    super::orders::over_grids(&mut topic);
    topic.done()
}

/// Opaque grey of the value: what the eye meets first is the value there.
fn opaque_grey(top: f64) -> LookupTable {
    LookupTable::grey([0.0, top])
}

/// A picture along an axis, one world unit around the box 0 to `size` seen whole, 32 pixels.
fn along(axis: usize, size: DVec3) -> FrameDesc {
    let (middle, direction) = (size / 2.0, AXES[axis].1);
    let up = if axis == 2 { DVec3::Y } else { DVec3::Z };
    FrameDesc::new(Camera::orthographic(middle - direction * 20.0, middle, up, 1.17 * size.max_element()), 32, 32)
}

/// A ramp along one axis seen along another is the ramp, pixel by pixel.
fn ramps(topic: &mut Topic) {
    for ramp in 0..3 {
        for view in (0..3).filter(|v| *v != ramp) {
            let name = format!("ramp_along_{}_seen_along_{}", AXES[ramp].0, AXES[view].0);
            let about = "vertex-centred: the first and last sample lie on the faces, x runs fastest in memory";
            topic.case(name, about, move |rig| {
                let dims = [4, 3, 5];
                let top = (dims[ramp] - 1) as f64;
                let data = placed(VolumeDesc::new(dims, ScalarType::F32, 1), |p| p[ramp]);
                let size = DVec3::from_array(dims.map(|n| (n - 1) as f64));
                let scene = Scene::new([lut(&data, opaque_grey(top), 1.0)], along(view, size));
                let rays = rays(&scene.desc);
                let wanted = move |x: usize, y: usize| {
                    let p = rays(x, y);
                    let outside = (0..3).any(|a| a != view && !(0.0..=size[a]).contains(&p[a]));
                    Some(if outside {
                        [0.0; 4]
                    } else {
                        let v = p[ramp] / top;
                        [v, v, v, 1.0]
                    })
                };
                rig.because("the first segment is opaque, and the bound counts those of a whole ray");
                rig.closed("ramp", &scene, &How::step(0.25), &wanted).map(|_| ())
            });
        }
    }
}

/// Where rays of an orthographic camera begin.
fn rays(desc: &FrameDesc) -> impl Fn(usize, usize) -> DVec3 + use<> {
    let grid = desc.camera.rays(&desc.viewport());
    move |x, y| grid.as_ref().map_or(DVec3::NAN, |g| g.ray(x as f64 + 0.5, y as f64 + 0.5).origin)
}

fn lattice(rig: &mut Rig<'_>, shape: Shape) -> Verdict {
    rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
}

/// Any number of samples along any axis, one included.
fn dims(topic: &mut Topic) {
    for dims in [[2, 3, 5], [5, 2, 3], [3, 5, 2], [2, 2, 2], [17, 2, 9], [1, 4, 5], [5, 1, 4], [4, 5, 1], [33, 3, 3]] {
        let [x, y, z] = dims;
        let about = "any number of samples along an axis; an axis of one sample is constant";
        topic.case(format!("dims_{x}_{y}_{z}"), about, move |rig| {
            lattice(rig, lut(&waves(dims, ScalarType::F32), warm(), 1.0))
        });
    }
    for (name, spacing) in
        [("x", DVec3::new(2.0, 1.0, 0.5)), ("y", DVec3::new(0.5, 2.0, 1.0)), ("z", DVec3::new(1.0, 0.5, 2.0))]
    {
        topic.case(format!("spacing_widest_along_{name}"), "the extent is spacing × (N − 1)", move |rig| {
            let data = placed(VolumeDesc { spacing, ..VolumeDesc::new([5, 6, 4], ScalarType::F32, 1) }, rule);
            lattice(rig, lut(&data, warm(), 1.0))
        });
    }
}

fn data_rois(topic: &mut Topic) {
    let about = "a data ROI stays in place, its first and last voxel on its faces, and hides the rest";
    for (name, min, max) in [
        ("low_half", [0, 0, 0], [3, 2, 3]),
        ("high_half", [3, 3, 4], [6, 5, 7]),
        ("inner", [1, 1, 2], [5, 4, 6]),
        ("one_cell", [2, 3, 4], [3, 4, 5]),
        ("one_sample_of_x", [3, 0, 0], [3, 5, 7]),
        ("one_sample_of_y", [0, 2, 0], [6, 2, 7]),
        ("one_sample_of_z", [0, 0, 5], [6, 5, 5]),
    ] {
        topic.case(format!("data_roi_{name}"), about, move |rig| {
            let texture = VolumeTexture::new(&usual()).with_data_roi(Roi { min, max });
            lattice(rig, lut_of(&texture.expect("a part of the data"), warm(), 1.0))
        });
    }
    topic.case("data_roi_of_all_is_none", "a default stated changes no bit", |rig| {
        let data = usual();
        let whole = VolumeTexture::new(&data).with_data_roi(Roi::whole(data.dims())).expect("all of the data");
        let (plain, stated) = (around([lut(&data, warm(), 1.0)]), around([lut_of(&whole, warm(), 1.0)]));
        let (a, b) = (rig.draw(&plain, &How::step(0.3))?, rig.draw(&stated, &How::step(0.3))?);
        rig.same("bits", &plain, &b, &a);
        Ok(())
    });
    topic.case("data_roi_shows_nothing_beside_it", "rays that pass beside the ROI meet nothing", |rig| {
        let texture = VolumeTexture::new(&usual()).with_data_roi(Roi { min: [2, 0, 2], max: [4, 5, 4] });
        let shape = lut_of(&texture.expect("a part of the data"), opaque_grey(100.0), 1.0);
        let scene = Scene::new([shape], along(1, DVec3::new(6.0, 5.0, 7.0)));
        let rays = rays(&scene.desc);
        let wanted = move |x: usize, y: usize| {
            let p = rays(x, y);
            let inside = (2.0..=4.0).contains(&p.x) && (2.0..=4.0).contains(&p.z);
            (!inside).then_some([0.0; 4])
        };
        rig.closed("outside", &scene, &How::step(0.3), &wanted).map(|_| ())
    });
}

fn geometry_rois(topic: &mut Topic) {
    let about = "a geometry ROI says where the data lie: it moves and scales the texture, and clips";
    for (name, min, max) in [
        ("moved", [10.0, -3.0, 4.0], [16.0, 2.0, 11.0]),
        ("stretched_x", [0.0, 0.0, 0.0], [15.0, 5.0, 7.0]),
        ("stretched_y", [0.0, 0.0, 0.0], [6.0, 13.0, 7.0]),
        ("stretched_z", [0.0, 0.0, 0.0], [6.0, 5.0, 17.0]),
        ("unit", [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
    ] {
        topic.case(format!("geometry_roi_{name}"), about, move |rig| {
            let roi = Aabb::new(min.into(), max.into());
            let texture = VolumeTexture::new(&usual()).with_geometry_roi(roi).expect("a box");
            let unit = if name == "unit" { 0.15 } else { 1.0 };
            let scene = around([lut_of(&texture, warm(), unit)]);
            rig.lattice("picture", &scene, &How::step(0.3 * unit)).map(|_| ())
        });
    }
    let about = "what is drawn is the block ∩ the geometry ROI";
    for (name, offset, size) in [
        ("inside", [1.2, 0.7, 1.9], [3.1, 3.3, 4.4]),
        ("larger", [-3.0, -2.0, -1.0], [30.0, 30.0, 30.0]),
        ("across", [3.3, -2.0, 2.1], [9.0, 5.5, 9.0]),
    ] {
        topic.case(format!("block_{name}"), about, move |rig| {
            let appearance = look("lut", warm(), 1.0).with("volume", VolumeTexture::new(&usual()));
            lattice(rig, Shape::new(Block::new(offset.into(), size.into()).expect("a block"), appearance))
        });
    }
    topic.case("block_apart_shows_nothing", "a block that does not meet the ROI is empty", |rig| {
        let apart = look("lut", warm(), 1.0).with("volume", VolumeTexture::new(&usual()));
        let apart = Shape::new(Block::new(DVec3::splat(7.5), DVec3::ONE).expect("a block"), apart);
        let scene = around([apart, lut(&usual(), warm(), 1.0)]);
        let alone = Scene { shapes: vec![scene.shapes[0].clone()], desc: scene.desc.clone() };
        rig.closed("nothing", &alone, &How::step(0.3), &|_, _| Some([0.0; 4])).map(|_| ())
    });
}

/// The nearest sample's cell is a step wide, centred on the sample.
fn nearest(topic: &mut Topic) {
    for (axis, (name, _)) in AXES.into_iter().enumerate() {
        let about = "nearest: the sample whose index is nearest, half a voxel around it";
        topic.case(format!("nearest_along_{name}"), about, move |rig| {
            let view = (axis + 1) % 3;
            let dims = [5, 5, 5];
            let data = placed(VolumeDesc::new(dims, ScalarType::U8, 1), |p| 10.0 * p[axis]);
            let texture = VolumeTexture::new(&data).with_filter(Filter::Nearest);
            let scene = Scene::new([lut_of(&texture, opaque_grey(40.0), 1.0)], along(view, DVec3::splat(4.0)));
            let rays = rays(&scene.desc);
            let wanted = move |x: usize, y: usize| {
                let p = rays(x, y);
                let outside = (0..3).any(|a| a != view && !(0.0..=4.0).contains(&p[a]));
                let v = (p[axis] + 0.5).floor() / 4.0;
                Some(if outside { [0.0; 4] } else { [v, v, v, 1.0] })
            };
            rig.closed("steps", &scene, &How::step(0.25), &wanted).map(|_| ())
        });
    }
    topic.case("nearest_obliquely", "nearest agrees with the lattice from any side", |rig| {
        let texture = VolumeTexture::new(&usual()).with_filter(Filter::Nearest);
        let scene = around([shaded("lut", &texture, warm(), 1.0)]);
        rig.lattice("picture", &scene, &How::step(0.37)).map(|_| ())
    });
}
