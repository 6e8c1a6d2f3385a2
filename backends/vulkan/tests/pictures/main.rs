//! Pictures held to `reference` on planes, with the validation layers listening.
//!
//! Where there is no Vulkan at all, each test says so and ends. Where there is, the layers have to be
//! installed, and whatever they say fails the test.

mod compositing;
mod meshes;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use volact_core::{
    Aabb, ActionError, Appearance, Block, Buffer, Camera, CellType, CellTypes, Clip, Compositing, ControlPoint,
    Declaration, Frame, FrameDesc, Geometry, LookupTable, Mesh, Opaque, OpaqueDepth, Options, ParameterDecl,
    ParameterType, Plane, Projection, Registry, RenderAction, ScalarType, ShaderEntry, ShaderText, Shape, Sphere,
    TableInterpolation, Viewport, Volume, VolumeDesc, WarningCode,
    geometry::ClipRegion,
    glam::{DAffine3, DVec3},
    parameter::Kind,
    resolve::ResolvedShape,
};
use volact_cpu::reference::{Method, ReferenceOptions, integrate};

fn registry() -> Registry {
    let mut registry = Registry::with_core();
    volact_vulkan::register(&mut registry).unwrap();
    for entry in volact_shaders::builtin().unwrap() {
        let text = entry.source.as_ref().unwrap().text.clone();
        if registry.shaders().get(&entry.declaration.name).is_none() {
            registry.add_shader_source(entry, text).unwrap();
        }
    }
    registry
}

/// One test at a time: several devices at once bring down Mesa's software Vulkan now and then.
fn alone() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The action with the layers listening; `None`, and a word, where there is no Vulkan.
fn action(options: &[(&str, volact_core::ParameterValue)]) -> Option<Box<dyn RenderAction>> {
    let registry = registry();
    if let Err(error) = registry.action("vulkan", &Options::default()) {
        let ActionError::Backend { source, .. } = &error else { panic!("{error}") };
        println!("skipped: {source}");
        return None;
    }
    let mut all: Options = options.iter().map(|(n, v)| ((*n).to_owned(), v.clone())).collect();
    all.insert("validation".into(), true.into());
    all.entry("termination".into()).or_insert(0.0.into());
    Some(registry.action("vulkan", &all).unwrap())
}

fn table() -> LookupTable {
    let point = |value, color, opacity| ControlPoint { value, color, opacity };
    let all =
        vec![point(0.0, [0.1, 0.5, 0.9], 0.0), point(90.0, [0.9, 0.4, 0.2], 0.3), point(200.0, [1.0, 0.9, 0.1], 0.7)];
    LookupTable::from_points(all).unwrap()
}

/// A volume of 12³ samples of a type, about 20 to 230.
fn data(scalar: ScalarType) -> Volume {
    let n = 12;
    let value = |i: usize| {
        let [x, y, z] = [i % n, i / n % n, i / n / n].map(|v| v as f64);
        125.0 + 60.0 * (0.7 * x).sin() * (0.5 * y).cos() + 40.0 * (0.6 * z + 0.3 * x).sin()
    };
    let all = (0..n * n * n).map(value);
    let desc = VolumeDesc::new([n; 3], scalar, 1);
    match scalar {
        ScalarType::U8 => Volume::new(desc, all.map(|v| v as u8).collect::<Vec<_>>()),
        ScalarType::U16 => Volume::new(desc, all.map(|v| v as u16).collect::<Vec<_>>()),
        ScalarType::I16 => Volume::new(desc, all.map(|v| v as i16).collect::<Vec<_>>()),
        ScalarType::F32 => Volume::new(desc, all.map(|v| v as f32).collect::<Vec<_>>()),
        _ => Volume::new(desc, all.collect::<Vec<f64>>()),
    }
    .unwrap()
}

fn block(scalar: ScalarType) -> Shape {
    let look = Appearance::new("lut").with("lookup_table", table()).with("unit_distance", 1.5);
    let shape = Shape::around(&data(scalar), look);
    shape.set_transform(
        DAffine3::from_rotation_y(0.4)
            * DAffine3::from_scale(DVec3::new(1.2, -0.7, 0.9))
            * DAffine3::from_rotation_z(0.3),
    );
    shape
}

