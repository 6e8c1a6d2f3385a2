//! Slice plane sets: cuts through a geometry, drawn as planes of no thickness.

use std::sync::Arc;

use volact_core::{
    Appearance, Block, Clip, ClipRegion, Plane, ScalarType, Shape, SliceStyle, Sliced, Slices, VolumeTexture,
    glam::{DAffine3, DVec3},
};

use super::stock::{AXES, absorbed, around, laid, over, rule, through, usual, warm};
use crate::{
    case::{Case, Need, Topic},
    meshes::{bent, look as attribute, scalars_of},
    rig::{How, Scene},
    scene::{along_y, colors, constant, look, volume},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("slices", &[Need::Shader("lut")]);
    single(&mut topic);
    closed(&mut topic);
    several(&mut topic);
    topic.done()
}

const CENTER: DVec3 = DVec3::new(3.1, 2.3, 3.7);

fn plane(point: DVec3, normal: DVec3) -> Plane {
    Plane::new(point, normal).expect("a plane")
}

fn sliced(planes: Vec<Plane>, style: SliceStyle, with_volume: bool, appearance: Appearance) -> Shape {
    let block = Block::new(DVec3::ZERO, DVec3::new(6.0, 5.0, 7.0)).expect("a block");
    let slices = Slices { planes, style, volume: with_volume };
    Shape::new(Sliced::new(Arc::new(block), slices).expect("planes"), appearance)
}

fn usual_look() -> Appearance {
    look("lut", warm(), 1.0).with("volume", VolumeTexture::new(&usual()))
}

fn single(topic: &mut Topic) {
    for (style, name) in [(SliceStyle::Opaque, "opaque"), (SliceStyle::Blended, "blended")] {
        for (axis_name, axis) in AXES {
            let about = "where a ray meets a plane inside the geometry the value there is classified once";
            topic.case(format!("{name}_across_{axis_name}"), about, move |rig| {
                let shape = sliced(vec![plane(CENTER, axis)], style, false, usual_look());
                rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
            });
        }
        topic.case(format!("{name}_obliquely"), "planes in any direction, in perspective", move |rig| {
            let shape = sliced(vec![plane(CENTER, DVec3::new(0.5, 0.8, -0.4))], style, false, usual_look());
            rig.lattice("picture", &through([shape]), &How::step(0.3)).map(|_| ())
        });
        topic.case(format!("{name}_in_its_volume"), "with the volume around the planes", move |rig| {
            let shape = sliced(vec![plane(CENTER, DVec3::new(0.5, 0.8, -0.4))], style, true, usual_look());
            rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
        });
    }
}

/// A plane of no thickness in a medium of constant opacity.
fn closed(topic: &mut Topic) {
    const GREY: [f64; 3] = [0.5, 0.5, 0.5];
    for (name, style, wanted) in [
        ("opacity_is_not_looked_at", SliceStyle::Opaque, laid(GREY, 1.0)),
        ("opacity_as_it_stands", SliceStyle::Blended, laid(GREY, 0.3)),
    ] {
        topic.case(
            name,
            "an opaque plane has the table's colour, a blended one its opacity as it stands",
            move |rig| {
                let look = look("lut", colors(&[(1.0, GREY, 0.3)]), 7.0)
                    .with("volume", VolumeTexture::new(&constant(1.0, [6, 5, 7])));
                let shape = sliced(vec![plane(CENTER, DVec3::Y)], style, false, look);
                rig.pixel("plane", &Scene::new([shape], along_y(2.2, 3.3)), &How::step(0.25), wanted).map(|_| ())
            },
        );
    }
    topic.case("plane_in_a_medium", "the medium before the plane, the plane, the medium behind", |rig| {
        let look =
            look("lut", colors(&[(1.0, GREY, 0.3)]), 1.0).with("volume", VolumeTexture::new(&constant(1.0, [6, 5, 7])));
        let shape = sliced(vec![plane(CENTER, DVec3::Y)], SliceStyle::Blended, true, look);
        let part = |length| laid(GREY, absorbed(0.3, length));
        let wanted = over(over(part(2.3), laid(GREY, 0.3)), part(2.7));
        rig.pixel("colour", &Scene::new([shape], along_y(2.2, 3.3)), &How::step(0.25), wanted).map(|_| ())
    });
    topic.case("ray_in_the_plane_does_not_meet_it", "a ray in a plane does not meet it", |rig| {
        let look =
            look("lut", colors(&[(1.0, GREY, 0.3)]), 1.0).with("volume", VolumeTexture::new(&constant(1.0, [6, 5, 7])));
        let shape = sliced(vec![plane(DVec3::X * 2.0, DVec3::X)], SliceStyle::Opaque, false, look);
        rig.pixel("nothing", &Scene::new([shape], along_y(2.0, 3.3)), &How::step(0.25), [0.0; 4]).map(|_| ())
    });
}

