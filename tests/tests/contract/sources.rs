//! Built-in shaders by their kernels and by the evaluation of their sources: one picture. What only
//! sources can do, against closed forms.

use std::sync::Arc;

use volact_conformance::{
    meshes::{bent, look as look_attribute, scalars_of},
    metrics::{identical, max_error, wide, within},
    rig::{Setup, draw, registry},
    scene::{along_y, ball, colors, greys, look, lut, one_ray, placed, square, volume},
};
use volact_core::{
    Appearance, Block, Camera, Clip, ClipRegion, Compositing, Declaration, FrameDesc, Geometry, LookupTable,
    ParameterDecl, ParameterType, Plane, Registry, ScalarType, ShaderEntry, ShaderText, Shape, SliceStyle, Sliced,
    Slices, Volume, VolumeDesc, VolumeTexture, WarningCode,
    glam::{DAffine3, DQuat, DVec3},
    parameter::Kind,
};

/// Numbers that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// A volume of noise, anywhere between 0 and 200.
fn noise(random: &mut Random, scalar: ScalarType, smooth: bool) -> Volume {
    let [kx, ky, kz] = [random.vector(), random.vector(), random.vector()];
    let seed = random.next();
    let desc = VolumeDesc { spacing: DVec3::new(1.0, 0.7, 1.4), ..VolumeDesc::new([9, 11, 8], scalar, 1) };
    placed(desc, |p| {
        let wave = (kx.dot(p)).sin() + (ky.dot(p)).cos() * (kz.dot(p)).sin();
        // The fraction of a large sine: as good as white.
        let white = ((p.dot(DVec3::new(12.9, 78.2, 37.7)) + seed).sin() * 43758.5).fract().abs();
        (if smooth { 100.0 + 45.0 * wave } else { 200.0 * white }).round()
    })
}

/// A table of some points between -20 and 220, with at least one step where wished.
fn table(random: &mut Random, most: f64, step: bool) -> LookupTable {
    let mut values: Vec<f64> = (0..6).map(|_| random.range(-20.0, 220.0).round()).collect();
    if step {
        values.push(values[0]);
    }
    values.sort_by(f64::total_cmp);
    let mut point = |v: f64| {
        let opacity = if random.next() < 0.4 { 0.0 } else { random.range(0.0, most) };
        (v, random.vector().to_array(), opacity)
    };
    let points: Vec<_> = values.into_iter().map(&mut point).collect();
    colors(&points)
}

fn view(random: &mut Random) -> FrameDesc {
    let direction = random.vector() * 2.0 - 1.0;
    square(DVec3::new(4.0, 3.5, 4.9), direction * 14.0, 13.0, 16)
}

/// A program of an own name.
fn with(name: &str, compositing: Compositing, parameters: &[(&str, ParameterType)], text: &str) -> Registry {
    let mut all = registry();
    let parameters = parameters.iter().map(|(n, t)| ParameterDecl::new(n, *t, "a parameter").required()).collect();
    let declaration = Declaration { parameters, ..Declaration::new(Kind::Shader, name, "0", "a test") };
    let source = Some(Arc::new(ShaderText { file: format!("{name}.wgsl"), text: text.into() }));
    all.add_shader(ShaderEntry { declaration, compositing, source }).unwrap();
    all
}

fn picture(all: &Registry, setup: &Setup, shapes: &[Shape], desc: &FrameDesc) -> Vec<[f64; 4]> {
    wide(&draw(&mut *setup.action_in(all), shapes, desc).unwrap())
}