fn draw(action: &mut dyn RenderAction, shapes: &[Shape], frame: &FrameDesc) -> Frame {
    shapes.iter().for_each(|s| action.manage(s).unwrap());
    action.begin_draw(frame).unwrap();
    shapes.iter().for_each(|s| action.draw(s).unwrap());
    action.end_draw().unwrap()
}

fn planes(shapes: &[Shape], frame: &FrameDesc, step: f64) -> (Vec<[f64; 4]>, Vec<f64>) {
    let registry = registry();
    let shapes: Vec<_> = shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders()).unwrap()).collect();
    let options = ReferenceOptions { method: Method::Planes, sample_distance: step, ..ReferenceOptions::default() };
    let made = integrate(&shapes, frame, &options).unwrap();
    (made.color, made.depth)
}

fn worst(frame: &Frame, wanted: &[[f64; 4]]) -> f64 {
    let found = frame.color.iter().flatten().map(|v| f64::from(*v));
    found.zip(wanted.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn center() -> DVec3 {
    block(ScalarType::U8).state().world_bounds().center()
}

fn views() -> Vec<FrameDesc> {
    let (target, eye) = (center(), center() + DVec3::new(9.0, -17.0, 8.0));
    let perspective = |near, far| Camera::LookAt {
        eye,
        target,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: 45.0 },
        near,
        far,
    };
    let mut part = FrameDesc::new(perspective(0.0, f64::INFINITY), 70, 50);
    part.viewport = Some(Viewport { x: 7, y: 5, width: 48, height: 40 });
    vec![
        FrameDesc::new(perspective(0.0, f64::INFINITY), 48, 40),
        FrameDesc::new(perspective(19.0, 23.0), 48, 40),
        FrameDesc::new(Camera::orthographic(eye, target, DVec3::Z, 14.0), 48, 40),
        // Head on: faces that are seen edge-on.
        FrameDesc::new(Camera::orthographic(target - DVec3::Y * 30.0, target, DVec3::Z, 14.0), 48, 40),
        // From within.
        FrameDesc::new(Camera::perspective(target, target + DVec3::X, DVec3::Z, 80.0), 48, 40),
        part,
    ]
}

/// f32 over some 60 segments of a ray, each within a few roundings: 60 × 2⁻²⁴ × 4, and as much for places.
const TOLERANCE: f64 = 3e-5;

#[test]
fn blocks_are_those_of_the_reference_on_planes() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", 0.31.into())]) else { return };
    for (number, frame) in views().into_iter().enumerate() {
        for scalar in [ScalarType::U8, ScalarType::I16, ScalarType::F32, ScalarType::F64] {
            let shapes = [block(scalar)];
            let (wanted, depth) = planes(&shapes, &frame, 0.31);
            let made = draw(&mut *action, &shapes, &frame);
            let error = worst(&made, &wanted);
            assert!(error < TOLERANCE, "view {number}, {scalar}: {error:e}");
            assert!(wanted.iter().any(|p| p[3] > 0.5));
            for (found, wanted) in made.depth.iter().zip(&depth) {
                let far = (f64::from(*found) - wanted).abs();
                assert!(found.is_infinite() == wanted.is_infinite() || far < 1e-3, "{found} {wanted}");
                assert!(wanted.is_infinite() || far < 1e-3, "view {number}, {scalar}: {found} {wanted}");
            }
            assert!(made.statistics.rays > 0 && made.method.blend == "f32");
            action.unmanage(&shapes[0]).unwrap();
        }
    }
}

