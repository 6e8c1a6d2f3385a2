//! Every shader that comes with Volact, and one of the suite's own, by its source.

use std::sync::Arc;

use volact_core::{
    Appearance, Camera, Compositing, Declaration, FrameDesc, LookupTable, ParameterDecl, ParameterType, ScalarType,
    ShaderEntry, ShaderText, Shape, Volume, VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::Kind,
};

use super::stock::{absorbed, around, laid, rule, through, usual, warm};
use crate::{
    case::{Case, Need, Stop, Topic},
    rig::{How, Rig, Scene},
    scene::{along_y, colors, constant, greys, look, volume},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("shaders", &[]);
    flat(&mut topic);
    lights(&mut topic);
    surfaces(&mut topic);
    several(&mut topic);
    sources(&mut topic);
    topic.done()
}

/// Values 10 to 30 along the ray over a length of 4.
fn ramp() -> Volume {
    volume([2, 5, 2], ScalarType::F32, |p| 10.0 + 5.0 * p.y)
}

/// Extremes, mean and sum of a linear value, and pictures of them.
fn flat(topic: &mut Topic) {
    for (shader, unit, wanted, ends) in
        [("mip", 1.0, 0.3, 1.0), ("minip", 1.0, 0.1, 1.0), ("average", 1.0, 0.2, 0.0), ("xray", 2.0, 0.4, 0.0)]
    {
        let about = "extremes, mean and line integral of the value, then classified once, without a length";
        topic.needing(&[Need::Shader(shader)], format!("{shader}_of_a_ramp"), about, move |rig| {
            let table = LookupTable::grey([0.0, 100.0]);
            let shape = Shape::around(&ramp(), look(shader, table, unit));
            let step = 1.0 / 64.0;
            // Extremes lie at the ends, and samples half a step inside.
            rig.allow("half a step of a slope of 0.05", ends * 0.05 * step / 2.0);
            let scene = Scene::new([shape], along_y(0.5, 0.5));
            rig.pixel("value", &scene, &How::step(step), [wanted, wanted, wanted, 1.0]).map(|_| ())
        });
        let about = "a picture by way of the value agrees with the lattice";
        topic.needing(&[Need::Shader(shader)], format!("{shader}_picture"), about, move |rig| {
            let unit = if shader == "xray" { 6.0 } else { 1.0 };
            let shape = Shape::around(&usual(), look(shader, warm(), unit));
            rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
        });
        let about = "without a table: an opaque grey ramp over the volume's range";
        topic.needing(&[Need::Shader(shader)], format!("{shader}_without_a_table"), about, move |rig| {
            let shape = Shape::around(&usual(), Appearance::new(shader).with("unit_distance", 9.0));
            rig.lattice("picture", &through([shape]), &How::step(0.3)).map(|_| ())
        });
    }
    topic.needing(
        &[Need::Shader("mip")],
        "mip_of_negative_values",
        "the highest of negative values is negative",
        |rig| {
            let data = volume([2, 3, 2], ScalarType::F32, |p| -30.0 - 10.0 * (p.y - 1.0).abs());
            let table = colors(&[(-40.0, [1.0, 0.0, 0.0], 1.0), (0.0, [0.0, 1.0, 0.0], 1.0)]);
            rig.allow("half a step of a slope of 0.25", 0.25 / 128.0);
            let shape = Shape::around(&data, look("mip", table, 1.0));
            let scene = Scene::new([shape], along_y(0.5, 0.5));
            rig.pixel("value", &scene, &How::step(1.0 / 64.0), [0.75, 0.25, 0.0, 1.0]).map(|_| ())
        },
    );
    for shader in ["mip", "average"] {
        let about = "opacity is taken as it stands: no length in it";
        topic.needing(&[Need::Shader(shader)], format!("{shader}_has_no_length"), about, move |rig| {
            let table = || colors(&[(0.0, [0.0; 3], 0.0), (2.0, [1.0, 0.5, 0.2], 0.8)]);
            for unit in [0.1, 10.0] {
                let shape = Shape::around(&constant(1.0, [1, 1, 1]), look(shader, table(), unit));
                let scene = Scene::new([shape], along_y(0.5, 0.5));
                rig.pixel(&format!("unit {unit}"), &scene, &How::step(0.25), [0.2, 0.1, 0.04, 0.4])?;
            }
            Ok(())
        });
    }
    topic.needing(
        &[Need::Shader("simple")],
        "simple_picture",
        "the volume's own components as colour and opacity",
        |rig| {
            let shape = Shape::around(&usual(), Appearance::new("simple").with("unit_distance", 2.0));
            rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
        },
    );
}

