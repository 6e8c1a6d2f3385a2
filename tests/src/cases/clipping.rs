//! Clipping: planes, regions and boxes, of the frame in the world and of shapes in their own space.

use volact_core::{
    Aabb, Clip, ClipRegion, Plane, Shape,
    glam::{DAffine3, DVec3},
};

use super::stock::{AXES, absorbed, around, rule, shape, through, usual, warm};
use crate::{
    case::{Case, Need, Topic},
    meshes::{bent, field},
    rig::{How, Scene},
    scene::{along_y, constant, greys, look, lut},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("clipping", &[Need::Shader("lut")]);
    planes(&mut topic);
    closed(&mut topic);
    regions(&mut topic);
    own(&mut topic);
    others(&mut topic);
    topic.done()
}

const CENTER: DVec3 = DVec3::new(3.0, 2.5, 3.5);

fn plane(point: DVec3, normal: DVec3) -> Plane {
    Plane::new(point, normal).expect("a plane")
}

fn cut(region: ClipRegion) -> Scene {
    let mut scene = around([shape()]);
    scene.desc.clip = Clip::new([region]);
    scene
}

fn planes(topic: &mut Topic) {
    for (name, axis) in AXES {
        for (side, sign) in [("front", 1.0), ("back", -1.0)] {
            topic.case(
                format!("plane_across_{name}_keeps_its_{side}"),
                "a plane keeps what its normal points to",
                move |rig| {
                    let region = ClipRegion::plane(plane(CENTER + 0.3 * axis, sign * axis));
                    rig.lattice("picture", &cut(region), &How::step(0.3)).map(|_| ())
                },
            );
        }
    }
    topic.case("plane_oblique", "a plane in any direction", |rig| {
        let region = ClipRegion::plane(plane(CENTER, DVec3::new(0.5, 0.8, -0.4)));
        rig.lattice("picture", &cut(region), &How::step(0.3)).map(|_| ())
    });
    topic.case("plane_through_the_picture", "a plane along the rays", |rig| {
        let region = ClipRegion::plane(plane(CENTER + DVec3::new(0.11, 0.0, 0.0), DVec3::new(1.0, 0.62, 0.0)));
        rig.lattice("picture", &cut(region), &How::step(0.3)).map(|_| ())
    });
    topic.case("plane_in_perspective", "clips are in the world, not on the screen", |rig| {
        let mut scene = through([shape()]);
        scene.desc.clip = Clip::new([ClipRegion::plane(plane(CENTER, DVec3::new(0.5, 0.8, -0.4)))]);
        rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
    });
}

/// A slab of constant opacity and what is left of it.
fn closed(topic: &mut Topic) {
    let slab = || lut(&constant(1.0, [2, 6, 2]), greys(&[(1.0, 1.0, 0.3)]), 1.0);
    let at = |y: f64, sign: f64| plane(DVec3::Y * y, DVec3::Y * sign);
    let makers: Vec<(&str, Clip, f64)> = vec![
        ("plane_keeps_its_front", Clip::new([ClipRegion::plane(at(2.3, 1.0))]), 3.7),
        ("plane_keeps_its_back", Clip::new([ClipRegion::plane(at(2.3, -1.0))]), 2.3),
        ("plane_cut_away", Clip::new([ClipRegion::plane(at(2.3, 1.0)).cut()]), 2.3),
        ("slab_between_two", Clip::new([ClipRegion::planes([at(1.2, 1.0), at(3.9, -1.0)])]), 2.7),
        ("slab_cut_out", Clip::new([ClipRegion::planes([at(1.2, 1.0), at(3.9, -1.0)]).cut()]), 3.3),
        ("two_regions", Clip::new([ClipRegion::plane(at(1.2, 1.0)), ClipRegion::plane(at(3.9, -1.0))]), 2.7),
        (
            "two_holes",
            Clip::new([
                ClipRegion::planes([at(0.5, 1.0), at(1.5, -1.0)]).cut(),
                ClipRegion::planes([at(3.0, 1.0), at(4.25, -1.0)]).cut(),
            ]),
            3.75,
        ),
        ("nothing_left", Clip::new([ClipRegion::plane(at(7.0, 1.0))]), 0.0),
        ("nothing_cut", Clip::new([ClipRegion::plane(at(-1.0, 1.0))]), 6.0),
        ("thin_sliver", Clip::new([ClipRegion::planes([at(2.0, 1.0), at(2.001, -1.0)])]), 0.001),
    ];
    for (name, clip, length) in makers {
        for own in [false, true] {
            let whose = if own { "shape" } else { "frame" };
            let clip = clip.clone();
            topic.case(
                format!("{name}_of_the_{whose}"),
                "what all regions keep is drawn, with its true length",
                move |rig| {
                    let shape = slab();
                    let mut scene = Scene::new([shape.clone()], along_y(0.9, 1.1));
                    if own {
                        shape.set_clip(clip.clone())
                    } else {
                        scene.desc.clip = clip.clone()
                    }
                    rig.pixel("length", &scene, &How::step(0.25), [absorbed(0.3, length); 4]).map(|_| ())
                },
            );
        }
    }
}