#[test]
fn clips_and_what_is_opaque_cut_rays() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", 0.27.into())]) else { return };
    let plane = |p: DVec3, n: [f64; 3]| Plane::new(p, n.into()).unwrap();
    let inner = Aabb::new(DVec3::splat(3.0), DVec3::new(8.5, 7.5, 9.0));
    for frame in views() {
        let pixels = frame.width * frame.height;
        let distance: Vec<f32> = (0..pixels).map(|i| if i % 3 == 0 { 21.0 } else { f32::INFINITY }).collect();
        let color: Vec<[f32; 4]> = (0..pixels).map(|i| [0.2, 0.1, (i % 5) as f32 * 0.1, 0.8]).collect();
        let opaque = Opaque { color: Some(color.into()), depth: OpaqueDepth::Distance(distance.into()) };
        let world = Clip::new([ClipRegion::plane(plane(center() + DVec3::Z * 2.0, [0.3, 0.1, -1.0]))]);
        let frame = frame.with_clip(world).with_opaque(opaque);
        let shape = block(ScalarType::U16);
        shape.set_clip(Clip::new([ClipRegion::crop(inner).cut()]));
        let (wanted, _) = planes(std::slice::from_ref(&shape), &frame, 0.27);
        let error = worst(&draw(&mut *action, &[shape], &frame), &wanted);
        assert!(error < TOLERANCE, "{error:e}");
    }
}

/// Shapes that overlap: of second order, and the same whatever the order of drawing.
#[test]
fn overlapping_shapes_are_of_second_order() {
    let _alone = alone();
    let Some(mut action) = action(&[]) else { return };
    let other = block(ScalarType::U8);
    other.set_transform(DAffine3::from_translation(DVec3::new(2.0, -1.5, 1.0)) * other.state().transform);
    let (shapes, frame) = ([block(ScalarType::U8), other], &views()[0]);
    let registry = Registry::with_core();
    let resolved: Vec<_> = shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders()).unwrap()).collect();
    let exact = integrate(&resolved, frame, &ReferenceOptions::default()).unwrap().color;
    let mut error = |step: f64| {
        action.set_option("sample_distance", step.into()).unwrap();
        let made = draw(&mut *action, &shapes, frame);
        let swapped = draw(&mut *action, &[shapes[1].clone(), shapes[0].clone()], frame);
        assert_eq!(made.color, swapped.color);
        let all = made.color.iter().flatten().zip(exact.iter().flatten());
        (all.map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>() / exact.len() as f64).sqrt()
    };
    let order = (error(0.4) / error(0.1)).log2() / 2.0;
    assert!((1.6..2.5).contains(&order), "{order}");
}

#[test]
fn pictures_repeat_and_only_changes_are_moved() {
    let _alone = alone();
    let Some(mut action) = action(&[("termination", 1e-3.into())]) else { return };
    let (shape, frame) = (block(ScalarType::U8), views().remove(0));
    let shapes = [shape];
    let first = draw(&mut *action, &shapes, &frame);
    assert!(first.statistics.rebuilt.iter().any(|r| r.what == "texture" && r.bytes == 12 * 12 * 12));
    let again = draw(&mut *action, &shapes, &frame);
    assert_eq!(first.color, again.color);
    assert!(again.statistics.rebuilt.is_empty(), "{:?}", again.statistics.rebuilt);
    // The polygons' corners alone.
    assert!(again.statistics.uploaded_bytes < 24 * 12 * 10, "{}", again.statistics.uploaded_bytes);
    shapes[0].set_parameter("lookup_table", LookupTable::window_level(100.0, 100.0, 0.5).unwrap());
    let other = draw(&mut *action, &shapes, &frame);
    assert!(other.color != first.color && other.statistics.rebuilt.is_empty());
    assert!(other.statistics.uploaded_bytes < 8192, "{}", other.statistics.uploaded_bytes);
    // A ray that ends early has less than that left to see.
    action.set_option("termination", 0.0.into()).unwrap();
    let whole = draw(&mut *action, &shapes, &frame);
    let pairs = whole.color.iter().zip(other.color.iter());
    assert!(pairs.flat_map(|(a, b)| a.iter().zip(b)).all(|(a, b)| (a - b).abs() <= 1e-3));
}