/// Every light and model of the lit shaders.
fn lights(topic: &mut Topic) {
    for shader in ["gradient", "isosurface"] {
        for model in ["blinn_phong", "phong"] {
            for light in ["head", "directional", "positional"] {
                let about = "lit by the gradient: every model with every light";
                topic.needing(&[Need::Shader(shader)], format!("{shader}_{model}_{light}"), about, move |rig| {
                    let shape = Shape::around(&usual(), lit(shader, model, light));
                    edges(rig, shader);
                    rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
                });
            }
        }
        topic.needing(
            &[Need::Shader(shader)],
            format!("{shader}_by_default"),
            "as declared: a head light",
            move |rig| {
                let table = if shader == "gradient" { "lookup_table" } else { "surfaces" };
                let shape =
                    Shape::around(&usual(), Appearance::new(shader).with(table, warm()).with("unit_distance", 1.0));
                edges(rig, shader);
                rig.lattice("picture", &through([shape]), &How::step(0.3)).map(|_| ())
            },
        );
    }
    for (name, direction, offset) in [("x", DVec3::X, 1.0), ("oblique", DVec3::new(0.4, -0.7, 0.6), 0.5)] {
        let about = "lit without gradients by the difference of two samples along the light";
        topic.needing(&[Need::Shader("tangent_space")], format!("tangent_space_{name}"), about, move |rig| {
            let look = look("tangent_space", warm(), 1.0).with("lightdir", direction).with("offset", offset);
            rig.lattice("picture", &around([Shape::around(&usual(), look)]), &How::step(0.3)).map(|_| ())
        });
    }
    topic.needing(
        &[Need::Shader("gradient")],
        "flat_field_has_ambient_light_only",
        "without a gradient: ambient",
        |rig| {
            let look = look("gradient", colors(&[(1.0, [0.8, 0.5, 0.3], 0.5)]), 1.0).with("ambient", 0.3);
            let scene = Scene::new([Shape::around(&constant(1.0, [2, 2, 2]), look)], along_y(0.9, 1.1));
            let wanted = laid([0.24, 0.15, 0.09], absorbed(0.5, 2.0));
            rig.pixel("colour", &scene, &How::step(0.25), wanted).map(|_| ())
        },
    );
}

fn lit(shader: &str, model: &str, light: &str) -> Appearance {
    let table = if shader == "gradient" { "lookup_table" } else { "surfaces" };
    Appearance::new(shader)
        .with(table, warm())
        .with("unit_distance", 1.0)
        .with("model", model)
        .with("light", light)
        .with("lightdir", DVec3::new(0.5, -0.6, 0.7))
        .with("light_position", DVec3::new(-4.0, -9.0, 12.0))
        .with("ambient", 0.15)
        .with("diffuse", 0.6)
        .with("specular", 0.4)
        .with("shininess", 6.0)
}

/// Crossings are searched for between samples, to a stated part of the step.
fn edges(rig: &mut Rig<'_>, shader: &str) {
    if shader == "isosurface" {
        rig.because(
            "a ray that grazes a surface meets it or not by rounding, and the tolerance there is the change itself",
        );
    }
}

