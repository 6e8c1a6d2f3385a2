//! Reads a scene from its document: data, shapes, action.

use std::{collections::BTreeSet, time::Duration};

use glam::{DAffine3, DVec3};

use super::{
    ActionSpec, DataSpec, Places, Problems, SCENE_VERSION, SceneFile, ShapeSpec, TransformStep, check,
    cuts::{clip, opaque, slices},
    document::{self, Kind},
    geometry::geometry,
    parameters::{head, matrix, parameters, plain_parameters},
    reader::{At, Reader},
    view::{camera, image},
};
use crate::{Registry, planner::Bound};

/// Reads and checks a text.
pub(super) fn parse(text: &str, registry: Option<&Registry>) -> Result<SceneFile, Problems> {
    let root = document::parse(text).map_err(|problem| Problems::new(vec![problem]))?;
    let mut reader = Reader::default();
    let at = reader.root(&root);
    let scene = scene(&mut reader, &at);
    let (places, mut problems) = reader.finish();
    let Some(mut scene) = scene else { return Err(Problems::new(problems)) };
    scene.places = Places(places);
    problems.extend(check::references(&scene));
    problems.extend(registry.into_iter().flat_map(|registry| check::check(&scene, registry)));
    if problems.is_empty() { Ok(scene) } else { Err(Problems::new(problems)) }
}

fn scene(reader: &mut Reader, at: &At) -> Option<SceneFile> {
    let known = ["version", "data", "shapes", "clip", "opaque", "camera", "image", "action", "accuracy", "time"];
    let fields = reader.fields(at, &["Scene"], &known)?;
    reader.version(&fields, SCENE_VERSION);
    let mut scene = SceneFile::default();
    if let Some(at) = fields.optional("data") {
        for (name, at) in reader.map(&at, "a map of files by name, {\"name\": (file: \"…\")}") {
            let spec = data(reader, &at).unwrap_or_default();
            scene.data.insert(name.to_owned(), spec);
        }
    }
    if let Some(at) = reader.required(&fields, "shapes", "a list of shapes") {
        let shapes = reader.list(&at, "a list of shapes").unwrap_or_default();
        scene.shapes = shapes.iter().map(|at| shape(reader, at).unwrap_or_default()).collect();
        unique_names(reader, &shapes, &scene);
    }
    scene.clip = fields.optional("clip").and_then(|at| clip(reader, &at)).unwrap_or_default();
    scene.opaque = fields.optional("opaque").and_then(|at| opaque(reader, &at));
    scene.camera = fields.optional("camera").and_then(|at| camera(reader, &at));
    scene.image = fields.optional("image").and_then(|at| image(reader, &at)).unwrap_or_default();
    scene.action = fields.optional("action").and_then(|at| action(reader, &at));
    scene.goals.bound = fields.optional("accuracy").and_then(|at| accuracy(reader, &at));
    scene.goals.time = fields.optional("time").and_then(|at| time(reader, &at));
    Some(scene)
}

/// `MaxError(0.002)` or `Rmse(0.0005)`.
fn accuracy(reader: &mut Reader, at: &At) -> Option<Bound> {
    for (name, bound) in [("MaxError", Bound::MaxError as fn(f64) -> Bound), ("Rmse", Bound::Rmse)] {
        if let Some([value]) = reader.tuple(at, name).as_deref() {
            return reader.float_where(value, |v| v > 0.0, "a positive, finite number").map(bound);
        }
    }
    reader.refuse(at, "MaxError(error) or Rmse(error)")
}

/// `Milliseconds(40)`.
fn time(reader: &mut Reader, at: &At) -> Option<Duration> {
    match reader.tuple(at, "Milliseconds").as_deref() {
        Some([value]) => {
            let milliseconds = reader.float_where(value, |v| v > 0.0 && v <= 1e9, "above 0 and at most 1e9");
            milliseconds.map(|ms| Duration::from_secs_f64(ms * 1e-3))
        }
        _ => reader.refuse(at, "Milliseconds(time)"),
    }
}

fn unique_names(reader: &mut Reader, places: &[At], scene: &SceneFile) {
    let mut names = BTreeSet::new();
    for (i, at) in places.iter().enumerate() {
        let name = scene.shape_name(i);
        if !names.insert(name.clone()) {
            reader.fault(at, format!("a second shape called {name:?}"), "a name of its own for each shape");
        }
    }
}

fn data(reader: &mut Reader, at: &At) -> Option<DataSpec> {
    let known = ["file", "loader", "options", "spacing", "placement", "slope", "intercept", "unit"];
    let fields = reader.fields(at, &["Data"], &known)?;
    let file = reader.required(&fields, "file", "a path relative to the scene file");
    let positive = |r: &mut Reader, at: &At| r.float_where(at, |v| v > 0.0, "a positive, finite number");
    Some(DataSpec {
        file: file.and_then(|at| reader.text(&at)).map(Into::into).unwrap_or_default(),
        loader: fields.optional("loader").and_then(|at| reader.name(&at)),
        options: fields.optional("options").map(|at| plain_parameters(reader, &at)).unwrap_or_default(),
        spacing: fields
            .optional("spacing")
            .and_then(|at| reader.array(&at, "three numbers (x, y, z)", positive))
            .map(DVec3::from_array),
        placement: fields.optional("placement").and_then(|at| transform(reader, &at)),
        slope: fields
            .optional("slope")
            .and_then(|at| reader.float_where(&at, |v| v != 0.0, "a finite number other than 0")),
        intercept: fields.optional("intercept").and_then(|at| reader.float(&at)),
        unit: fields.optional("unit").and_then(|at| reader.name(&at)),
    })
}

