//! The action as users meet it.

use volact_core::{
    Aabb, ActionError, Appearance, FrameDesc, Geometry, Options, ParameterValue, Registry, RenderAction, Shape,
    Tessellation, View, WarningCode, geometry::GeometryError,
};

use super::common::{along_z, lut, point, table, volume_of};

fn registry() -> Registry {
    let mut registry = Registry::with_core();
    volact_cpu::reference::register(&mut registry).unwrap();
    registry
}

fn action(options: &[(&str, ParameterValue)]) -> Box<dyn RenderAction> {
    let options: Options = options.iter().map(|(n, v)| ((*n).to_owned(), v.clone())).collect();
    registry().action("reference", &options).unwrap()
}

fn ramp() -> Shape {
    let data = volume_of([3, 3, 4], |[x, y, z]| (x + y + z) as f64 / 7.0);
    lut(&data, table(&[point(0.1, [0.2; 3], 0.0), point(0.9, [0.8; 3], 0.9)]), 1.0)
}

fn draw(action: &mut dyn RenderAction, shape: &Shape, frame: &FrameDesc) -> volact_core::Frame {
    action.manage(shape).unwrap();
    action.begin_draw(frame).unwrap();
    action.draw(shape).unwrap();
    action.end_draw().unwrap()
}

#[test]
fn frame_says_what_it_certifies() {
    let shape = ramp();
    let frame = draw(&mut *action(&[]), &shape, &FrameDesc::fit(&shape, View::Iso, 16, 12));
    let detail = |name: &str| frame.statistics.details.iter().find(|(n, _)| n == name).unwrap().1.clone();
    assert_eq!(detail("pixels certified"), "192");
    assert_eq!(detail("pixels not certified"), "0");
    assert!(detail("certificate").starts_with("192 of 192 pixels enclosed to 1e-9"));
    assert!(frame.pixel(8, 6)[3] > 0.3 && frame.pixel(0, 0) == [0.0; 4]);
    assert_eq!(frame.method.classification, "exact");
    assert!(frame.warnings.iter().all(|w| w.code != WarningCode::NotCertified));
}

#[test]
fn pixels_wider_than_asked_are_counted_in_a_warning() {
    let shape = ramp();
    let mut action = action(&[("tolerance", 0.0.into())]);
    let frame = draw(&mut *action, &shape, &FrameDesc::fit(&shape, View::Iso, 16, 12));
    assert!(frame.warnings.iter().any(|w| w.code == WarningCode::NotCertified));
    action.set_option("tolerance", 1e-9.into()).unwrap();
    action.begin_draw(&FrameDesc::fit(&shape, View::Iso, 16, 12)).unwrap();
    action.draw(&shape).unwrap();
    assert!(action.end_draw().unwrap().warnings.iter().all(|w| w.code != WarningCode::NotCertified));
}

#[test]
fn lattice_needs_its_step() {
    let with = |options: &[(&str, ParameterValue)]| {
        let options: Options = options.iter().map(|(n, v)| ((*n).to_owned(), v.clone())).collect();
        registry().action("reference", &options).map(|_| ()).unwrap_err().to_string()
    };
    assert!(with(&[("method", "rays".into())]).contains("\"sample_distance\" is missing"));
    assert!(with(&[("method", "ray".into())]).contains("did you mean \"rays\"?"));
    assert!(with(&[("sample_distance", 0.0.into())]).contains("sample_distance"));
    let error = action(&[]).set_option("method", "planes".into()).unwrap_err();
    assert!(matches!(error, ActionError::Options { .. }));
    let frame = draw(
        &mut *action(&[("method", "planes".into()), ("sample_distance", 0.1.into())]),
        &ramp(),
        &along_z(0.4, 0.5),
    );
    assert_eq!(frame.method.sample_distance, 0.1);
    let mut fine = action(&[("method", "rays".into()), ("sample_distance", 1e-300.into())]);
    let shape = ramp();
    fine.manage(&shape).unwrap();
    fine.begin_draw(&along_z(0.4, 0.5)).unwrap();
    fine.draw(&shape).unwrap();
    assert!(matches!(fine.end_draw().unwrap_err(), ActionError::Limit { .. }));
}

#[derive(Debug)]
struct Ball;

impl Geometry for Ball {
    fn name(&self) -> &str {
        "ball"
    }
    fn bounds(&self) -> Aabb {
        Aabb::new(volact_core::glam::DVec3::NEG_ONE, volact_core::glam::DVec3::ONE)
    }
    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        Err(GeometryError::invalid(self.name(), "air", 0, "some"))
    }
    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}

#[test]
fn what_it_cannot_draw_is_named() {
    let shape = ramp();
    shape.set_geometry(Ball);
    let mut burst = action(&[]);
    burst.manage(&shape).unwrap();
    burst.begin_draw(&along_z(0.4, 0.5)).unwrap();
    burst.draw(&shape).unwrap();
    let ActionError::Geometry { source, .. } = burst.end_draw().unwrap_err() else { panic!("another error") };
    assert_eq!(source.to_string(), "geometry \"ball\": air is 0, wanted some");
    let data = volume_of([2; 3], |_| 0.0);
    let shape = Shape::around(&data, Appearance::new("mip").with("component", 2i64));
    let message = action(&[]).manage(&shape).unwrap_err().to_string();
    assert!(message.contains("component 2 of a volume that has 1"), "{message}");
}

#[test]
fn nothing_drawn_is_nothing() {
    let mut action = action(&[]);
    action.begin_draw(&along_z(0.0, 0.0)).unwrap();
    let frame = action.end_draw().unwrap();
    assert_eq!((frame.pixel(0, 0), frame.depth[0]), ([0.0; 4], f32::INFINITY));
    assert!(action.end_draw().is_err());
}