/// Surfaces of a linear field are planes at known depths.
fn surfaces(topic: &mut Topic) {
    let needs = [Need::Shader("isosurface")];
    topic.needing(
        &needs,
        "isosurfaces_of_a_ramp",
        "crossings in depth order, each a lit surface of its own opacity",
        |rig| {
            let data = volume([5, 9, 5], ScalarType::F32, |p| p.y);
            let levels = colors(&[(2.5, [1.0, 0.5, 0.0], 0.4), (5.25, [0.0, 0.5, 1.0], 1.0), (6.0, [1.0; 3], 1.0)]);
            let look = Appearance::new("isosurface").with("volume", VolumeTexture::new(&data)).with("surfaces", levels);
            let look = look.with("ambient", 0.25).with("diffuse", 0.5).with("specular", 0.125).with("shininess", 3.0);
            let shape = Shape::around(&data, look);
            // Head on: n·l and n·h are 1.
            let lit = |c: f64| c * 0.75 + 0.125;
            let [a, b] = [[1.0, 0.5, 0.0], [0.0, 0.5, 1.0]].map(|c: [f64; 3]| c.map(lit));
            let wanted: [f64; 4] = std::array::from_fn(|c| if c == 3 { 1.0 } else { 0.4 * a[c] + 0.6 * b[c] });
            for step in [0.3, 1.0] {
                let scene = Scene::new([shape.clone()], along_y(2.0, 2.0));
                rig.pixel(&format!("step {step}"), &scene, &How::step(step), wanted)?;
            }
            Ok(())
        },
    );
    topic.needing(&needs, "isosurface_in_a_medium", "surfaces are merged in depth with what is over", |rig| {
        let data = volume([3, 5, 3], ScalarType::F32, |p| p.y);
        let levels = colors(&[(2.0, [1.0, 0.0, 0.0], 0.5)]);
        let surface = Appearance::new("isosurface").with("volume", VolumeTexture::new(&data)).with("surfaces", levels);
        let surface = surface.with("ambient", 1.0).with("diffuse", 0.0).with("specular", 0.0);
        let medium = Shape::around(&data, look("lut", greys(&[(0.0, 1.0, 0.5)]), 1.0));
        let scene = Scene::new([Shape::around(&data, surface), medium], along_y(1.0, 1.0));
        // Two units of the medium, the surface, two more.
        let grey = |c: f64| 0.75 + 0.25 * (0.5 * c + 0.5 * 0.75);
        let wanted = [grey(1.0), grey(0.0), grey(0.0), 1.0 - 0.25 * 0.5 * 0.25];
        rig.pixel("colour", &scene, &How::step(0.3), wanted).map(|_| ())
    });
}