#[test]
fn kernels_draw_what_the_sources_of_their_shaders_say() {
    let mut random = Random(7);
    let types = [ScalarType::U8, ScalarType::I16, ScalarType::U16, ScalarType::F32, ScalarType::F64];
    for round in 0..12 {
        let data = noise(&mut random, types[round % types.len()], round % 2 == 0);
        let table = table(&mut random, [0.2, 0.9, 1.0][round % 3], round % 4 == 3);
        let desc = view(&mut random);
        let turn = DQuat::from_rotation_x(random.next()) * DQuat::from_rotation_z(random.next());
        let texture = VolumeTexture::new(&data);
        for shader in ["lut", "simple", "mip", "minip", "average", "xray"] {
            let mut appearance = Appearance::new(shader).with("volume", texture.clone());
            if shader != "simple" {
                appearance = appearance.with("lookup_table", table.clone());
            }
            if matches!(shader, "lut" | "simple" | "xray") {
                appearance = appearance.with("unit_distance", 1.0 + 100.0 * f64::from(u8::from(shader == "xray")));
            }
            let shape = [Shape::around(&data, appearance)];
            shape[0].set_transform(DAffine3::from_rotation_translation(turn, DVec3::new(0.3, -0.1, 0.2)));
            let setup = Setup::post(0.13);
            let kernel = setup.colors(&shape, &desc);
            let source = setup.with("recognise", false).colors(&shape, &desc);
            // Positions of both are f32; a step of the table is a place where that shows.
            let tolerance = if round % 4 == 3 { 2e-2 } else { 1e-4 };
            within(&format!("{shader}, round {round}"), max_error(&source, &kernel), tolerance);
        }
    }
}

/// Lit by formulas compiled beforehand, or by the instructions of its source.
#[test]
fn gradient_is_lit_as_its_source_says() {
    let mut random = Random(29);
    let mut all = registry();
    let shipped = volact_shaders::builtin().unwrap();
    all.add_shader(shipped.into_iter().find(|e| e.declaration.name == "gradient").unwrap()).unwrap();
    let types = [ScalarType::U8, ScalarType::I8, ScalarType::U16, ScalarType::I16, ScalarType::F32, ScalarType::F64];
    for round in 0..18 {
        let data = noise(&mut random, types[round % types.len()], round % 2 == 0);
        let (table, desc) = (table(&mut random, [0.2, 0.9, 1.0][round % 3], false), view(&mut random));
        let look = Appearance::new("gradient")
            .with("volume", VolumeTexture::new(&data))
            .with("lookup_table", table)
            .with("unit_distance", 1.0)
            .with("model", ["blinn_phong", "phong"][round % 2])
            .with("light", ["head", "directional", "positional"][round / 2 % 3])
            .with("lightdir", random.vector() * 2.0 - 1.0)
            .with("light_position", random.vector() * 20.0 - 5.0)
            .with("specular", 0.6)
            .with("shininess", [0.0, 1.0, 10.0, 80.0][round % 4]);
        let shape = [Shape::around(&data, look)];
        let turn = DQuat::from_rotation_x(random.next()) * DQuat::from_rotation_z(random.next());
        shape[0].set_transform(DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 0.8, 1.3),
            turn,
            DVec3::new(0.3, -0.1, 0.2),
        ));
        let setup = |on: bool| Setup::post(0.13).with("recognise", on);
        let [native, source] = [true, false].map(|on| picture(&all, &setup(on), &shape, &desc));
        assert!(source.iter().any(|c| c[3] > 0.05), "round {round}");
        within(&format!("round {round}"), max_error(&native, &source), 1e-4);
        // An opaque plane shows the colour of what is transparent, too, which is not lit.
        let plane = Plane::new(DVec3::new(4.0, 3.5, 4.9), random.vector() - 0.5).unwrap();
        let slices = Slices { planes: vec![plane], style: SliceStyle::Opaque, volume: false };
        shape[0].set_geometry(Sliced::new(Arc::clone(&shape[0].state().geometry), slices).unwrap());
        let [native, source] = [true, false].map(|on| picture(&all, &setup(on), &shape, &desc));
        assert!(source.iter().any(|c| c[3] == 1.0), "round {round}");
        within(&format!("round {round}, on a plane"), max_error(&native, &source), 1e-4);
    }
}

/// A registry with the sources of all shaders that come with Volact.
fn every_shader() -> Registry {
    let mut all = registry();
    for entry in volact_shaders::builtin().unwrap() {
        if all.shaders().get(&entry.declaration.name).is_none() {
            all.add_shader(entry).unwrap();
        }
    }
    all
}