#[test]
fn what_is_not_drawn_is_refused_by_name() {
    let _alone = alone();
    let Some(mut action) = action(&[]) else { return };
    let volume = data(ScalarType::U8);
    let cube = Block::new(DVec3::ZERO, DVec3::ONE).unwrap().tessellate().unwrap();
    let (cells, places) = (Buffer::from_vec(cube.tetrahedra.concat()), cube.vertices.clone());
    let carrying = Mesh::new(cube.vertices, CellTypes::All(CellType::Tetrahedron), cells).unwrap();
    let carrying = carrying.with_texture_coordinates(places).unwrap();
    let lut = || Appearance::new("lut").with("lookup_table", table());
    let pre = table().pre_interpolated();
    assert_eq!(pre.interpolation(), TableInterpolation::Pre);
    let shapes = [
        (Shape::around(&volume, Appearance::new("gradient").with("lookup_table", pre)), "pre-interpolated table"),
        (Shape::around(&volume, lut().with("component", 3i64)), "component 3"),
    ];
    for (shape, words) in shapes {
        let error = action.manage(&shape).unwrap_err();
        assert!(matches!(error, ActionError::Unsupported { .. }) && error.to_string().contains(words), "{error}");
    }
    // What is known only once it is taken apart.
    let carrying = Shape::new(carrying, lut().with("volume", &volume));
    let error = action.manage(&carrying).unwrap_err();
    assert!(matches!(error, ActionError::Unsupported { .. }) && error.to_string().contains("texture coord"), "{error}");
    // The action is as good as before.
    let shapes = [block(ScalarType::U8)];
    assert!(draw(&mut *action, &shapes, &views()[0]).statistics.rays > 0);
    let error = registry().action("vulkan", &Options::from([("adapter".into(), "no such thing".into())]));
    let error = error.map(|_| ()).unwrap_err();
    let source = std::error::Error::source(&error).unwrap().to_string();
    assert!(source.contains("no such thing") && source.contains("another name"), "{source}");
}

#[test]
fn a_bound_on_planes_widens_the_step_and_says_so() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", 0.01.into()), ("max_planes", 40i64.into())]) else { return };
    let made = draw(&mut *action, &[block(ScalarType::U8)], &views()[0]);
    assert!(made.method.sample_distance > 0.3);
    assert!(made.warnings.iter().any(|w| w.code == WarningCode::SettingAdjusted), "{:?}", made.warnings);
    let planes = made.statistics.details.iter().find(|(n, _)| n == "planes").unwrap();
    assert!(planes.1.parse::<usize>().unwrap() <= 40);
}

#[test]
fn pipelines_are_kept_on_disk_and_damaged_files_left_aside() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pipelines");
    let option = [("pipeline_cache", path.to_str().unwrap().into())];
    let Some(mut action) = action(&option) else { return };
    let frame = views().remove(0);
    let first = draw(&mut *action, &[block(ScalarType::U8)], &frame);
    let file = std::fs::read_dir(&path).unwrap().next().unwrap().unwrap().path();
    let size = std::fs::metadata(&file).unwrap().len();
    assert!(size >= 32);
    for damage in [Vec::new(), vec![7u8; 100], std::fs::read(&file).unwrap()[..20].to_vec()] {
        std::fs::write(&file, damage).unwrap();
        let mut action = self::action(&option).unwrap();
        assert_eq!(draw(&mut *action, &[block(ScalarType::U8)], &frame).color, first.color);
        assert!(std::fs::metadata(&file).unwrap().len() >= 32);
    }
    assert_eq!(std::fs::read_dir(&path).unwrap().count(), 1);
}

/// A registry with a shader of this text, and a block of its look.
fn written(text: &str) -> (Registry, Shape) {
    let mut all = registry();
    let declaration = Declaration::new(Kind::Shader, "written", "1", "for a test")
        .with(ParameterDecl::new("volume", ParameterType::Volume, "data").required());
    let source = Some(Arc::new(ShaderText { file: "written.wgsl".into(), text: text.into() }));
    all.add_shader(ShaderEntry { declaration, compositing: Compositing::Over, source }).unwrap();
    (all, Shape::around(&data(ScalarType::U8), Appearance::new("written")))
}

