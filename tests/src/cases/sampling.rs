//! Sampling: the lattice, the orders of its error, ends of segments, ends of rays, cuts and bricks.

use volact_core::{Block, Camera, FrameDesc, ParameterType, ParameterValue, Shape, VolumeTexture, glam::DVec3};

use super::{
    orders,
    stock::{PIXELS, around, shape, through, usual, warm},
};
use crate::{
    case::{Case, Need, Stop, Topic, Verdict},
    metrics::{max_error, wide},
    rig::{How, Rig, Scene},
    scene::{along_y, colors, greys, look, lut, one_ray, volume},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("sampling", &[Need::Shader("lut")]);
    steps(&mut topic);
    orders::over_steps(&mut topic);
    anchors(&mut topic);
    ends(&mut topic);
    parts(&mut topic);
    choices(&mut topic);
    topic.done()
}

/// Steps from a tenth of a voxel to longer than the volume.
fn steps(topic: &mut Topic) {
    for (step, unit) in [(0.1, 1.0), (0.5, 1.0), (1.0, 1.0), (2.0, 2.0), (5.0, 5.0), (40.0, 40.0)] {
        let name = format!("step_{}", step.to_string().replace('.', "_"));
        topic.needing(&[Need::Option("sample_distance")], name, "one lattice and one step a frame", move |rig| {
            let shape = || lut(&usual(), warm(), unit);
            let frame = rig.lattice("orthographic", &around([shape()]), &How::step(step))?;
            let found = frame.method.sample_distance;
            let kept = rig.subject().options.contains_key("sample_distance");
            rig.holds(
                "step",
                found == step || found == 0.0 || kept,
                &format!("the frame says {found}, asked for {step}"),
            );
            rig.lattice("perspective", &through([shape()]), &How::step(step)).map(|_| ())
        });
    }
    topic.case("step_by_default", "what an action chooses by itself it says, and keeps to", |rig| {
        rig.lattice("picture", &around([shape()]), &How::bare()).map(|_| ())
    });
}

/// Segment k covers [kh, (k+1)h] from the eye, or from the plane through the world's origin.
fn anchors(topic: &mut Topic) {
    // Red up to y = 5, then green: the colour of a segment tells where its middle lies.
    let shape = || {
        let red = [1.0, 0.0, 0.0];
        let green = [0.0, 1.0, 0.0];
        let data = volume([2, 11, 2], volact_core::ScalarType::F32, |p| p.y);
        lut(&data, colors(&[(0.0, red, 0.2), (5.0, red, 0.2), (5.0, green, 0.2), (10.0, green, 0.2)]), 1.0)
    };
    let eye = |y: f64| {
        let camera = Camera::perspective(DVec3::new(0.5, y, 0.5), DVec3::new(0.5, 0.0, 0.5), DVec3::Z, 1e-6);
        FrameDesc::new(camera, 1, 1)
    };
    let about = "segments begin at multiples of the step from the eye, or from the plane through the origin";
    for (name, desc, from) in
        [("the_origin", along_y(0.5, 0.5), 4.0), ("an_eye", eye(-1.5), 6.5), ("another_eye", eye(-3.0), 5.0)]
    {
        topic.needing(&[Need::Option("sample_distance")], format!("counted_from_{name}"), about, move |rig| {
            let scene = Scene::new([shape()], desc.clone());
            let frame = rig.draw(&scene, &How::step(4.0))?;
            let from = match frame.method.sample_distance {
                4.0 => from,
                // Without a lattice green begins where it does.
                0.0 => 5.0,
                _ => return Err(Stop::Skip("the step is not that of the case".into())),
            };
            let green = 0.8f64.powf(from) - 0.8f64.powi(10);
            let all = 1.0 - 0.8f64.powi(10);
            rig.is("green begins", &scene, &frame, &|_, _| Some([all - green, green, 0.0, all]))
        });
    }
    topic.case("rays_apart_share_the_lattice", "the lattice is the frame's, not the ray's or the shape's", |rig| {
        let moved = super::stock::shape();
        moved.set_transform(volact_core::glam::DAffine3::from_translation(DVec3::new(0.13, 0.27, 0.41)));
        rig.lattice("picture", &around([moved]), &How::step(1.3)).map(|_| ())
    });
    topic.case(
        "planes_carry_one_over_cosine",
        "at a wide angle the length of a segment is that along the ray",
        |rig| {
            let constant = lut(&crate::scene::constant(1.0, [6, 2, 6]), greys(&[(1.0, 1.0, 0.3)]), 1.0);
            let camera = Camera::perspective(DVec3::new(3.0, -2.0, 3.0), DVec3::new(3.0, 0.0, 3.0), DVec3::Z, 110.0);
            let scene = Scene::new([constant], FrameDesc::new(camera, PIXELS, PIXELS));
            rig.lattice("picture", &scene, &How::step(0.25)).map(|_| ())
        },
    );
}

