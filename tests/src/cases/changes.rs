//! Parameters changed between frames: what is drawn is what is there now, never what was.

use std::sync::{
    Arc,
    atomic::{AtomicU8, Ordering},
};

use volact_core::{
    Aabb, Block, Buffer, Bulk, Clip, ClipRegion, Filter, Opaque, OpaqueDepth, Plane, Roi, ScalarType, Shape, Volume,
    VolumeDesc, VolumeTexture,
    glam::{DAffine3, DVec3},
};

use super::stock::{PIXELS, around, rule, usual, warm, waves};
use crate::{
    case::{Case, Need, Topic},
    meshes::{bent, field, scalars_of},
    rig::{How, Rig, Scene},
    scene::{encode, greys, lut, values},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("changes", &[Need::Shader("lut")]);
    shapes(&mut topic);
    frames(&mut topic);
    data(&mut topic);
    crowds(&mut topic);
    topic.done()
}

/// A change of a scene.
type Change = fn(&mut Scene);

/// Draws, changes, draws again and back, and compares with what a fresh action draws.
fn changed(rig: &mut Rig<'_>, make: fn() -> Scene, change: Change) -> Result<(), crate::case::Stop> {
    let how = How::step(0.3);
    let mut scene = make();
    let mut action = rig.action(&how)?;
    let before = rig.draw_with(&mut *action, &scene)?;
    change(&mut scene);
    let after = rig.draw_with(&mut *action, &scene)?;
    let fresh = rig.draw(&scene, &how)?;
    rig.same("as a fresh action draws it", &scene, &after, &fresh);
    rig.holds("something changed", before.color != after.color, "the change is seen");
    let again = rig.draw_with(&mut *action, &scene)?;
    rig.same("and once more", &scene, &again, &fresh);
    Ok(())
}

fn plain() -> Scene {
    around([lut(&usual(), warm(), 1.0)])
}

fn other_table() -> volact_core::LookupTable {
    greys(&[(10.0, 0.9, 0.4), (70.0, 0.2, 0.0)])
}

fn texture(scene: &Scene) -> VolumeTexture {
    scene.shapes[0].state().volume().expect("a volume").clone()
}

fn shapes(topic: &mut Topic) {
    let changes: Vec<(&str, Change)> = vec![
        ("table", |s| s.shapes[0].set_parameter("lookup_table", other_table())),
        ("table_pre_interpolated", |s| s.shapes[0].set_parameter("lookup_table", warm().pre_interpolated())),
        ("unit_distance", |s| s.shapes[0].set_parameter("unit_distance", 0.4)),
        ("transform", |s| s.shapes[0].set_transform(DAffine3::from_rotation_z(0.5))),
        ("volume", |s| s.shapes[0].set_parameter("volume", VolumeTexture::new(&waves([5, 9, 6], ScalarType::U8)))),
        ("data_roi", |s| {
            let part = texture(s).with_data_roi(Roi { min: [1, 1, 1], max: [4, 4, 5] });
            s.shapes[0].set_parameter("volume", part.expect("a part"));
        }),
        ("geometry_roi", |s| {
            let moved = texture(s).with_geometry_roi(Aabb::new(DVec3::ONE, DVec3::new(5.0, 4.0, 8.0)));
            s.shapes[0].set_parameter("volume", moved.expect("a box"));
        }),
        ("filter", |s| s.shapes[0].set_parameter("volume", texture(s).with_filter(Filter::Nearest))),
        ("geometry", |s| s.shapes[0].set_geometry(Block::new(DVec3::ONE, DVec3::splat(3.0)).expect("a block"))),
        ("geometry_to_a_mesh", |s| s.shapes[0].set_geometry(bent([2, 2, 2], DVec3::new(5.0, 3.5, 6.0), 0.1))),
        ("clip", |s| {
            let plane = Plane::new(DVec3::splat(3.0), DVec3::new(0.3, 1.0, 0.2)).expect("a plane");
            s.shapes[0].set_clip(Clip::new([ClipRegion::plane(plane)]));
        }),
    ];
    for (name, change) in changes {
        topic.case(name, "after a change the frame is what a fresh action draws", move |rig| {
            changed(rig, plain, change)
        });
    }
    for shader in ["mip", "average", "gradient"] {
        topic.needing(
            &[Need::Shader(shader)],
            format!("shader_to_{shader}"),
            "switching a shader, and back",
            move |rig| {
                let how = How::step(0.3);
                let scene = plain();
                let mut action = rig.action(&how)?;
                let first = rig.draw_with(&mut *action, &scene)?;
                scene.shapes[0].set_shader(shader);
                let (switched, fresh) = (rig.draw_with(&mut *action, &scene)?, rig.draw(&scene, &how)?);
                rig.same("switched", &scene, &switched, &fresh);
                scene.shapes[0].set_shader("lut");
                let back = rig.draw_with(&mut *action, &scene)?;
                rig.same("and back", &scene, &back, &first);
                Ok(())
            },
        );
    }
    topic.needing(&[Need::Shader("gradient")], "number_of_a_shader", "a number that a shader reads", |rig| {
        let make = || around([Shape::around(&usual(), crate::scene::look("gradient", warm(), 1.0))]);
        changed(rig, make, |s| s.shapes[0].set_parameter("ambient", 0.9))
    });
    topic.needing(&[Need::Shader("attribute")], "numbers_of_a_mesh", "the numbers at the vertices of a mesh", |rig| {
        let make = || around([field(bent([2, 3, 2], DVec3::splat(5.0), 0.1), rule, warm(), 1.0)]);
        changed(rig, make, |s| {
            let mesh = bent([2, 3, 2], DVec3::splat(5.0), 0.1);
            s.shapes[0].set_parameter("scalars", scalars_of(&mesh, |p| 100.0 - rule(p)));
        })
    });
}

