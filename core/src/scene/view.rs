//! Reads the camera and the image of a scene.

use glam::DVec3;

use super::{
    CameraSpec, ImageSpec,
    parameters::{head, matrix, rgba},
    reader::{At, Fields, Reader},
};
use crate::{
    Camera, Projection, View, Viewport,
    camera::{CameraError, DepthRange},
    frame::MAX_PIXELS,
};

/// A fitting view, or a camera in numbers.
pub(super) fn camera(reader: &mut Reader, at: &At) -> Option<CameraSpec> {
    let camera = match head(at) {
        "View" => match reader.tuple(at, "View").as_deref() {
            Some([name]) => return view(reader, name).map(CameraSpec::View),
            _ => return reader.refuse(at, "View(\"front\")"),
        },
        "Perspective" => {
            let fields = look_fields(reader, at, "Perspective", "fov_y")?;
            let fov = reader.required(&fields, "fov_y", "the full vertical angle in degrees");
            let wanted = "above 0 and below 180 degrees";
            let fov_y = fov.and_then(|at| reader.float_where(&at, |v| v > 0.0 && v < 180.0, wanted));
            look_at(reader, &fields, fov_y.map(|fov_y| Projection::Perspective { fov_y }))
        }
        "Orthographic" => {
            let fields = look_fields(reader, at, "Orthographic", "height")?;
            let height = reader.required(&fields, "height", "the height of the view in world units");
            let height = height.and_then(|at| reader.float_where(&at, |v| v > 0.0, "a positive, finite number"));
            look_at(reader, &fields, height.map(|height| Projection::Orthographic { height }))
        }
        "Matrices" => matrices(reader, at),
        other => {
            let known = ["View", "Perspective", "Orthographic", "Matrices"];
            reader.unknown(at, other, "one of ", &known)
        }
    }?;
    let whole = Viewport { x: 0, y: 0, width: 1, height: 1 };
    if let Err(CameraError { what, found, wanted }) = camera.rays(&whole) {
        reader.fault(at, format!("{what} {found}"), wanted);
        return None;
    }
    Some(CameraSpec::Camera(camera))
}

/// A view by its name.
pub(crate) fn view(reader: &mut Reader, at: &At) -> Option<View> {
    let text = reader.text(at)?;
    let known = View::ALL.map(|(name, _)| name);
    View::from_name(text).or_else(|| reader.unknown(at, text, "one of ", &known))
}

fn look_fields<'a>(reader: &mut Reader, at: &At<'a>, name: &str, own: &str) -> Option<Fields<'a>> {
    reader.fields(at, &[name], &["eye", "target", "up", own, "near", "far"])
}

fn look_at(reader: &mut Reader, fields: &Fields, projection: Option<Projection>) -> Option<Camera> {
    let eye = reader.required(fields, "eye", "the eye's position (x, y, z)");
    let target = reader.required(fields, "target", "the point in the middle of the picture (x, y, z)");
    let eye = eye.and_then(|at| reader.vec3(&at));
    let target = target.and_then(|at| reader.vec3(&at));
    let up = fields.optional("up").map_or(Some(DVec3::Z), |at| reader.vec3(&at));
    let near = fields.optional("near").map_or(Some(0.0), |at| reader.number(&at));
    let far = fields.optional("far").map_or(Some(f64::INFINITY), |at| reader.number(&at));
    Some(Camera::LookAt { eye: eye?, target: target?, up: up?, projection: projection?, near: near?, far: far? })
}

fn matrices(reader: &mut Reader, at: &At) -> Option<Camera> {
    let fields = reader.fields(at, &["Matrices"], &["view", "projection", "depth"])?;
    let rows = "four rows of four numbers, ((a, b, c, d), …)";
    let view = reader.required(&fields, "view", rows);
    let projection = reader.required(&fields, "projection", rows);
    let ranges = [("ZeroToOne", DepthRange::ZeroToOne), ("MinusOneToOne", DepthRange::MinusOneToOne)];
    let depth = fields.optional("depth").map_or(Some(DepthRange::default()), |at| reader.word(&at, &ranges));
    let view = view.and_then(|at| matrix(reader, &at, ""));
    let projection = projection.and_then(|at| matrix(reader, &at, ""));
    Some(Camera::Matrices { view: view?, projection: projection?, depth: depth? })
}

pub(super) fn image(reader: &mut Reader, at: &At) -> Option<ImageSpec> {
    let fields = reader.fields(at, &["Image"], &["size", "viewport", "background", "depth_threshold"])?;
    let spec = ImageSpec {
        size: fields.optional("size").and_then(|at| size(reader, &at)),
        viewport: fields.optional("viewport").and_then(|at| viewport(reader, &at)),
        background: fields.optional("background").and_then(|at| background(reader, &at)),
        depth_threshold: fields
            .optional("depth_threshold")
            .and_then(|at| reader.float_where(&at, |v| v as f32 > 0.0 && v <= 1.0, "above 0 and at most 1"))
            .map(|v| v as f32),
    };
    if let (Some([w, h]), Some(v), Some(at)) = (spec.size, spec.viewport, fields.optional("viewport"))
        && (v.x.saturating_add(v.width) > w || v.y.saturating_add(v.height) > h)
    {
        reader.fault(
            &at,
            format!("{} × {} pixels from ({}, {})", v.width, v.height, v.x, v.y),
            format!("a part of {w} × {h} pixels"),
        );
    }
    Some(spec)
}

/// Columns and rows of a picture.
pub(crate) fn size(reader: &mut Reader, at: &At) -> Option<[usize; 2]> {
    let size = reader.array(at, "columns and rows, (width, height)", |r, at| r.count(at, 1))?;
    if size[0].saturating_mul(size[1]) > MAX_PIXELS {
        reader.fault(at, format!("{} × {} pixels", size[0], size[1]), format!("at most {MAX_PIXELS} pixels"));
        return None;
    }
    Some(size)
}

/// A background: straight colour and opacity.
pub(crate) fn background(reader: &mut Reader, at: &At) -> Option<[f32; 4]> {
    rgba(reader, at, "(red, green, blue, opacity)")
}

fn viewport(reader: &mut Reader, at: &At) -> Option<Viewport> {
    let fields = reader.fields(at, &["Viewport"], &["x", "y", "width", "height"])?;
    let mut pixels = |name, least| {
        let at = reader.required(&fields, name, "a number of pixels")?;
        reader.count(&at, least)
    };
    let (x, y, width, height) = (pixels("x", 0), pixels("y", 0), pixels("width", 1), pixels("height", 1));
    Some(Viewport { x: x?, y: y?, width: width?, height: height? })
}
