//! Transforms: from object space to the world, also where it mirrors, shears or is far away.

use volact_core::{
    Camera, FrameDesc, ScalarType, Shape, VolumeDesc, VolumeTexture,
    glam::{DAffine3, DMat3, DVec3},
};

use super::stock::{AXES, around, from, rule, shape, through, usual, warm};
use crate::{
    case::{Case, Need, Topic},
    rig::{How, Scene},
    scene::{look, lut, placed, shaded},
    study::Expected,
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("transforms", &[Need::Shader("lut")]);
    single(&mut topic);
    lit(&mut topic);
    placements(&mut topic);
    scales(&mut topic);
    permuted(&mut topic);
    topic.done()
}

/// A mirror, a shear and different scales at once.
fn skewed() -> DAffine3 {
    DAffine3::from_translation(DVec3::new(0.4, -0.2, 0.1))
        * DAffine3::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), 0.6)
        * DAffine3::from_mat3(DMat3::from_cols(
            DVec3::new(-1.0, 0.2, 0.0),
            DVec3::new(0.1, 0.9, 0.3),
            DVec3::new(0.0, 0.0, 1.2),
        ))
}

fn shear(column: usize, row: usize) -> DAffine3 {
    let mut m = DMat3::IDENTITY;
    m.col_mut(column)[row] = 0.7;
    DAffine3::from_mat3(m)
}

fn all() -> Vec<(String, DAffine3)> {
    let mut all = vec![
        ("translated".into(), DAffine3::from_translation(DVec3::new(3.0, -7.0, 11.0))),
        ("skewed".into(), skewed()),
        ("sheared_xy".into(), shear(0, 1)),
        ("sheared_yz".into(), shear(1, 2)),
        ("sheared_zx".into(), shear(2, 0)),
    ];
    for (name, axis) in AXES {
        all.push((format!("turned_about_{name}"), DAffine3::from_axis_angle(axis, 0.7)));
        all.push((format!("mirrored_along_{name}"), DAffine3::from_scale(DVec3::ONE - 2.0 * axis)));
        all.push((format!("scaled_along_{name}"), DAffine3::from_scale(DVec3::ONE + 0.8 * axis)));
    }
    all
}

fn single(topic: &mut Topic) {
    for (name, map) in all() {
        topic.case(name, "a transform takes the shape from object space to the world", move |rig| {
            let shape = shape();
            shape.set_transform(map);
            rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("seen_in_perspective", "also in perspective", |rig| {
        let shape = shape();
        shape.set_transform(skewed());
        rig.lattice("picture", &through([shape]), &How::step(0.3)).map(|_| ())
    });
}

/// Gradients go to the world through the inverse transpose.
fn lit(topic: &mut Topic) {
    for (name, map) in [
        ("skewed", skewed()),
        ("sheared", shear(0, 1)),
        ("stretched", DAffine3::from_scale(DVec3::new(1.0, 2.5, 0.6))),
        ("mirrored", DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0))),
    ] {
        let about = "gradients are in world units, through the inverse transpose";
        topic.needing(&[Need::Shader("gradient")], format!("lit_{name}"), about, move |rig| {
            let look =
                look("gradient", warm(), 1.0).with("light", "directional").with("lightdir", DVec3::new(0.3, -0.8, 0.5));
            let shape = Shape::around(&usual(), look);
            shape.set_transform(map);
            rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
        });
    }
}

/// What a volume brings as its place is what a transform would do.
fn placements(topic: &mut Topic) {
    topic.case("placement_is_a_transform", "a loaded volume brings its extent and an affine to the world", |rig| {
        let desc = VolumeDesc { placement: skewed(), ..VolumeDesc::new([7, 6, 8], ScalarType::F32, 1) };
        let brought = lut(&placed(desc, rule), warm(), 1.0);
        let set = shape();
        set.set_transform(skewed());
        let scene = around([brought]);
        let other = Scene::new([set], scene.desc.clone());
        let (a, b) = (rig.draw(&scene, &How::step(0.3))?, rig.draw(&other, &How::step(0.3))?);
        rig.same("bits", &scene, &a, &b);
        Ok(())
    });
    topic.case("transform_replaces_placement", "a transform that is set replaces the volume's place", |rig| {
        let desc = VolumeDesc { placement: skewed(), ..VolumeDesc::new([7, 6, 8], ScalarType::F32, 1) };
        let moved = lut(&placed(desc, rule), warm(), 1.0);
        moved.set_transform(DAffine3::from_rotation_z(0.4));
        rig.lattice("picture", &around([moved]), &How::step(0.3)).map(|_| ())
    });
}

/// A scene at any scale and anywhere looks as it does at 1.
fn scales(topic: &mut Topic) {
    for (name, scale) in [("nano", 1e-9), ("milli", 1e-3), ("mega", 1e6)] {
        let about = "uniform scale of scene, unit and step changes nothing";
        topic.case(format!("scale_{name}"), about, move |rig| {
            let shape = lut(&usual(), warm(), scale);
            shape.set_transform(DAffine3::from_scale(DVec3::splat(scale)));
            rig.lattice("picture", &around([shape]), &How::step(0.3 * scale)).map(|_| ())
        });
        topic.expects(Expected::NoChange);
    }
    topic.case("far_away", "positions are f64 in descriptions and local after: a scene at 1e7 looks as at 0", |rig| {
        let far = DVec3::new(1e7, -2e7, 3e6);
        let shape = shape();
        shape.set_transform(DAffine3::from_translation(far) * DAffine3::from_rotation_z(0.4));
        rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
    });
    topic.case("far_from_the_eye", "also where the eye is far away", |rig| {
        let scene = around([shape()]);
        let center = DVec3::new(3.0, 2.5, 3.5);
        let eye = center + DVec3::new(0.62, -1.0, 0.55) * 1e5;
        let desc = FrameDesc::new(Camera::perspective(eye, center, DVec3::Z, 0.007), 32, 32);
        rig.lattice("picture", &scene.seen(desc), &How::step(0.3)).map(|_| ())
    });
}

/// Data with axes swapped under a transform that swaps them back are the same data.
fn permuted(topic: &mut Topic) {
    for (name, order) in [("yxz", [1usize, 0, 2]), ("zyx", [2, 1, 0]), ("yzx", [1, 2, 0])] {
        let about = "data with their axes swapped, under the transform that swaps them back, are the same data";
        topic.case(format!("axes_{name}"), about, move |rig| {
            let dims = [7usize, 6, 8];
            let swapped = order.map(|a| dims[a]);
            let back = |p: DVec3| {
                let mut q = DVec3::ZERO;
                order.iter().enumerate().for_each(|(i, &a)| q[a] = p[i]);
                q
            };
            let data = placed(VolumeDesc::new(swapped, ScalarType::F32, 1), move |p| rule(back(p)));
            let shape = shaded("lut", &VolumeTexture::new(&data), warm(), 1.0);
            let axes = [DVec3::X, DVec3::Y, DVec3::Z];
            let [x, y, z] = order.map(|a| axes[a]);
            shape.set_transform(DAffine3::from_mat3(DMat3::from_cols(x, y, z)));
            let plain = from([self::shape()], DVec3::new(0.62, -1.0, 0.55));
            let scene = Scene::new([shape], plain.desc.clone());
            let (a, b) = (rig.draw(&scene, &How::step(0.3))?, rig.draw(&plain, &How::step(0.3))?);
            rig.alike("variant", &scene, &a, &b)
        });
    }
}