fn several(topic: &mut Topic) {
    topic.needing(
        &[Need::Shader("lut2d")],
        "lut2d_picture",
        "a table of the value times one of the gradient's magnitude",
        |rig| {
            let magnitude = colors(&[(0.0, [1.0; 3], 0.2), (15.0, [0.5, 1.0, 0.7], 1.0), (40.0, [1.0, 0.4, 0.2], 0.6)]);
            let look = look("lut2d", warm(), 1.0).with("gradient_table", magnitude);
            rig.lattice("picture", &around([Shape::around(&usual(), look)]), &How::step(0.3)).map(|_| ())
        },
    );
    let blocks = || volume([7, 6, 8], ScalarType::U8, |p| ((p.x / 3.0).floor() + 2.0 * (p.z / 4.0).floor()).min(3.0));
    let by_label = || {
        colors(&[
            (0.0, [0.0; 3], 0.0),
            (1.0, [1.0, 0.1, 0.1], 0.3),
            (2.0, [0.1, 1.0, 0.1], 0.5),
            (3.0, [0.2, 0.3, 1.0], 0.2),
        ])
    };
    for with_values in [false, true] {
        let name = if with_values { "labels_with_values" } else { "labels_alone" };
        let about = "labels are never interpolated; a second volume's values multiply";
        topic.needing(&[Need::Shader("labels")], name, about, move |rig| {
            let mut look = Appearance::new("labels").with("labels", VolumeTexture::new(&blocks()));
            look = look.with("label_table", by_label()).with("unit_distance", 1.0);
            if with_values {
                let factors = colors(&[(0.0, [0.2; 3], 0.1), (100.0, [1.0; 3], 1.0)]);
                look = look.with("volume", VolumeTexture::new(&usual())).with("value_table", factors);
            }
            let block = volact_core::Block::new(DVec3::ZERO, DVec3::new(6.0, 5.0, 7.0)).expect("a block");
            rig.because("a sample that lies on the border between two labels goes to one of them by rounding");
            rig.lattice("picture", &around([Shape::new(block, look)]), &How::step(0.37)).map(|_| ())
        });
    }
    let about = "a label without an entry is not drawn, wherever among the others it lies";
    topic.needing(&[Need::Shader("labels")], "labels_without_an_entry", about, move |rig| {
        // Labels run 0 to 3 along x; rays go through one of them, over a length of 4.
        let data = volume([8, 5, 3], ScalarType::U8, |p| (p.x / 2.0).floor());
        let entry = |label: f64, opacity: f64| (label, [1.0, label / 4.0, 0.5], opacity);
        for (which, known) in
            [("those around it", vec![0.0, 1.0, 3.0]), ("those below", vec![3.0]), ("those above", vec![0.0])]
        {
            let table = colors(&known.iter().map(|label| entry(*label, 0.5)).collect::<Vec<_>>());
            let look = Appearance::new("labels").with("labels", VolumeTexture::new(&data));
            // `Shape::around` would give the labels as values, too.
            let block = volact_core::Block::new(DVec3::ZERO, DVec3::new(7.0, 4.0, 2.0)).expect("a block");
            let shape = Shape::new(block, look.with("label_table", table).with("unit_distance", 1.0));
            for label in [0.0, 1.0, 2.0, 3.0] {
                let seen = if known.contains(&label) { 1.0 - 0.5f64.powi(4) } else { 0.0 };
                let wanted = [seen, seen * label / 4.0, seen * 0.5, seen];
                let scene = Scene::new([shape.clone()], along_y(2.0 * label + 0.4, 1.0));
                rig.pixel(&format!("label {label} in a table of {which}"), &scene, &How::step(0.5), wanted)?;
            }
        }
        Ok(())
    });
    for inside in [true, false] {
        let name = if inside { "blend2_in_one_place" } else { "blend2_of_a_smaller_volume" };
        let about = "two volumes in one place: extinctions add; the second counts where it is";
        topic.needing(&[Need::Shader("blend2")], name, about, move |rig| {
            let other = volume([7, 6, 8], ScalarType::F32, |p| rule(p + DVec3::new(2.0, 1.0, 3.0)));
            let mut second = VolumeTexture::new(&other);
            if !inside {
                let part = volact_core::Aabb::new(DVec3::new(1.3, -1.0, 2.2), DVec3::new(4.4, 4.1, 9.0));
                second = second.with_geometry_roi(part).expect("a box");
            }
            let cold = colors(&[(10.0, [0.3, 0.5, 1.0], 0.3), (90.0, [0.1, 0.2, 0.6], 0.0)]);
            let look = look("blend2", warm(), 1.0).with("volume2", second).with("lookup_table2", cold);
            rig.lattice("picture", &around([Shape::around(&usual(), look)]), &How::step(0.3)).map(|_| ())
        });
    }
    topic.needing(&[Need::Shader("attribute")], "attribute_picture", "per-vertex numbers through a table", |rig| {
        let shape =
            crate::meshes::field(crate::meshes::bent([3, 4, 2], DVec3::new(6.0, 5.0, 7.0), 0.1), rule, warm(), 1.0);
        rig.lattice("picture", &around([shape]), &How::default()).map(|_| ())
    });
}

fn add(rig: &mut Rig<'_>, name: &str, compositing: Compositing, text: &str) -> Result<(), Stop> {
    let number = |name: &str| ParameterDecl::new(name, ParameterType::Float, "a number").default(0.5);
    let declaration = Declaration::new(Kind::Shader, name, "1.0.0", "a shader of the suite")
        .with(ParameterDecl::new("volume", ParameterType::Volume, "the data").required())
        .with(ParameterDecl::new("unit_distance", ParameterType::Float, "for opacity").required())
        .with(number("strength"));
    let source = Some(Arc::new(ShaderText { file: format!("{name}.wgsl"), text: text.into() }));
    let added = rig.registry().add_shader(ShaderEntry { declaration, compositing, source });
    added.map_err(|e| Stop::Fail(e.to_string()))
}

const BANDS: &str = "fn shade(s: Sample) -> Medium {\n  let v = volume(s.position) * 0.01;\n  let band = 0.5 + 0.5 * sin(9.0 * v);\n  \
     var color = vec3<f32>(v, band, 1.0 - v);\n  if v > 0.6 { color = color.zyx; }\n  \
     return medium(color, strength() * v * band);\n}";