/// Only a shape's own interval cuts segments, which then count their true length and midpoint.
fn ends(topic: &mut Topic) {
    for (name, y0, y1) in
        [("within_one_segment", 0.3, 0.6), ("across_one_border", 0.7, 1.2), ("over_several", 0.35, 3.85)]
    {
        let about = "segments that a shape cuts count their true length and midpoint";
        topic.needing(&[Need::Option("sample_distance")], format!("cut_{name}"), about, move |rig| {
            let data = volume([2, 5, 2], volact_core::ScalarType::F32, |p| p.y);
            let look =
                look("lut", greys(&[(0.0, 0.1, 0.1), (4.0, 0.9, 0.6)]), 1.0).with("volume", VolumeTexture::new(&data));
            let block = Block::new(DVec3::new(0.0, y0, 0.0), DVec3::new(1.0, y1 - y0, 1.0)).expect("a block");
            let scene = Scene::new([Shape::new(block, look)], along_y(0.5, 0.5));
            rig.lattice("ray", &scene, &How::step(1.0)).map(|_| ())
        });
    }
    let needs = [Need::Option("termination")];
    topic.needing(
        &needs,
        "ends_of_rays_are_bounded",
        "a ray ends where less than a stated part is left to see",
        |rig| {
            let scene = around([lut(&usual(), greys(&[(30.0, 0.3, 0.0), (60.0, 0.8, 0.9)]), 1.0)]);
            for bound in [0.001, 0.05] {
                let frame = rig.lattice(&format!("at {bound}"), &scene, &How::step(0.06).with("termination", bound))?;
                let (found, exact) = (frame.method.termination, frame.method.sample_distance == 0.0);
                rig.holds(&format!("said {bound}"), exact || found <= bound, &format!("the frame says {found}"));
            }
            rig.because("termination bounds what is left, and the light there is dimmer than white");
            rig.lattice("by default", &scene, &How::bare().with("sample_distance", 0.06).with("classification", "post"))
                .map(|_| ())
        },
    );
    topic.needing(
        &[Need::Option("skipping")],
        "skipping_changes_no_bit",
        "space skipping leaves the picture bit-identical",
        |rig| {
            let data = crate::scene::ball([24, 20, 22], volact_core::ScalarType::U8);
            let table = colors(&[(120.0, [1.0, 0.2, 0.1], 0.0), (140.0, [1.0, 0.9, 0.1], 0.3), (160.0, [0.1; 3], 0.0)]);
            for (label, scene) in [
                ("orthographic", around([lut(&data, table.clone(), 1.0)])),
                ("perspective", through([lut(&data, table, 1.0)])),
            ] {
                let how = How::bare().with("sample_distance", 0.4);
                let with = rig.draw(&scene, &how.clone().with("skipping", true))?;
                let without = rig.draw(&scene, &how.with("skipping", false))?;
                rig.same(label, &scene, &with, &without);
            }
            Ok(())
        },
    );
}