/// Shaders without a kernel, in f32 and in f64 on the same lattice.
#[test]
fn sources_in_f32_are_those_in_f64() {
    let (mut random, all) = (Random(23), every_shader());
    for round in 0..4 {
        let data = noise(&mut random, [ScalarType::U8, ScalarType::F32][round % 2], true);
        let other = noise(&mut random, ScalarType::U16, true);
        let table = || colors(&[(60.0, [0.2, 0.4, 0.9], 0.0), (110.0, [1.0, 0.6, 0.2], 0.3), (150.0, [1.0; 3], 0.6)]);
        let (texture, desc) = (VolumeTexture::new(&data), view(&mut random));
        let look = |name: &str| Appearance::new(name).with("volume", texture.clone());
        let lit = |name: &str| look(name).with("lookup_table", table()).with("unit_distance", 1.0);
        let steep = colors(&[(0.0, [0.5; 3], 0.0), (30.0, [1.0; 3], 1.0)]);
        // Every third label has no entry.
        let known = (0..256).map(f64::from).filter(|label| label % 3.0 != 0.0);
        let labels = colors(&known.map(|label| (label, [label / 256.0, 0.5, 0.2], 0.3)).collect::<Vec<_>>());
        let looks = [
            lit("gradient").with("light", "directional").with("lightdir", DVec3::new(0.3, -0.5, 0.8)),
            lit("gradient").with("model", "phong"),
            lit("tangent_space").with("lightdir", DVec3::new(0.3, -0.5, 0.8)),
            lit("lut2d").with("gradient_table", steep),
            lit("blend2").with("volume2", VolumeTexture::new(&other)).with("lookup_table2", table()),
            Appearance::new("labels")
                .with("labels", texture.clone())
                .with("label_table", labels)
                .with("unit_distance", 1.0),
            look("isosurface")
                .with("surfaces", colors(&[(100.0, [1.0, 0.5, 0.2], 0.5), (130.0, [0.5, 0.5, 1.0], 1.0)])),
        ];
        for look in looks {
            let (shader, shapes) = (look.shader.clone(), [Shape::around(&data, look)]);
            shapes[0].set_transform(DAffine3::from_rotation_y(0.4));
            let found = picture(&all, &Setup::post(0.17), &shapes, &desc);
            let wanted = picture(&all, &Setup::rays(0.17), &shapes, &desc);
            assert!(wanted.iter().any(|c| c[3] > 0.05), "{shader}, round {round}");
            let off: Vec<f64> = found.iter().zip(&wanted).map(|(a, b)| max_error(&[*a], &[*b])).collect();
            // Labels and surfaces that rays just graze jump: one pixel in a hundred may.
            let jumps = matches!(shader.as_str(), "labels" | "isosurface");
            let allowed = if jumps { off.len() / 100 } else { 0 };
            let far = off.iter().filter(|e| **e > 2e-4).count();
            assert!(far <= allowed, "{shader}, round {round}: {far} pixels are off by more than 2e-4: {off:?}");
        }
    }
}

/// Labels 0 to 3 side by side and a table of 1 and 3: 2 was once drawn as a blend of the two, and
/// nobody was told. 0 is the background, which needs no entry.
#[test]
fn labels_without_an_entry_are_named_and_not_drawn() {
    let data = volume([8, 3, 3], ScalarType::U8, |p| (p.x / 2.0).floor());
    let all = every_shader();
    let drawn = |setup: Setup, known: &[f64]| {
        let table = colors(&known.iter().map(|label| (*label, [1.0; 3], 1.0)).collect::<Vec<_>>());
        let look = Appearance::new("labels").with("labels", VolumeTexture::new(&data)).with("label_table", table);
        let block = Block::new(DVec3::ZERO, DVec3::new(7.0, 2.0, 2.0)).unwrap();
        let shape = Shape::new(block, look.with("unit_distance", 1.0));
        let frame = draw(&mut *setup.action_in(&all), std::slice::from_ref(&shape), &along_y(4.5, 1.0)).unwrap();
        let told = frame.warnings.iter().filter(|w| w.code == WarningCode::LabelWithoutEntry);
        (frame.color[0], told.map(|w| w.message.clone()).collect::<Vec<_>>())
    };
    let setups: [fn() -> Setup; 3] = [|| Setup::post(0.5), || Setup::rays(0.5), Setup::exact];
    for setup in setups {
        let (color, told) = drawn(setup(), &[1.0, 3.0]);
        assert_eq!(color, [0.0; 4]);
        assert_eq!(told, ["label 2 of \"volume\" has no entry in \"label_table\" and is not drawn"]);
        let (color, told) = drawn(setup(), &[2.0]);
        assert_eq!(color, [1.0; 4]);
        assert_eq!(told, ["labels 1, 3 of \"volume\" have no entry in \"label_table\" and are not drawn"]);
        assert!(drawn(setup(), &[1.0, 2.0, 3.0]).1.is_empty());
    }
}

