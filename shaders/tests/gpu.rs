//! Every shader composed for GPUs: the module is valid, and naga makes SPIR-V of it.

use naga::back::spv;
use volact_core::{ParameterType, ShaderEntry};
use volact_shaders::{
    Program, builtin,
    gpu::{self, Recipe, VolumeUse, compose, compose_slices},
    load,
    signatures::kind_of,
};

const EXACT: VolumeUse = VolumeUse { channels: 1, nearest: false, hardware: false };

fn recipe(entry: &ShaderEntry, volume: Option<VolumeUse>) -> Recipe {
    shaped(entry, volume, false)
}

fn shaped(entry: &ShaderEntry, volume: Option<VolumeUse>, mesh: bool) -> Recipe {
    let program = Program::new(entry).unwrap_or_else(|error| panic!("{error}"));
    let use_of = |p| volume.filter(|_| kind_of(p) == Some(ParameterType::Volume));
    let volumes = entry.declaration.parameters.iter().map(use_of).collect();
    Recipe { program, volumes, mesh, carries: mesh, pre: None }
}

/// Composes, validates and writes; gives the words of SPIR-V.
fn words(recipes: &[Recipe], spans: u32, planes: bool) -> Vec<u32> {
    let has = (planes, spans > 2);
    compose(recipes, spans, has, true).unwrap_or_else(|error| panic!("watched: {error}"));
    for skips in [false, true] {
        compose_slices(recipes, spans, has, (true, skips), true).unwrap_or_else(|error| panic!("slabs: {error}"));
    }
    let made = compose(recipes, spans, has, false).unwrap_or_else(|error| panic!("{error}"));
    let options = spv::Options { lang_version: (1, 3), ..spv::Options::default() };
    spv::write_vec(&made.module, &made.info, &options, None).unwrap()
}

fn all() -> Vec<ShaderEntry> {
    let mut all = builtin().unwrap();
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let folders = std::fs::read_dir(examples).unwrap().map(|f| f.unwrap().path()).filter(|p| p.is_dir());
    let files = folders.flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()));
    let shaders = files.filter(|f| f.extension().is_some_and(|e| e == "wgsl"));
    all.extend(shaders.map(|file| load(file).unwrap_or_else(|error| panic!("{error}"))));
    all
}

#[test]
fn every_shader_is_a_valid_module_for_every_way_of_reading() {
    let all = all();
    assert!(all.len() > 13, "no shaders of examples among {}", all.len());
    let uses = [
        Some(EXACT),
        Some(VolumeUse { channels: 4, nearest: true, ..EXACT }),
        Some(VolumeUse { channels: 2, hardware: true, ..EXACT }),
        None,
    ];
    for entry in &all {
        for volume in uses {
            for (spans, planes) in [(1, false), (3, true)] {
                words(&[recipe(entry, volume)], spans, planes);
                words(&[shaped(entry, volume, true)], spans, planes);
            }
        }
    }
}

#[test]
fn shaders_are_merged_into_one_march() {
    let mut recipes: Vec<_> = all().iter().map(|entry| recipe(entry, Some(EXACT))).collect();
    recipes.sort_by_key(|r| !gpu::is_deep(r.program.compositing()));
    assert!(words(&recipes, 2, true).len() > 1000);
    recipes.iter_mut().step_by(2).for_each(|r| (r.mesh, r.carries) = (true, true));
    assert!(words(&recipes, 2, true).len() > 1000);
}