/// A shape that its user cuts, and one that she cuts into bricks.
fn parts(topic: &mut Topic) {
    let part = |min: DVec3, max: DVec3| {
        let look = look("lut", warm(), 1.0).with("volume", VolumeTexture::new(&usual()));
        Shape::new(Block::new(min, max - min).expect("a block"), look)
    };
    let size = DVec3::new(6.0, 5.0, 7.0);
    topic.case("cut_in_two", "a shape that its user cuts is what the reference draws of both parts", move |rig| {
        let scene = around([part(DVec3::ZERO, DVec3::new(6.0, 2.37, 7.0)), part(DVec3::new(0.0, 2.37, 0.0), size)]);
        rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
    });
    topic.needing(
        &[Need::Option("sample_distance")],
        "cuts_vanish_with_the_step",
        "both parts converge to the whole",
        move |rig| {
            let halves = |h: f64| {
                let scene =
                    around([part(DVec3::ZERO, DVec3::new(6.0, 2.37, 7.0)), part(DVec3::new(0.0, 2.37, 0.0), size)]);
                (scene, around([shape()]), How::step(h))
            };
            let mut errors = Vec::new();
            for h in [0.4, 0.1] {
                let (parts, whole, how) = halves(h);
                errors.push(max_error(&wide(&rig.draw(&parts, &how)?), &wide(&rig.draw(&whole, &how)?)));
            }
            let fixed = rig.subject().options.contains_key("sample_distance") || errors[0] < 1e-6;
            let message = format!("{:.1e} apart at 0.4, {:.1e} at 0.1, wanted at most a quarter", errors[0], errors[1]);
            rig.holds("apart", fixed || errors[1] <= errors[0] / 4.0, &message);
            Ok(())
        },
    );
    topic.case("bricks_of_one_shape_each", "a volume in eight parts, one shape each", move |rig| {
        let cut = DVec3::new(3.0, 2.0, 4.0);
        let brick = |i: usize| {
            let pick = |a: usize| if i >> a & 1 == 0 { (0.0, cut[a]) } else { (cut[a], size[a]) };
            let [x, y, z] = [pick(0), pick(1), pick(2)];
            part(DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1))
        };
        rig.lattice("picture", &around((0..8).map(brick)), &How::step(0.3)).map(|_| ())
    });
    topic.case("along_the_edges_of_blocks", "a ray in the border between two blocks is in one of them", |rig| {
        let half = |x: f64| {
            let look = look("lut", greys(&[(0.0, 1.0, 0.4)]), 1.0);
            let look = look.with("volume", VolumeTexture::new(&crate::scene::constant(1.0, [4, 2, 2])));
            Shape::new(Block::new(DVec3::new(x, 0.0, 0.0), DVec3::splat(2.0)).expect("a block"), look)
        };
        let desc = one_ray(DVec3::new(1.999_9, -5.0, 1.0), DVec3::new(1.999_9, 0.0, 1.0));
        let alpha = super::stock::absorbed(0.4, 2.0);
        rig.pixel("beside", &Scene::new([half(0.0), half(2.0)], desc), &How::step(0.25), [alpha; 4]).map(|_| ())
    });
}

/// Each way of sampling that an action declares.
fn choices(topic: &mut Topic) {
    let about = "whatever of its choices an action is set to, it draws the lattice that it says";
    topic.case("every_choice_of_every_option", about, every_choice);
}

fn every_choice(rig: &mut Rig<'_>) -> Verdict {
    let declared = rig.subject().declaration.parameters.clone();
    let choices: Vec<_> = declared.iter().filter(|p| p.types.contains(&ParameterType::Choice)).collect();
    let mut seen = 0;
    rig.because("a device may interpolate with 8 bits, and need not");
    for option in choices {
        for choice in &option.choices {
            let how = How::step(0.3).with(&option.name, ParameterValue::Choice(choice.clone()));
            let label = format!("{} {choice}", option.name);
            // A choice that this machine lacks is an error by name, and no silent substitute.
            match rig.lattice(&label, &through([shape()]), &how) {
                Ok(_) | Err(Stop::Skip(_)) => seen += 1,
                Err(Stop::Fail(why)) if why.contains(choice.as_str()) || why.contains(&option.name) => seen += 1,
                Err(other) => return Err(other),
            }
        }
    }
    let none = "it declares no option of several choices";
    if seen == 0 {
        Err(Stop::Skip(none.into()))
    } else {
        rig.lattice("as it is", &through([shape()]), &How::step(0.3)).map(|_| ())
    }
}