/// What users write.
fn sources(topic: &mut Topic) {
    let needs = [Need::Sources];
    topic.needing(&needs, "source_of_a_user", "an author's shader, with a parameter and control flow", |rig| {
        add(rig, "suite_bands", Compositing::Over, BANDS)?;
        for strength in [0.2, 0.8] {
            let look = Appearance::new("suite_bands").with("unit_distance", 1.0).with("strength", strength);
            let scene = around([Shape::around(&usual(), look)]);
            rig.because("where v is 0.6 the colour jumps, and a sample there goes to one side by rounding");
            rig.lattice(&format!("strength {strength}"), &scene, &How::step(0.3))?;
        }
        Ok(())
    });
    let own = "fn value(s: Sample) -> f32 { return volume(s.position) * strength(); }\n";
    let shade = "fn shade(s: Sample) -> Medium { return medium(vec3<f32>(s.value * 0.01, 0.3, 1.0), 0.8); }";
    for (compositing, name, value) in [
        (Compositing::Maximum, "source_by_maximum", own),
        (Compositing::Average, "source_by_average", own),
        (Compositing::Minimum, "source_without_a_value", ""),
    ] {
        let about = "an author's value, or else the first volume's, reduced along the ray";
        topic.needing(&needs, name, about, move |rig| {
            add(rig, "suite_value", compositing, &format!("{value}{shade}"))?;
            let look = Appearance::new("suite_value").with("unit_distance", 1.0);
            rig.lattice("picture", &around([Shape::around(&usual(), look)]), &How::step(0.3)).map(|_| ())
        });
    }
    let told = "fn shade(s: Sample) -> Medium { \
                return medium(vec3<f32>(s.depth / 200.0, 0.5 * s.direction.y, 0.5 - 0.5 * s.view.y), 1.0); }";
    topic.needing(&needs, "what_a_sample_is_told", "its depth from the eye, and where the eye is", move |rig| {
        add(rig, "suite_told", Compositing::Over, told)?;
        let shape = Shape::around(&ramp(), Appearance::new("suite_told").with("unit_distance", 1.0));
        let (eye, target) = (DVec3::new(0.5, -100.0, 0.5), DVec3::new(0.5, 0.0, 0.5));
        let step = 1.0 / 64.0;
        for (name, camera) in [
            ("orthographic", Camera::orthographic(eye, target, DVec3::Z, 1e-6)),
            ("in perspective", Camera::perspective(eye, target, DVec3::Z, 1e-3)),
        ] {
            let scene = Scene::new([shape.clone()], FrameDesc::new(camera, 1, 1));
            let frame = rig.draw(&scene, &How::step(step))?;
            let [r, g, b, _] = frame.color[0].map(f64::from);
            // What is opaque is seen at its face, 100 from the eye, or in the middle of the segment that begins there.
            let half = 0.25 * step / 200.0;
            rig.figure(&format!("depth, {name}"), r, 0.5 + half, half + crate::method::F32);
            rig.figure(&format!("direction, {name}"), g, 0.5, crate::method::F32);
            rig.figure(&format!("view, {name}"), b, 1.0, crate::method::F32);
        }
        Ok(())
    });
    let slope = "fn shade(s: Sample) -> Medium { let c = abs(volume_coordinates(s.position) - 0.5); \
                 let near = max(c.x, max(c.y, c.z)) < 0.3; \
                 return Medium(0.1 * volume_gradient(s.position) + 0.5, select(0.0, 1.0, near)); }";
    topic.needing(&needs, "gradient_of_a_linear_field", "in world units, through the inverse transpose", move |rig| {
        add(rig, "suite_slope", Compositing::Over, slope)?;
        let data = volume([9, 9, 9], ScalarType::F32, |p| p.x + 2.0 * p.y - p.z);
        let shape = Shape::around(&data, Appearance::new("suite_slope").with("unit_distance", 1.0));
        let stretch = DVec3::new(2.0, 0.5, 1.0);
        shape.set_transform(DAffine3::from_scale(stretch));
        let gradient = DVec3::new(1.0, 2.0, -1.0) / stretch;
        let scene = Scene::new([shape], along_y(8.1, 4.2));
        // Extinction 1 over the inner 0.6 of 4 units.
        let color = (0.1 * gradient + 0.5).to_array();
        let frame = rig.draw(&scene, &How::step(0.01))?;
        let [r, g, b, a] = frame.color[0].map(f64::from);
        rig.holds("seen", a > 0.8, "the middle of the volume is seen");
        for (label, found, wanted) in [("x", r, color[0]), ("y", g, color[1]), ("z", b, color[2])] {
            // Values of up to 24 in f32, differences over two voxels, a tenth of them.
            rig.figure(label, found / a, wanted, 24.0 * 16.0 * crate::method::F32);
        }
        Ok(())
    });
}
