//! What is prepared when, who shares it, and what is refused.

use std::{any::Any, sync::Arc};

use volact_core::{
    Aabb, Appearance, Block, Geometry, Plane, ScalarType, Shape, SliceStyle, Sliced, Slices, Tessellation,
    geometry::GeometryError,
    glam::{DAffine3, DVec3},
};

use super::scenes::{all, ball, cpu, draw, field, grid, look, lut, warm};

fn rebuilt(frame: &volact_core::Frame) -> Vec<&str> {
    frame.statistics.rebuilt.iter().map(|r| r.what.as_str()).collect()
}

fn mesh(n: usize, shift: f64) -> volact_core::StructuredMesh {
    let points = grid(n, DVec3::new(22.0, 20.0, 24.0), 0.04).0;
    volact_core::StructuredMesh::new([n; 3], points.into_iter().map(|p| p + shift).collect()).unwrap()
}

#[test]
fn geometries_are_prepared_once_and_let_go() {
    let volume = ball(ScalarType::U8);
    let shared: Arc<dyn Geometry> = Arc::new(mesh(8, 0.0));
    let shape =
        |name: &str| Shape::build(name, Arc::clone(&shared), look(warm()).with("volume", &volume), DAffine3::IDENTITY);
    let shapes = [shape("one"), shape("other")];
    let desc = all(12).swap_remove(0).desc;
    let mut action = cpu(0.5, &[]);
    let first = draw(&mut *action, &shapes, &desc);
    assert_eq!(rebuilt(&first).iter().filter(|w| **w == "tetrahedra").count(), 1, "{:?}", rebuilt(&first));
    let held = first.statistics.resident_bytes;
    assert!(held > 6 * 343 * 48, "{held} bytes");
    let mut turned = desc.clone();
    turned.camera = all(12).swap_remove(1).desc.camera;
    assert_eq!(rebuilt(&draw(&mut *action, &shapes, &turned)), [""; 0], "another camera");
    // Planes through a mesh are not part of what is prepared.
    let plane = Plane::new(DVec3::splat(9.0), DVec3::X).unwrap();
    for x in [0.0, 1.0] {
        let planes = vec![plane, Plane::new(DVec3::splat(9.0 + x), DVec3::Y).unwrap()];
        let slices = Slices { planes, style: SliceStyle::Blended, volume: true };
        shapes[0].set_geometry(Sliced::new(Arc::clone(&shared), slices).unwrap());
        assert!(!rebuilt(&draw(&mut *action, &shapes, &desc)).contains(&"tetrahedra"));
    }
    shapes[0].set_geometry(mesh(8, 1.0));
    let changed = draw(&mut *action, &shapes, &desc);
    assert_eq!(rebuilt(&changed).iter().filter(|w| **w == "tetrahedra").count(), 1);
    shapes.iter().for_each(|s| action.unmanage(s).unwrap());
    action.begin_draw(&desc).unwrap();
    assert_eq!(action.end_draw().unwrap().statistics.resident_bytes, 0);
}

#[test]
fn shapes_of_the_same_data_and_table_share_their_tables() {
    let (volume, table) = (ball(ScalarType::U8), warm());
    let desc = all(12).swap_remove(0).desc;
    let held = |shapes: &[Shape]| draw(&mut *cpu(0.5, &[]), shapes, &desc).statistics.resident_bytes;
    let shape = |shift: f64| {
        let shape = lut(&volume, table.clone());
        shape.set_transform(DAffine3::from_translation(DVec3::splat(shift)) * DAffine3::from_rotation_z(shift));
        shape
    };
    assert_eq!(held(&[shape(0.0)]), held(&[shape(0.0), shape(1.0), shape(2.0)]));
}

#[derive(Debug)]
struct Own(Tessellation);

impl Geometry for Own {
    fn name(&self) -> &str {
        "own"
    }
    fn bounds(&self) -> Aabb {
        Aabb::new(DVec3::ZERO, DVec3::ONE)
    }
    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        Ok(self.0.clone())
    }
    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// What is wrong with a geometry is found when it is prepared, and leaves the action usable.
#[test]
fn damaged_geometries_are_refused_before_anything_is_drawn() {
    let volume = ball(ScalarType::U8);
    let mut damaged = Block::new(DVec3::ZERO, DVec3::ONE).unwrap().tessellate().unwrap();
    damaged.tetrahedra[3][0] = 80;
    let desc = all(8).swap_remove(0).desc;
    let sound = lut(&volume, warm());
    let broken = Shape::new(Own(damaged), look(warm()).with("volume", &volume));
    let mut action = cpu(0.5, &[]);
    action.manage(&broken).unwrap();
    let error = action.begin_draw(&desc).unwrap_err();
    let cause = std::error::Error::source(&error).expect("a cause").to_string();
    assert!(cause.contains("tetrahedron 3") && cause.contains("80"), "{error}: {cause}");
    action.unmanage(&broken).unwrap();
    draw(&mut *action, &[sound], &desc);
}

#[test]
fn components_that_are_not_there_are_refused() {
    let shape = field(3, |u| u.x, warm());
    shape.set_parameter("component", 2i64);
    let error = cpu(0.5, &[]).manage(&shape).unwrap_err().to_string();
    assert!(error.contains("component 2") && error.contains("scalars with 1"), "{error}");
}

/// A frame says how each shape was drawn.
#[test]
fn methods_name_what_was_done() {
    let says = |name: &str, wanted: &[&str]| {
        let scene = all(8).into_iter().find(|s| s.name == name).unwrap_or_else(|| panic!("no scene {name}"));
        let method = draw(&mut *cpu(0.5, &[]), &scene.shapes, &scene.desc).method;
        let text = format!("{method:?}");
        assert!(wanted.iter().all(|w| text.contains(w)), "{name}: {text}");
    };
    says("two meshes", &["cell by cell", "linear in each cell", "sample_distance: 0.0"]);
    says("a volume in a mesh", &["ray casting", "cell by cell", "post-interpolated", "sample_distance: 0.5"]);
    says("a wall in two volumes", &["nearest triangle", "ray casting"]);
    says("components and classified voxels", &["components", "pre-interpolated"]);
}

/// A surface alone is something to see, and nothing is not.
#[test]
fn a_wall_alone_is_met() {
    let wall = all(16).into_iter().find(|s| s.name == "a clipped wall").unwrap();
    let shapes: Vec<Shape> = wall.shapes.into_iter().filter(|s| s.state().shader == "surface").collect();
    let frame = draw(&mut *cpu(0.5, &[]), &shapes, &wall.desc);
    assert!(frame.statistics.rays > 0 && frame.color.iter().any(|c| c[3] == 1.0));
    let unseen = |frame: &volact_core::Frame| frame.warnings.iter().any(|w| w.message.contains("no ray meets"));
    assert!(!unseen(&frame), "{:?}", frame.warnings);
    shapes[0].set_transform(DAffine3::from_translation(DVec3::splat(1e3)));
    let frame = draw(&mut *cpu(0.5, &[]), &shapes, &wall.desc);
    assert!(unseen(&frame));
    let empty = Appearance::new("surface");
    assert!(cpu(0.5, &[]).manage(&Shape::new(Block::new(DVec3::ZERO, DVec3::ONE).unwrap(), empty)).is_err());
}