#[test]
fn an_attribute_by_its_source_tends_to_the_kernel_cell_by_cell() {
    let mesh = || bent([4, 5, 3], DVec3::new(3.0, 4.0, 2.0), 0.15);
    let warm = colors(&[(0.0, [0.2, 0.1, 0.9], 0.05), (3.0, [0.9, 0.5, 0.1], 0.4), (6.0, [1.0; 3], 0.1)]);
    let numbers = scalars_of(&mesh(), |p| p.x + p.y * 0.5 + (2.0 * p.z).sin());
    let shape = [Shape::new(mesh(), look_attribute(numbers, warm, 1.0))];
    let desc = square(DVec3::new(1.5, 2.0, 1.0), DVec3::new(2.0, -6.0, 3.0), 6.0, 20);
    let kernel = Setup::cpu().with("termination", 0.0).colors(&shape, &desc);
    let error = |step: f64| max_error(&Setup::post(step).with("recognise", false).colors(&shape, &desc), &kernel);
    within("step 0.2", error(0.2), 4e-3);
    within("step 0.05", error(0.05), 3e-4);
    within("step 0.0125", error(0.0125), 4e-5);
}

#[test]
fn a_deformed_volume_by_source_is_that_by_kernel() {
    let data = ball([9, 8, 10], ScalarType::U8);
    let warm = colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.8)]);
    let mesh = bent([4, 3, 5], DVec3::new(8.0, 7.0, 9.0), 0.12);
    let straight = bent([4, 3, 5], DVec3::ONE, 0.0);
    let mesh = mesh.with_texture_coordinates(straight.points().clone()).unwrap();
    let shape = [Shape::new(mesh, look("lut", warm, 1.0).with("volume", VolumeTexture::new(&data)))];
    let desc = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 24);
    let kernel = Setup::post(0.1).colors(&shape, &desc);
    assert!(kernel.iter().any(|c| c[3] > 0.5));
    within("bent", max_error(&Setup::post(0.1).with("recognise", false).colors(&shape, &desc), &kernel), 1e-4);
}

/// In a mesh that stretches a volume of a linear field, the gradient is that of the stretched field.
#[test]
fn gradients_in_deformed_volumes_are_those_of_the_world() {
    let data = volume([9, 9, 9], ScalarType::F32, |p| p.x + 2.0 * p.y - p.z);
    let stretch = DVec3::new(2.0, 0.5, 1.0);
    let points = |size: DVec3| bent([2, 2, 2], size, 0.0).points().clone();
    let mesh = bent([2, 2, 2], stretch * 8.0, 0.0).with_texture_coordinates(points(DVec3::ONE)).unwrap();
    // Only where all neighbours are: at the rim they are clamped to the data's edge.
    let text = "fn shade(s: Sample) -> Medium { let c = abs(volume_coordinates(s.position) - 0.5); \
                let near = max(c.x, max(c.y, c.z)) < 0.3; \
                return Medium(0.1 * volume_gradient(s.position) + 0.5, select(0.0, 1.0, near)); }";
    let all = with("slope", Compositing::Over, &[("volume", ParameterType::Volume)], text);
    let shape = Shape::new(mesh, Appearance::new("slope").with("volume", VolumeTexture::new(&data)));
    let ray = one_ray(DVec3::new(7.9, 1.7, 3.1), DVec3::new(8.1, 2.1, 4.2));
    let [r, g, b, a] = picture(&all, &Setup::post(0.01), &[shape], &ray)[0];
    let found = (DVec3::new(r, g, b) / a - 0.5) * 10.0;
    let wanted = DVec3::new(1.0, 2.0, -1.0) / stretch;
    assert!(a > 0.1 && (found - wanted).length() < 1e-4, "{found}, wanted {wanted}");
}