fn frames(topic: &mut Topic) {
    let changes: Vec<(&str, Change)> = vec![
        ("camera", |s| s.desc.camera = super::stock::through(s.shapes.clone()).desc.camera),
        ("size", |s| (s.desc.width, s.desc.height) = (19, 43)),
        ("clip_of_the_frame", |s| {
            let plane = Plane::new(DVec3::splat(3.0), DVec3::new(0.3, 1.0, 0.2)).expect("a plane");
            s.desc.clip = Clip::new([ClipRegion::plane(plane)]);
        }),
        ("opaque_picture", |s| {
            let depth = OpaqueDepth::Distance(vec![15.0; PIXELS * PIXELS].into());
            s.desc.opaque = Some(Opaque { color: None, depth });
        }),
    ];
    for (name, change) in changes {
        topic.case(name, "another frame of the same shapes", move |rig| changed(rig, plain, change));
    }
    topic.needing(&[Need::Option("sample_distance")], "option", "an option set is as an action made with it", |rig| {
        let scene = plain();
        if rig.subject().options.contains_key("sample_distance") {
            return Err(crate::case::Stop::Skip("set by the user".into()));
        }
        let mut action = rig.action(&How::step(0.3))?;
        rig.draw_with(&mut *action, &scene)?;
        let set = action.set_option("sample_distance", 0.7.into());
        rig.holds("set", set.is_ok(), "the option can be set between frames");
        let (after, fresh) = (rig.draw_with(&mut *action, &scene)?, rig.draw(&scene, &How::step(0.7))?);
        rig.same("as made with it", &scene, &after, &fresh);
        Ok(())
    });
}

/// The application's own memory, changed in place.
struct Shared(Vec<AtomicU8>);

impl Bulk for Shared {
    #[expect(unsafe_code, reason = "atomic bytes seen as bytes")]
    fn bytes(&self) -> &[u8] {
        // SAFETY: AtomicU8 has the layout of u8, and the case writes only while nobody reads.
        unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len()) }
    }
}

fn data(topic: &mut Topic) {
    topic.case("touched_data", "data changed in place are announced by touch, and drawn as they now are", |rig| {
        let dims = [24usize, 20, 22];
        let coarse = |p: DVec3| rule(p / 3.0);
        let bytes = encode(ScalarType::U8, &values(dims, coarse));
        let memory = Arc::new(Shared(bytes.iter().map(|_| 0u8.into()).collect()));
        let data =
            Volume::new(VolumeDesc::new(dims, ScalarType::U8, 1), Buffer::shared(memory.clone())).expect("a volume");
        let scene = around([lut(&data, warm(), 1.0)]);
        let mut action = rig.action(&How::step(0.3))?;
        rig.draw_with(&mut *action, &scene)?;
        memory.0.iter().zip(&bytes).for_each(|(to, from)| to.store(*from, Ordering::Relaxed));
        data.touch();
        let after = rig.draw_with(&mut *action, &scene)?;
        let fresh = crate::scene::volume(dims, ScalarType::U8, coarse);
        let fresh = Scene::new([lut(&fresh, warm(), 1.0)], scene.desc.clone());
        let wanted = rig.draw(&fresh, &How::step(0.3))?;
        rig.same("as it now is", &fresh, &after, &wanted);
        Ok(())
    });
    topic.case("parameter_removed", "a parameter removed and set again is as before", |rig| {
        let scene = plain();
        let mut action = rig.action(&How::step(0.3))?;
        let before = rig.draw_with(&mut *action, &scene)?;
        scene.shapes[0].set_parameter("component", 0i64);
        let stated = rig.draw_with(&mut *action, &scene)?;
        scene.shapes[0].remove_parameter("component");
        let after = rig.draw_with(&mut *action, &scene)?;
        rig.same("stated", &scene, &stated, &before);
        rig.same("removed", &scene, &after, &before);
        Ok(())
    });
}

/// Shapes that come and go.
fn crowds(topic: &mut Topic) {
    topic.case("shapes_come_and_go", "a frame shows the shapes drawn, whatever was drawn before", |rig| {
        let how = How::step(0.3);
        let other = lut(&waves([4, 5, 4], ScalarType::U16), other_table(), 0.5);
        other.set_transform(DAffine3::from_translation(DVec3::X * 8.0));
        let both = around([lut(&usual(), warm(), 1.0), other]);
        let one = Scene { shapes: vec![both.shapes[0].clone()], desc: both.desc.clone() };
        let mut action = rig.action(&how)?;
        for (label, scene) in [("one", &one), ("both", &both), ("one again", &one), ("both again", &both)] {
            let (found, wanted) = (rig.draw_with(&mut *action, scene)?, rig.draw(scene, &how)?);
            rig.same(label, scene, &found, &wanted);
        }
        Ok(())
    });
    topic.case("a_copy_is_a_shape_of_its_own", "a shape's copy changes by itself", |rig| {
        let scene = plain();
        let copy = scene.shapes[0].named("copy");
        let mut action = rig.action(&How::step(0.3))?;
        let before = rig.draw_with(&mut *action, &scene)?;
        copy.set_parameter("lookup_table", other_table());
        let after = rig.draw_with(&mut *action, &scene)?;
        rig.same("the first", &scene, &after, &before);
        let copied = Scene::new([copy], scene.desc.clone());
        let (found, wanted) = (rig.draw_with(&mut *action, &copied)?, rig.draw(&copied, &How::step(0.3))?);
        rig.same("the copy", &copied, &found, &wanted);
        Ok(())
    });
}
