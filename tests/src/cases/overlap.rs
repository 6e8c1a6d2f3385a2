//! Shapes in one place: extinctions add, and the order of drawing means nothing.

use volact_core::{
    ScalarType, Shape, Sphere, VolumeTexture,
    glam::{DAffine3, DVec3},
};

use super::stock::{around, rule, shape, through, usual, warm};
use crate::{
    case::{Case, Need, Topic},
    meshes::{bent, corner, field},
    rig::{How, Scene},
    scene::{along_y, colors, constant, greys, look, lut, shaded, volume},
    study::Expected,
};

/// Of numbers of a mesh beside samples of a volume.
const SECOND: Expected = Expected::order(2.0, [1.5, 2.6]);

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("overlap", &[Need::Shader("lut"), Need::Overlap]);
    closed(&mut topic);
    pictures(&mut topic);
    orders(&mut topic);
    flat(&mut topic);
    topic.done()
}

type Share = ([f64; 3], f64);
const RED: Share = ([1.0, 0.0, 0.0], 0.2);
const GREEN: Share = ([0.0, 1.0, 0.0], 0.5);
const BLUE: Share = ([0.0, 0.0, 1.0], 0.35);

/// σ = Σσᵢ and c = Σσᵢcᵢ/Σσᵢ.
fn mixed(shares: &[Share], length: f64) -> [f64; 4] {
    let sigma: f64 = shares.iter().map(|(_, a)| -(-a).ln_1p()).sum();
    let alpha = -(-sigma * length).exp_m1();
    let channel = |c: usize| shares.iter().map(|(color, a)| color[c] * -(-a).ln_1p()).sum::<f64>() / sigma * alpha;
    [channel(0), channel(1), channel(2), alpha]
}

fn slab((color, opacity): Share, cells: usize) -> Shape {
    lut(&constant(1.0, [cells; 3]), colors(&[(1.0, color, opacity)]), 1.0)
}

fn closed(topic: &mut Topic) {
    for (name, shares) in [("two", vec![RED, GREEN]), ("three", vec![RED, GREEN, BLUE]), ("twins", vec![GREEN, GREEN])]
    {
        topic.case(format!("{name}_coincide"), "extinctions add and mix the colours", move |rig| {
            let scene = Scene::new(shares.iter().map(|s| slab(*s, 2)), along_y(0.7, 0.7));
            rig.pixel("mixed", &scene, &How::step(0.25), mixed(&shares, 2.0)).map(|_| ())
        });
    }
    topic.case("partly", "where only one is, only one counts", |rig| {
        let (one, other) = (slab(RED, 2), slab(GREEN, 2));
        other.set_transform(DAffine3::from_translation(DVec3::Y * 0.7));
        let parts = [mixed(&[RED], 0.7), mixed(&[RED, GREEN], 1.3), mixed(&[GREEN], 0.7)];
        let wanted = super::stock::over(super::stock::over(parts[0], parts[1]), parts[2]);
        let scene = Scene::new([one, other], along_y(0.5, 0.5));
        for step in [0.23, 1.0, 5.0] {
            rig.pixel(&format!("step {step}"), &scene, &How::step(step), wanted)?;
        }
        Ok(())
    });
    topic.case("opaque_ones_share", "equal weights where several are infinite", |rig| {
        let scene = Scene::new([(RED.0, 1.0), (GREEN.0, 1.0), (BLUE.0, 1.0)].map(|s| slab(s, 1)), along_y(0.5, 0.5));
        let third = 1.0 / 3.0;
        rig.pixel("shared", &scene, &How::step(0.3), [third, third, third, 1.0]).map(|_| ())
    });
    topic.case("copies_are_one_of_thrice_the_extinction", "three copies are one with (1 − a)³", |rig| {
        let make = |a: f64| slab(([0.6; 3], a), 3);
        let three = around([make(0.2), make(0.2), make(0.2)]);
        let one = Scene::new([make(1.0 - 0.8f64.powi(3))], three.desc.clone());
        let (a, b) = (rig.draw(&three, &How::step(0.4))?, rig.draw(&one, &How::step(0.4))?);
        rig.alike("variant", &three, &a, &b)
    });
    topic.needing(
        &[Need::Shader("attribute")],
        "volume_in_a_mesh",
        "a mesh's numbers and a volume in one place",
        |rig| {
            // The corner is 3 long along y at (0.5, 0.5), the block lies at y = 1 to 2 in it.
            let corner = field(corner(4.0), |_| 0.0, colors(&[(0.0, RED.0, RED.1)]), 1.0);
            let block = slab(GREEN, 1);
            block.set_transform(DAffine3::from_translation(DVec3::Y));
            let ends = mixed(&[RED], 1.0);
            let wanted = super::stock::over(super::stock::over(ends, mixed(&[RED, GREEN], 1.0)), ends);
            rig.pixel("mixed", &Scene::new([corner, block], along_y(0.5, 0.5)), &How::step(0.25), wanted).map(|_| ())
        },
    );
}