#[test]
fn pre_integration_by_source_is_that_of_the_kernel() {
    let text = "fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position)); }\n\
                fn shade_segment(front: Sample, back: Sample) -> Medium {\n  \
                return lookup_table_segment(volume(front.position), volume(back.position), front.step);\n}";
    let parameters = [
        ("volume", ParameterType::Volume),
        ("lookup_table", ParameterType::Table),
        ("unit_distance", ParameterType::Float),
    ];
    let all = with("ends", Compositing::Over, &parameters, text);
    let thin = colors(&[(80.0, [1.0, 0.2, 0.1], 0.0), (90.0, [1.0, 0.9, 0.1], 0.6), (100.0, [0.1, 0.2, 1.0], 0.0)]);
    let shape = lut(&ball([9, 8, 10], ScalarType::U8), thin, 1.0);
    let by_source = shape.named("by source");
    by_source.set_shader("ends");
    let desc = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 20);
    let shapes = [by_source];
    let exact = Setup::exact().colors(std::slice::from_ref(&shape), &desc);
    let kernel = Setup::pre_integrated(0.4).colors(&[shape], &desc);
    let source = picture(&all, &Setup::pre_integrated(0.4), &shapes, &desc);
    let middle = picture(&all, &Setup::post(0.4), &shapes, &desc);
    let [kernel, source, middle] = [&kernel, &source, &middle].map(|p| max_error(p, &exact));
    within("source", source, 1.05 * kernel);
    assert!(middle > 1.5 * source, "in the middle {middle:.3e}, by both ends {source:.3e}");
}

#[test]
fn a_source_that_is_a_built_in_is_drawn_by_its_kernel() {
    let shipped = volact_shaders::builtin().unwrap();
    let text = shipped.iter().find(|e| e.declaration.name == "lut").unwrap();
    let mut all = registry();
    let source = ShaderText { file: "mine.wgsl".into(), text: text.source.as_ref().unwrap().text.clone() };
    let declaration = Declaration { name: "mine".into(), ..text.declaration.clone() };
    all.add_shader(ShaderEntry { declaration, source: Some(Arc::new(source)), ..text.clone() }).unwrap();
    let shape = lut(&ball([9, 8, 10], ScalarType::U8), greys(&[(0.0, 0.0, 0.0), (200.0, 1.0, 0.4)]), 1.0);
    let mine = shape.named("mine");
    mine.set_shader("mine");
    let desc = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 20);
    let kernel = Setup::post(0.3).draw(&[shape], &desc);
    let shapes = [mine];
    let drawn = |setup: Setup| draw(&mut *setup.action_in(&all), &shapes, &desc).unwrap();
    let recognised = drawn(Setup::post(0.3));
    assert!(identical(&recognised, &kernel));
    assert!(!recognised.method.classification.contains("evaluated"));
    let evaluated = drawn(Setup::post(0.3).with("recognise", false));
    assert!(evaluated.method.classification.contains("evaluated"), "{}", evaluated.method.classification);
}

#[test]
fn what_is_skipped_changes_no_bit_of_a_source() {
    let mut random = Random(11);
    for round in 0..6 {
        let data = ball([33, 30, 28], [ScalarType::U8, ScalarType::F32][round % 2]);
        let sparse = colors(&[(120.0, [1.0, 0.2, 0.1], 0.0), (140.0, [1.0, 0.9, 0.1], 0.3), (160.0, [0.1; 3], 0.0)]);
        let shapes = [lut(&data, sparse, 1.0)];
        let direction = random.vector() * 2.0 - 1.0;
        let desc = square(DVec3::splat(15.0), direction * 60.0, 36.0, 16);
        let drawn =
            |skipping: bool| Setup::post(0.2).with("recognise", false).with("skipping", skipping).draw(&shapes, &desc);
        let (with, without) = (drawn(true), drawn(false));
        assert!(identical(&with, &without), "round {round}");
        assert!(with.statistics.samples < without.statistics.samples, "round {round}");
    }
}