fn try_in(registry: &Registry, shape: &Shape, step: f64) -> Option<Result<Frame, ActionError>> {
    action(&[])?;
    let options = [("validation".to_owned(), true.into()), ("sample_distance".to_owned(), step.into())];
    let mut action = registry.action("vulkan", &options.into()).unwrap();
    action.manage(shape).unwrap();
    action.begin_draw(&views()[2]).unwrap();
    action.draw(shape).unwrap();
    Some(action.end_draw())
}

#[test]
fn loops_without_end_are_an_error_that_names_the_shader() {
    let _alone = alone();
    let (registry, shape) = written(
        "fn shade(s: Sample) -> Medium {
            var n = 0.0;
            loop { n += 1.0; if n < 0.0 { break; } }
            return Medium(vec3<f32>(n), 1.0);
        }",
    );
    let Some(drawn) = try_in(&registry, &shape, 1.0) else { return };
    let error = drawn.unwrap_err();
    let source = std::error::Error::source(&error).unwrap().to_string();
    assert!(source.contains("written") && source.contains("rounds of loops"), "{error}: {source}");
}

#[test]
fn loops_within_the_budget_are_right() {
    let _alone = alone();
    let (registry, shape) = written(
        "fn shade(s: Sample) -> Medium {
            var sum = 0.0;
            for (var i = 0; i < 100; i++) { if i % 2 == 0 { continue; } sum += 0.01; }
            return Medium(vec3<f32>(sum), 0.1);
        }",
    );
    let Some(drawn) = try_in(&registry, &shape, 0.3) else { return };
    let frame = drawn.unwrap();
    let desc = &views()[2];
    let rays = desc.camera.rays(&desc.viewport()).unwrap();
    for (x, y) in [(24, 20), (36, 4), (30, 12)] {
        let ray = rays.ray(x as f64 + 0.5, y as f64 + 0.5);
        let [a, b] = shape.state().world_bounds().clip_line(ray.origin, ray.direction).unwrap();
        let (found, wanted) = (frame.pixel(x, y), 1.0 - (-0.1 * (b - a)).exp());
        assert!((f64::from(found[3]) - wanted).abs() < 1e-5 && wanted > 0.1, "{found:?} {wanted}");
        assert!((found[0] / found[3] - 0.5).abs() < 1e-5, "{found:?}");
    }
}

/// A device that ends loops early, as llvmpipe does after 65,535 rounds, is an error, not another picture.
#[test]
fn loops_that_a_device_cuts_short_are_an_error() {
    let _alone = alone();
    let mut wanted = None;
    for rounds in [10, 4_000, 12_000, 30_000] {
        let (registry, shape) = written(&format!(
            "fn shade(s: Sample) -> Medium {{
                var n = 0u;
                for (var i = 0u; i < {rounds}u; i++) {{ n += 1u; }}
                return Medium(vec3<f32>(f32(n) / {rounds}.0), 0.1);
            }}"
        ));
        let Some(drawn) = try_in(&registry, &shape, 0.3) else { return };
        match drawn {
            Ok(frame) => {
                let found = frame.pixel(24, 20);
                let first = *wanted.get_or_insert(found);
                assert!(found[3] > 0.1 && found.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
            }
            Err(error) => {
                assert!(error.to_string().contains("number of rounds of loops along a ray"), "{error}");
                assert!(rounds > 1_000, "{rounds}");
            }
        }
    }
}

/// What `select` knows an adapter that is no GPU by.
#[test]
fn software_says_that_it_is() {
    let _alone = alone();
    let Some(action) = action(&[]) else { return };
    let device = action.caps().device;
    assert_eq!(device.contains("llvmpipe"), device.starts_with("software: "), "{device}");
}

#[test]
fn nothing_drawn_is_nothing_seen() {
    let _alone = alone();
    let Some(mut action) = action(&[]) else { return };
    let made = draw(&mut *action, &[], &views()[0]);
    assert!(made.color.iter().all(|c| *c == [0.0; 4]) && made.depth.iter().all(|d| d.is_infinite()));
}