fn shape(reader: &mut Reader, at: &At) -> Option<ShapeSpec> {
    let known = ["name", "geometry", "shader", "parameters", "transform", "slices", "clip"];
    let fields = reader.fields(at, &["Shape"], &known)?;
    let shader = reader.required(&fields, "shader", "a shader's name");
    Some(ShapeSpec {
        name: fields.optional("name").and_then(|at| reader.name(&at)),
        geometry: fields.optional("geometry").and_then(|at| geometry(reader, &at)).unwrap_or_default(),
        shader: shader.and_then(|at| reader.name(&at)).unwrap_or_default(),
        parameters: fields.optional("parameters").map(|at| parameters(reader, &at)).unwrap_or_default(),
        transform: fields.optional("transform").and_then(|at| transform(reader, &at)),
        slices: fields.optional("slices").and_then(|at| slices(reader, &at)),
        clip: fields.optional("clip").and_then(|at| clip(reader, &at)).unwrap_or_default(),
    })
}

/// One step or a list of steps, applied in order.
fn transform(reader: &mut Reader, at: &At) -> Option<Vec<TransformStep>> {
    if !matches!(at.node.kind, Kind::List(_)) {
        return step(reader, at).map(|step| vec![step]);
    }
    let steps = reader.list(at, "a list of steps")?;
    let read: Vec<_> = steps.iter().map(|at| step(reader, at)).collect();
    read.into_iter().collect()
}

fn step(reader: &mut Reader, at: &At) -> Option<TransformStep> {
    let nonzero = |v: f64| v != 0.0;
    match head(at) {
        "Placement" => Some(TransformStep::Placement),
        "Translate" => named_vec3(reader, at, "Translate", |_| true, "a finite number").map(TransformStep::Translate),
        "Scale" => match reader.tuple(at, "Scale").as_deref() {
            Some([one]) => {
                let factor = reader.float_where(one, nonzero, "a finite number other than 0")?;
                Some(TransformStep::Scale(DVec3::splat(factor)))
            }
            _ => named_vec3(reader, at, "Scale", nonzero, "a finite number other than 0").map(TransformStep::Scale),
        },
        "Rotate" => {
            let fields = reader.fields(at, &["Rotate"], &["axis", "degrees"])?;
            let axis = reader.required(&fields, "axis", "a direction (x, y, z)");
            let degrees = reader.required(&fields, "degrees", "an angle in degrees");
            let degrees = degrees.and_then(|at| reader.float(&at));
            let axis = axis.and_then(|at| {
                let axis = reader.vec3(&at)?;
                if axis.try_normalize().is_some() {
                    Some(axis)
                } else {
                    reader.refuse(&at, "a direction with a length")
                }
            });
            Some(TransformStep::Rotate { axis: axis?, degrees: degrees? })
        }
        "Matrix" => {
            let matrix = matrix(reader, at, "Matrix")?;
            let affine = DAffine3::from_mat4(matrix);
            if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
                return reader.refuse(at, "an affine map: a last row of (0, 0, 0, 1)");
            }
            if affine.matrix3.determinant() == 0.0 || !affine.inverse().is_finite() {
                return reader.refuse(at, "a matrix that can be inverted");
            }
            Some(TransformStep::Matrix(affine))
        }
        other => {
            let known = ["Placement", "Translate", "Rotate", "Scale", "Matrix"];
            reader.unknown(at, other, "a step or a list of steps: ", &known)
        }
    }
}

fn named_vec3(reader: &mut Reader, at: &At, name: &str, good: fn(f64) -> bool, wanted: &str) -> Option<DVec3> {
    let Some(items) = reader.tuple(at, name).filter(|items| items.len() == 3) else {
        return reader.refuse(at, format!("{name}(x, y, z)"));
    };
    let read: Vec<_> = items.iter().map(|at| reader.float_where(at, good, wanted)).collect();
    let read: Vec<f64> = read.into_iter().collect::<Option<_>>()?;
    Some(DVec3::from_slice(&read))
}

/// `"cpu"`, or `(name: "cpu", options: {…})`.
fn action(reader: &mut Reader, at: &At) -> Option<ActionSpec> {
    if matches!(at.node.kind, Kind::Text(_)) {
        return Some(ActionSpec { name: reader.name(at)?, ..ActionSpec::default() });
    }
    let fields = reader.fields(at, &["Action"], &["name", "options"])?;
    let name = reader.required(&fields, "name", "an action's name").and_then(|at| reader.name(&at));
    let options = fields.optional("options").map(|at| plain_parameters(reader, &at)).unwrap_or_default();
    Some(ActionSpec { name: name?, options })
}