/// Surfaces of a linear field are planes: hits at known depths, lit by a known gradient.
#[test]
fn isosurfaces_of_a_linear_field_are_lit_planes() {
    let data = volume([5, 9, 5], ScalarType::F32, |p| p.y);
    let all = builtin("isosurface");
    let levels = colors(&[(2.5, [1.0, 0.5, 0.0], 0.4), (5.25, [0.0, 0.5, 1.0], 1.0), (6.0, [1.0; 3], 1.0)]);
    let look = Appearance::new("isosurface").with("volume", VolumeTexture::new(&data)).with("surfaces", levels);
    let look = look.with("ambient", 0.25).with("diffuse", 0.5).with("specular", 0.125).with("shininess", 3.0);
    let shape = Shape::around(&data, look);
    for step in [0.3, 1.0, 2.0] {
        // Head on: n·l and n·h are 1.
        let frame = draw(&mut *Setup::post(step).action_in(&all), std::slice::from_ref(&shape), &along_y(2.0, 2.0));
        let frame = frame.unwrap();
        let lit = |c: f64| c * 0.75 + 0.125;
        let [a, b] = [[1.0, 0.5, 0.0], [0.0, 0.5, 1.0]].map(|c: [f64; 3]| c.map(lit));
        let wanted: [f64; 4] = std::array::from_fn(|c| if c == 3 { 1.0 } else { 0.4 * a[c] + 0.6 * b[c] });
        within(&format!("step {step}"), max_error(&wide(&frame), &[wanted]), 1e-6);
        let opaque = Setup::post(step).with("termination", 0.0);
        let frame = draw(&mut *opaque.action_in(&all), std::slice::from_ref(&shape), &along_y(2.0, 2.0)).unwrap();
        // Depth counts from the camera, which stands somewhere before the box.
        let walls = Setup::post(step).draw(&[lut(&data, greys(&[(0.0, 1.0, 1.0)]), 1.0)], &along_y(2.0, 2.0));
        within("depth", f64::from((frame.depth[0] - walls.depth[0] - 5.25).abs()), 1e-5);
    }
    // A directional light from the side, in the world.
    shape.set_parameter("light", "directional");
    shape.set_parameter("lightdir", DVec3::new(0.6, -0.8, 0.0));
    shape.set_parameter("specular", 0.0);
    let [r, ..] = picture(&all, &Setup::post(0.5), std::slice::from_ref(&shape), &along_y(2.0, 2.0))[0];
    let lit = |c: f64| c * (0.25 + 0.5 * 0.8);
    within("from the side", (r - 0.4 * lit(1.0)).abs(), 1e-6);
}

fn builtin(name: &str) -> Registry {
    let mut all = registry();
    let entry = volact_shaders::builtin().unwrap().into_iter().find(|e| e.declaration.name == name).unwrap();
    all.add_shader(entry).unwrap();
    all
}