#[test]
fn every_name_of_a_table_of_functions_is_there() {
    use volact_core::{Compositing, Declaration, ParameterDecl, ShaderText, parameter::Kind};
    let types = [
        ("v", ParameterType::Volume),
        ("t", ParameterType::Table),
        ("unit_distance", ParameterType::Float),
        ("i", ParameterType::Int),
        ("b", ParameterType::Bool),
        ("v2", ParameterType::Vec2),
        ("v3", ParameterType::Vec3),
        ("v4", ParameterType::Vec4),
        ("c", ParameterType::Color),
        ("m", ParameterType::Matrix),
        ("a", ParameterType::Attribute),
    ];
    let mut declaration = Declaration::new(Kind::Shader, "everything", "1", "everything");
    for (name, kind) in types {
        declaration = declaration.with(ParameterDecl::new(name, kind, "one"));
    }
    declaration = declaration.with(ParameterDecl::new("w", ParameterType::Choice, "one").choices(&["x", "y"]));
    let text = "fn shade(s: Sample) -> Medium {
        let p = s.position;
        let one = v(p) + v_components(p).y + v_normalized(p) + v_color(p).z + v_gradient(p).x + v_nearest(p)
            + v_coordinates(p).x + v_spacing() + t(1.0).extinction + t_color(2.0).r + t_entry(2.0).r + t_segment(0.0, 1.0, 2.0).extinction
            + unit_distance() + f32(i()) + v2().x + v3().y + v3_local().z + v4().w + c().r + m()[1].x + f32(w())
            + a(s) + a_components(s).x;
        if v_inside(p) && b() && v_given() && t_given() && w() == w_y { return medium(c().rgb, one); }
        return Medium(vec3<f32>(one), 1.0);
    }";
    let source = ShaderText { file: "everything.wgsl".into(), text: text.into() };
    let entry = ShaderEntry { declaration, compositing: Compositing::Over, source: Some(source.into()) };
    for volume in [Some(EXACT), None] {
        words(&[recipe(&entry, volume)], 1, false);
    }
}

#[test]
fn loops_of_authors_ask_for_their_budget() {
    use volact_core::{Compositing, Declaration, ShaderText, parameter::Kind};
    let text = "fn spin(x: f32) -> f32 { loop { if x < 0.0 { break; } } return 1.0; }
        fn shade(s: Sample) -> Medium {
            var n = 0.0;
            for (var i = 0; i < 10; i += 1) { while n < 5.0 { n += 1.0; } }
            return Medium(vec3<f32>(n), spin(n));
        }";
    let source = ShaderText { file: "spin.wgsl".into(), text: text.into() };
    let declaration = Declaration::new(Kind::Shader, "spin", "1", "spins");
    let entry = ShaderEntry { declaration, compositing: Compositing::Over, source: Some(source.into()) };
    let made = compose(&[recipe(&entry, None)], 1, (false, false), false).unwrap();
    let asked = |name: &str| {
        let (_, f) = made.module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(name)).unwrap();
        let called = f.expressions.iter().filter(|(_, e)| match e {
            naga::Expression::CallResult(f) => made.module.functions[*f].name.as_deref() == Some("volact_round"),
            _ => false,
        });
        called.count()
    };
    assert_eq!((asked("s0_spin"), asked("s0_shade")), (1, 2));
}

#[test]
fn tables_before_interpolation_are_a_valid_module() {
    let entry = builtin().unwrap().into_iter().find(|e| e.declaration.name == "lut").unwrap();
    let place = |kind| entry.declaration.parameters.iter().position(|p| kind_of(p) == Some(kind)).unwrap();
    let pre = Some([place(ParameterType::Volume), place(ParameterType::Table)]);
    for volume in [EXACT, VolumeUse { channels: 4, nearest: true, hardware: true }] {
        words(&[Recipe { pre, ..recipe(&entry, Some(volume)) }], 1, false);
    }
}

#[test]
fn passes_around_the_march_are_valid() {
    let onto = [gpu::onto::limits(), gpu::onto::onto()];
    for (module, info) in [gpu::skip::module(), gpu::finish()].into_iter().chain(onto).map(Result::unwrap) {
        let options = spv::Options { lang_version: (1, 3), ..spv::Options::default() };
        assert!(!spv::write_vec(&module, &info, &options, None).unwrap().is_empty());
    }
}