fn several(topic: &mut Topic) {
    let three = || vec![plane(CENTER, DVec3::X), plane(CENTER, DVec3::Y), plane(CENTER, DVec3::Z)];
    for (style, name) in [(SliceStyle::Opaque, "opaque"), (SliceStyle::Blended, "blended")] {
        topic.case(format!("three_{name}"), "any number of planes, in the order of depth", move |rig| {
            rig.lattice("picture", &around([sliced(three(), style, false, usual_look())]), &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("order_of_planes_means_nothing", "the order in which planes are given changes no bit", move |rig| {
        let mut turned = three();
        turned.reverse();
        let scene = |planes| around([sliced(planes, SliceStyle::Blended, false, usual_look())]);
        let (plain, turned) = (scene(three()), scene(turned));
        let (a, b) = (rig.draw(&turned, &How::step(0.3))?, rig.draw(&plain, &How::step(0.3))?);
        rig.same("bits", &turned, &a, &b);
        Ok(())
    });
    topic.case("transformed", "planes are in object space and go with the shape", |rig| {
        let shape = sliced(vec![plane(CENTER, DVec3::new(0.2, 1.0, 0.1))], SliceStyle::Blended, true, usual_look());
        shape.set_transform(DAffine3::from_rotation_x(0.4) * DAffine3::from_scale(DVec3::new(1.3, 1.0, -0.7)));
        rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
    });
    topic.case("clipped", "clips cut planes, too", |rig| {
        let shape = sliced(vec![plane(CENTER, DVec3::Y)], SliceStyle::Opaque, false, usual_look());
        let mut scene = around([shape]);
        scene.desc.clip = Clip::new([ClipRegion::plane(plane(CENTER, DVec3::new(1.0, 0.1, 0.4)))]);
        rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
    });
    topic.case("without_a_number", "where a sample is NaN a plane is transparent, also an opaque one", |rig| {
        let odd = |p: DVec3| if p.distance(DVec3::splat(3.0)) < 1.1 { f64::NAN } else { rule(p) };
        let look =
            look("lut", warm(), 1.0).with("volume", VolumeTexture::new(&volume([7, 6, 8], ScalarType::F32, odd)));
        let shape = sliced(vec![plane(CENTER, DVec3::new(0.2, 1.0, 0.1))], SliceStyle::Opaque, false, look);
        rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
    });
    topic.needing(&[Need::Shader("attribute")], "through_a_mesh", "planes through the numbers of a mesh", |rig| {
        let mesh = bent([3, 4, 2], DVec3::new(6.0, 5.0, 7.0), 0.1);
        let scalars = scalars_of(&mesh, rule);
        let slices =
            Slices { planes: vec![plane(CENTER, DVec3::new(0.2, 1.0, 0.1))], style: SliceStyle::Opaque, volume: false };
        let sliced = Sliced::new(Arc::new(mesh), slices).expect("planes");
        rig.lattice("picture", &around([Shape::new(sliced, attribute(scalars, warm(), 1.0))]), &How::default())
            .map(|_| ())
    });
}