/// A ball's surface, seen from outside and from inside, cut by a plane, with another shape in front.
#[test]
fn isosurfaces_of_a_ball_are_where_geometry_says() {
    let center = DVec3::splat(8.0);
    let data = volume([17, 17, 17], ScalarType::F32, |p| (p - center).length());
    let all = builtin("isosurface");
    let levels = colors(&[(5.0, [1.0; 3], 1.0)]);
    let look = Appearance::new("isosurface").with("volume", VolumeTexture::new(&data)).with("surfaces", levels);
    let shape = Shape::around(&data, look.with("ambient", 1.0).with("diffuse", 0.0).with("specular", 0.0));
    let eye = DVec3::new(8.0, -12.0, 10.0);
    let mut desc = FrameDesc::new(Camera::perspective(eye, center, DVec3::Z, 50.0), 40, 40);
    let compare = |desc: &FrameDesc, cut: Option<Plane>| {
        let setup = Setup::post(0.5).with("termination", 0.0);
        let frame = draw(&mut *setup.action_in(&all), std::slice::from_ref(&shape), desc).unwrap();
        let (rays, viewport) = (desc.camera.rays(&desc.viewport()).unwrap(), desc.viewport());
        let mut seen = 0;
        for y in 0..viewport.height {
            for x in 0..viewport.width {
                let ray = rays.ray(x as f64 + 0.5, y as f64 + 0.5);
                let (o, d) = (ray.origin - center, ray.direction);
                let (b, c) = (o.dot(d), o.dot(o) - 25.0);
                let root = (b * b - c).max(0.0).sqrt();
                let kept = |t: &f64| *t > 0.0 && cut.is_none_or(|p| p.distance(ray.origin + d * *t) >= 0.0);
                let wanted = [-b - root, -b + root].into_iter().filter(|_| b * b > c).find(kept);
                let found = frame.depth[y * viewport.width + x];
                // The field is interpolated: rays near the silhouette may miss.
                if b * b - c > 4.0 || b * b - c < -2.0 {
                    match wanted {
                        Some(t) => assert!((f64::from(found) - t).abs() < 0.12, "({x}, {y}): {found}, wanted {t}"),
                        None => assert!(found.is_infinite(), "({x}, {y}): {found}"),
                    }
                    seen += u32::from(wanted.is_some());
                }
            }
        }
        assert!(seen > 100, "{seen}");
    };
    compare(&desc, None);
    desc.camera = Camera::perspective(center + DVec3::new(0.5, 0.2, -0.3), center + DVec3::Y, DVec3::Z, 90.0);
    compare(&desc, None);
    let plane = Plane::new(center - DVec3::Y * 2.0, DVec3::Y).unwrap();
    let outside = FrameDesc::new(Camera::perspective(eye, center, DVec3::Z, 50.0), 40, 40);
    compare(&outside.with_clip(Clip::new([ClipRegion::plane(plane)])), Some(plane));
}

#[test]
fn surfaces_stand_in_volumes() {
    // A blended plane at y = 2 in a medium of opacity 0.5 a unit: half, plane, the rest.
    let data = volume([3, 5, 3], ScalarType::F32, |p| p.y);
    let all = builtin("isosurface");
    let levels = colors(&[(2.0, [1.0, 0.0, 0.0], 0.5)]);
    let surface = Appearance::new("isosurface").with("volume", VolumeTexture::new(&data)).with("surfaces", levels);
    let surface = surface.with("ambient", 1.0).with("diffuse", 0.0).with("specular", 0.0);
    let medium = lut(&data, greys(&[(0.0, 1.0, 0.5)]), 1.0);
    let mut shapes = vec![Shape::around(&data, surface), medium];
    let before = 0.75;
    let wanted = |c: f64| before * c + 0.25 * (0.5 * f64::from(u8::from(c == 0.0)) + 0.5 * before * c);
    for _ in 0..2 {
        let [r, g, _, a] = picture(&all, &Setup::post(0.3), &shapes, &along_y(1.0, 1.0))[0];
        within("grey", (g - wanted(1.0)).abs(), 1e-6);
        within("red", (r - g - 0.25 * 0.5).abs(), 1e-6);
        within("opacity", (a - (1.0 - 0.25 * 0.5 * 0.25)).abs(), 1e-6);
        shapes.reverse();
    }
}

/// Where the ray enters, and how long it is inside, is what `shade` is told.
#[test]
fn shading_once_a_ray_knows_where() {
    let data = volume([3, 9, 3], ScalarType::F32, |p| 8.0 - (p.y - 3.0).abs());
    let text = "fn value(s: Sample) -> f32 { return volume(s.position); }\n\
                fn shade(s: Sample) -> Medium {\n  \
                return medium(vec3<f32>(volume_coordinates(s.position).y, 0.1 * s.step, 0.1 * s.value), 1.0);\n}";
    let parameters = [("volume", ParameterType::Volume), ("unit_distance", ParameterType::Float)];
    let shape = |all: &Registry, compositing| {
        let look = Appearance::new("where").with("volume", VolumeTexture::new(&data)).with("unit_distance", 16.0);
        let desc = along_y(1.0, 1.0);
        let _: Compositing = compositing;
        picture(all, &Setup::post(0.25), &[Shape::around(&data, look)], &desc)[0]
    };
    let mean = (0..32).map(|k| 8.0 - (0.25 * (f64::from(k) + 0.5) - 3.0).abs()).sum::<f64>() / 32.0;
    for (compositing, value) in [
        (Compositing::Maximum, 8.0 - 0.125),
        (Compositing::Minimum, 3.0 + 0.125),
        (Compositing::Average, mean),
        (Compositing::Add, mean * 8.0 / 16.0),
    ] {
        let all = with("where", compositing, &parameters, text);
        let [r, g, b, a] = shape(&all, compositing);
        let what = compositing.name();
        within(&format!("{what}, place"), r.abs(), 1e-6);
        within(&format!("{what}, step"), (g - 0.1 * 8.0).abs(), 1e-6);
        within(&format!("{what}, value"), (b - 0.1 * value).abs(), 1e-6);
        assert_eq!(a, 1.0);
    }
}