fn turned() -> Shape {
    let other = volume([6, 7, 8], ScalarType::U8, |p| rule(p + DVec3::new(3.0, 1.0, 2.0)));
    let cold = colors(&[(10.0, [0.3, 0.5, 1.0], 0.3), (60.0, [0.1, 0.9, 0.6], 0.1), (90.0, [0.1, 0.2, 0.6], 0.0)]);
    let turned = lut(&other, cold, 0.7);
    turned.set_transform(DAffine3::from_translation(DVec3::new(2.0, 1.0, 1.5)) * DAffine3::from_rotation_x(0.5));
    turned
}

fn pictures(topic: &mut Topic) {
    for (name, step) in [("fine", 0.23), ("coarse", 1.1)] {
        topic.case(format!("two_interpenetrate_{name}"), "the lattice is one, whatever lies in it", move |rig| {
            rig.lattice("orthographic", &around([shape(), turned()]), &How::step(step))?;
            rig.lattice("perspective", &through([shape(), turned()]), &How::step(step)).map(|_| ())
        });
    }
    topic.case("volume_in_a_ball", "a volume in a mesh through another in a block", |rig| {
        let ball = Sphere::new(DVec3::splat(3.5), 2.6, 12).expect("a ball");
        let inner = Shape::new(
            ball,
            look("lut", greys(&[(0.0, 1.0, 0.0), (90.0, 0.5, 0.3)]), 1.0).with("volume", VolumeTexture::new(&usual())),
        );
        rig.lattice("picture", &around([turned(), inner]), &How::step(0.3)).map(|_| ())
    });
    topic.needing(&[Need::Shader("gradient")], "lit_and_plain", "a lit shape through a plain one", |rig| {
        let lit = shaded("gradient", &VolumeTexture::new(&usual()), warm(), 1.0);
        rig.lattice("picture", &around([lit, turned()]), &How::step(0.3)).map(|_| ())
    });
    topic.needing(
        &[Need::Shader("attribute")],
        "numbers_of_a_mesh_through_a_volume",
        "numbers of a mesh converge with the step",
        |rig| {
            let mesh = field(bent([3, 2, 3], DVec3::splat(5.0), 0.1), rule, warm(), 1.0);
            rig.slope("order", &around([mesh, turned()]), &How::default(), &[0.4, 0.2, 0.1, 0.05], SECOND)
        },
    );
    topic.expects(SECOND);
}

fn orders(topic: &mut Topic) {
    topic.case("order_of_drawing_means_nothing", "the order of drawing changes no bit", |rig| {
        let third = shape();
        third.set_transform(DAffine3::from_translation(DVec3::new(-1.0, 1.0, 2.0)));
        let scene = around([shape(), turned(), third]);
        let frame = rig.draw(&scene, &How::step(0.4))?;
        for order in [[1usize, 0, 2], [2, 1, 0], [1, 2, 0]] {
            let other = Scene::new(order.map(|i| scene.shapes[i].clone()), scene.desc.clone());
            let drawn = rig.draw(&other, &How::step(0.4))?;
            rig.same(&format!("{order:?}"), &other, &drawn, &frame);
        }
        Ok(())
    });
    topic.case(
        "shapes_apart_in_any_order",
        "shapes apart are composited by depth, not by the order of drawing",
        |rig| {
            let behind = shape();
            behind.set_transform(DAffine3::from_translation(DVec3::new(1.0, 9.0, 0.5)));
            let scene = around([behind, shape()]);
            let a = rig.lattice("as drawn", &scene, &How::step(0.4))?;
            let b = rig.draw(&scene.reversed(), &How::step(0.4))?;
            rig.same("reversed", &scene, &b, &a);
            Ok(())
        },
    );
}

/// Shapes that are one picture each lie over the rest in the order of `draw`.
fn flat(topic: &mut Topic) {
    topic.needing(
        &[Need::Shader("mip"), Need::Shader("average")],
        "pictures_in_the_order_of_drawing",
        "laid over in the order of drawing",
        |rig| {
            let data = VolumeTexture::new(&constant(1.0, [1, 1, 1]));
            let red = shaded("mip", &data, colors(&[(0.0, [1.0, 0.0, 0.0], 0.5)]), 1.0);
            let green = shaded("average", &data, colors(&[(0.0, [0.0, 1.0, 0.0], 0.25)]), 1.0);
            green.set_transform(DAffine3::from_translation(DVec3::Y * 7.0));
            let blue = lut(data.volume(), colors(&[(0.0, [0.0, 0.0, 1.0], 0.5)]), 1.0);
            let over = super::stock::over;
            let (r, g, b) = ([0.5, 0.0, 0.0, 0.5], [0.0, 0.25, 0.0, 0.25], [0.0, 0.0, 0.5, 0.5]);
            for (label, shapes, wanted) in [
                ("red, then green", [&blue, &red, &green], over(g, over(r, b))),
                ("green, then red", [&green, &blue, &red], over(r, over(g, b))),
            ] {
                let scene = Scene::new(shapes.map(Clone::clone), along_y(0.5, 0.5));
                rig.pixel(label, &scene, &How::step(0.3), wanted)?;
            }
            Ok(())
        },
    );
}
