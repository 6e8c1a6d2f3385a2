//! Determinism: one action, one scene, one thread or eight: the same bits.

use volact_core::{
    ScalarType, Shape, VolumeTexture,
    glam::{DAffine3, DVec3},
};

use super::stock::{around, shape, through, usual, warm, waves};
use crate::{
    case::{Case, Need, Topic},
    meshes::{bent, field},
    rig::{How, Scene},
    scene::{ball, lut, shaded},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("determinism", &[Need::Shader("lut")]);
    repeated(&mut topic);
    threads(&mut topic);
    defaults(&mut topic);
    variants(&mut topic);
    topic.done()
}

fn crowd() -> Scene {
    let far = shape();
    far.set_transform(DAffine3::from_translation(DVec3::new(1.0, 9.0, 0.5)));
    through([shape(), far])
}

fn repeated(topic: &mut Topic) {
    topic.case("drawn_twice", "one action, one scene, drawn twice", |rig| {
        let scene = crowd();
        let mut action = rig.action(&How::step(0.3))?;
        let first = rig.draw_with(&mut *action, &scene)?;
        for i in 0..3 {
            let again = rig.draw_with(&mut *action, &scene)?;
            rig.same(&format!("again {i}"), &scene, &again, &first);
        }
        Ok(())
    });
    topic.case("drawn_by_two_actions", "two actions of one kind", |rig| {
        let scene = crowd();
        let (a, b) = (rig.draw(&scene, &How::step(0.3))?, rig.draw(&scene, &How::step(0.3))?);
        rig.same("bits", &scene, &b, &a);
        Ok(())
    });
    topic.case("built_twice", "the same scene built anew: identities mean nothing", |rig| {
        let (one, other) = (crowd(), crowd());
        let (a, b) = (rig.draw(&one, &How::step(0.3))?, rig.draw(&other, &How::step(0.3))?);
        rig.same("bits", &one, &b, &a);
        Ok(())
    });
    topic.case("after_another_scene", "what was drawn before leaves nothing behind", |rig| {
        let scene = crowd();
        let fresh = rig.draw(&scene, &How::step(0.3))?;
        let mut action = rig.action(&How::step(0.3))?;
        rig.draw_with(&mut *action, &around([lut(&ball([20, 9, 11], ScalarType::U8), warm(), 0.2)]))?;
        let found = rig.draw_with(&mut *action, &scene)?;
        rig.same("bits", &scene, &found, &fresh);
        Ok(())
    });
}

fn threads(topic: &mut Topic) {
    let needs = [Need::Option("threads")];
    type Make = Box<dyn Fn() -> Scene + Send + Sync>;
    let scenes: Vec<(&str, &[Need], Make)> = vec![
        ("volume", &[], Box::new(crowd)),
        (
            "gradient",
            &[Need::Shader("gradient")],
            Box::new(|| through([shaded("gradient", &VolumeTexture::new(&usual()), warm(), 1.0)])),
        ),
        (
            "mesh",
            &[Need::Shader("attribute")],
            Box::new(|| {
                through([field(bent([3, 4, 2], DVec3::new(6.0, 5.0, 7.0), 0.1), super::stock::rule, warm(), 1.0)])
            }),
        ),
        (
            "mip",
            &[Need::Shader("mip")],
            Box::new(|| through([shaded("mip", &VolumeTexture::new(&usual()), warm(), 1.0)])),
        ),
    ];
    for (name, more, make) in scenes {
        let needs: Vec<_> = needs.iter().chain(more).cloned().collect();
        topic.needing(&needs, format!("threads_draw_one_{name}"), "any number of threads: the same bits", move |rig| {
            let scene = make();
            let one = rig.draw(&scene, &How::step(0.3).with("threads", 1i64))?;
            for threads in [2i64, 3, 8] {
                let several = rig.draw(&scene, &How::step(0.3).with("threads", threads))?;
                rig.same(&format!("{threads} threads"), &scene, &several, &one);
            }
            Ok(())
        });
    }
}

/// A default stated is bit-identical to the option left out.
fn defaults(topic: &mut Topic) {
    topic.case("options_stated", "a default stated is bit-identical to the option left out", |rig| {
        let scene = crowd();
        let plain = rig.draw(&scene, &How::bare())?;
        let declared = rig.subject().declaration.parameters.clone();
        let stated = declared.iter().filter_map(|p| Some((p.name.clone(), p.default.clone()?)));
        let how = stated.fold(How::bare(), |how, (name, value)| how.with(&name, value));
        let found = rig.draw(&scene, &how)?;
        rig.same("bits", &scene, &found, &plain);
        Ok(())
    });
    for shader in ["lut", "gradient", "mip", "xray"] {
        let name = format!("parameters_of_{shader}_stated");
        topic.needing(&[Need::Shader(shader)], name, "a parameter's default stated changes no bit", move |rig| {
            let make = || shaded(shader, &VolumeTexture::new(&usual()), warm(), 4.0);
            let (plain, stated) = (around([make()]), around([make()]));
            let entry = rig.registry().shaders().get(shader).cloned();
            for p in entry.iter().flat_map(|e| &e.declaration.parameters) {
                if let Some(value) = &p.default {
                    stated.shapes[0].set_parameter(&p.name, value.clone());
                }
            }
            let (a, b) = (rig.draw(&plain, &How::step(0.3))?, rig.draw(&stated, &How::step(0.3))?);
            rig.same("bits", &stated, &b, &a);
            Ok(())
        });
    }
}

fn variants(topic: &mut Topic) {
    topic.case("one_volume_or_two_alike", "data shared or copied: the same bits", |rig| {
        let data = usual();
        let pair = |a: Shape, b: Shape| {
            b.set_transform(DAffine3::from_translation(DVec3::X * 8.0));
            around([a, b])
        };
        let shared = pair(lut(&data, warm(), 1.0), lut(&data, warm(), 1.0));
        let copied = pair(lut(&data, warm(), 1.0), lut(&waves([7, 6, 8], ScalarType::F32), warm(), 1.0));
        let (a, b) = (rig.draw(&shared, &How::step(0.3))?, rig.draw(&copied, &How::step(0.3))?);
        rig.same("bits", &copied, &b, &a);
        Ok(())
    });
    topic.case("names_mean_nothing", "a shape under another name", |rig| {
        let scene = around([shape()]);
        let named = Scene::new([scene.shapes[0].named("other")], scene.desc.clone());
        let (a, b) = (rig.draw(&scene, &How::step(0.3))?, rig.draw(&named, &How::step(0.3))?);
        rig.same("bits", &named, &b, &a);
        Ok(())
    });
}