fn regions(topic: &mut Topic) {
    let bounds = Aabb::new(DVec3::new(1.1, 0.6, 1.3), DVec3::new(4.7, 3.9, 5.2));
    topic.case("box_kept", "a box keeps its inside", move |rig| {
        rig.lattice("picture", &cut(ClipRegion::crop(bounds)), &How::step(0.3)).map(|_| ())
    });
    topic.case("box_cut_out", "a box cut keeps the other side: rays leave and enter again", move |rig| {
        rig.lattice("picture", &cut(ClipRegion::crop(bounds).cut()), &How::step(0.3)).map(|_| ())
    });
    topic.case("corner_cut_out", "a corner is cut off", |rig| {
        let corner = Aabb::new(DVec3::new(2.6, -1.0, 3.1), DVec3::new(9.0, 2.2, 9.0));
        rig.lattice("picture", &cut(ClipRegion::crop(corner).cut()), &How::step(0.3)).map(|_| ())
    });
    topic.case("wedge_and_box", "several regions at once", move |rig| {
        let mut scene = cut(ClipRegion::crop(bounds));
        let wedge = [plane(CENTER, DVec3::new(1.0, 1.0, 0.0)), plane(CENTER, DVec3::new(1.0, -0.4, 0.3))];
        scene.desc.clip = scene.desc.clip.clone().with(ClipRegion::planes(wedge).cut());
        rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
    });
}

/// A shape's own clip is in its space and goes with it.
fn own(topic: &mut Topic) {
    topic.case("own_clip_goes_with_the_shape", "a shape's clip is in object space", |rig| {
        let shape = shape();
        shape.set_clip(Clip::new([ClipRegion::plane(plane(CENTER, DVec3::new(0.3, 1.0, 0.2)))]));
        shape.set_transform(DAffine3::from_rotation_z(0.6) * DAffine3::from_scale(DVec3::new(1.0, 1.6, -0.8)));
        rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
    });
    topic.case("own_clip_of_one_of_two", "a shape's clip cuts no other shape", |rig| {
        let (one, other) = (shape(), shape());
        one.set_clip(Clip::new([ClipRegion::plane(plane(CENTER, DVec3::Y))]));
        other.set_transform(DAffine3::from_translation(DVec3::X * 8.0));
        rig.lattice("picture", &around([one, other]), &How::step(0.3)).map(|_| ())
    });
    topic.case("own_and_the_frames", "both cut", |rig| {
        let shape = shape();
        shape.set_clip(Clip::new([ClipRegion::plane(plane(CENTER, DVec3::X))]));
        let mut scene = around([shape]);
        scene.desc.clip = Clip::new([ClipRegion::plane(plane(CENTER, -DVec3::Z))]);
        rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
    });
}

fn others(topic: &mut Topic) {
    for shader in ["mip", "average", "isosurface", "gradient"] {
        topic.needing(&[Need::Shader(shader)], format!("clips_{shader}"), "whatever the shader", move |rig| {
            let table = if shader == "isosurface" { "surfaces" } else { "lookup_table" };
            let look = volact_core::Appearance::new(shader).with(table, warm()).with("unit_distance", 4.0);
            let mut scene = around([Shape::around(&usual(), look)]);
            scene.desc.clip = Clip::new([ClipRegion::plane(plane(CENTER, DVec3::new(0.5, 0.8, -0.4)))]);
            rig.because("where a ray grazes a surface or the clip the tolerance is the change itself");
            rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
        });
    }
    topic.needing(&[Need::Shader("attribute")], "clips_numbers_of_meshes", "meshes, too", |rig| {
        let shape = field(bent([3, 4, 2], DVec3::new(6.0, 5.0, 7.0), 0.1), rule, warm(), 1.0);
        let mut scene = around([shape]);
        scene.desc.clip = Clip::new([ClipRegion::plane(plane(CENTER, DVec3::new(0.5, 0.8, -0.4)))]);
        rig.lattice("picture", &scene, &How::default()).map(|_| ())
    });
    topic.case("clips_volumes_in_meshes", "and volumes in meshes", |rig| {
        let look = look("lut", warm(), 1.0).with("volume", volact_core::VolumeTexture::new(&usual()));
        let mut scene = around([Shape::new(bent([2, 3, 2], DVec3::new(6.0, 5.0, 7.0), 0.12), look)]);
        scene.desc.clip = Clip::new([ClipRegion::crop(Aabb::new(DVec3::ONE, DVec3::splat(4.5))).cut()]);
        rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
    });
}