/// Numbers at the corners of a block that carries no volume.
#[test]
fn attributes_reach_the_program() {
    let text = "fn shade(s: Sample) -> Medium { return Medium(0.1 * tint_components(s).xyz, heat(s)); }";
    let all = with(
        "carried",
        Compositing::Over,
        &[("heat", ParameterType::Attribute), ("tint", ParameterType::Attribute)],
        text,
    );
    let block = Block::new(DVec3::ZERO, DVec3::new(1.0, 2.0, 1.0)).unwrap();
    let points = block.tessellate().unwrap().vertices;
    let heat: Vec<f64> = points.iter().map(|p| 0.1 + 0.4 * p.y).collect();
    let tint: Vec<f32> = points.iter().flat_map(|p| [p.x, 2.0, p.z].map(|v| v as f32)).collect();
    let attribute =
        |name: &str, scalar, components, buffer| volact_core::Attribute::new(name, scalar, components, buffer).unwrap();
    let look = Appearance::new("carried")
        .with("heat", attribute("heat", ScalarType::F64, 1, volact_core::Buffer::from_vec(heat)))
        .with("tint", attribute("tint", ScalarType::F32, 3, volact_core::Buffer::from_vec(tint)));
    let [r, g, b, a] = picture(&all, &Setup::post(0.001), &[Shape::new(block, look)], &along_y(0.25, 0.5))[0];
    // ∫ σ over the length of 2 is 0.1·2 + 0.4·2.
    let alpha = 1.0 - (-1.0f64).exp();
    within("opacity", (a - alpha).abs(), 1e-6);
    for (found, wanted) in [(r, 0.025), (g, 0.2), (b, 0.05)] {
        within("colour", (found / alpha - wanted).abs(), 1e-6);
    }
}

/// A source computes with values in data units: where single precision has no digits left for their detail,
/// the shape is refused by name, not drawn in a few colours.
#[test]
fn detail_on_a_large_offset_is_drawn_or_refused() {
    let desc = square(DVec3::new(2.0, 2.5, 3.0), DVec3::new(3.0, -9.0, 4.0), 9.0, 16);
    let offsets = [(ScalarType::F64, 1e4), (ScalarType::F64, 1e7), (ScalarType::U32, 4e9), (ScalarType::F32, 1e6)];
    for (scalar, offset) in offsets {
        let data = volume([5, 6, 7], scalar, |p| (offset + 20.0 * p.x + 9.0 * (p.y - p.z)).round());
        let table = greys(&[(offset + 20.0, 0.1, 0.0), (offset + 90.0, 0.9, 0.7)]);
        let shape = [Shape::around(&data, look("lut", table, 1.0))];
        let [kernel, source] =
            [true, false].map(|on| draw(&mut *Setup::post(0.2).with("recognise", on).action(), &shape, &desc));
        let kernel = wide(&kernel.unwrap());
        assert!(kernel.iter().any(|c| c[3] > 0.3), "{scalar:?}");
        match source {
            Ok(source) => {
                assert!(offset < 1e5, "{scalar:?} at {offset} is drawn");
                within(&format!("{scalar:?} at {offset}"), max_error(&wide(&source), &kernel), 1e-4);
            }
            Err(error) => {
                let told = error.to_string();
                assert!(offset > 1e5 && told.contains("\"lookup_table\" with detail from"), "{scalar:?}: {told}");
            }
        }
    }
}
