//! A case's scene as a scene file, so that anybody can draw it with `volact render`.
//!
//! Volumes become NRRD files beside it ([`data`]). What a scene file has no word for (an
//! application's picture, meshes of many points) stands there as a comment, and the text says so.

pub mod data;

use std::fmt::{Display, Write as _};

use volact_core::{
    Camera, Clip, Filter, FrameDesc, Geometry, LookupTable, ParameterValue, Projection, Shape, SliceStyle,
    TableInterpolation, VolumeTexture,
    camera::DepthRange,
    glam::{DAffine3, DMat4, DVec3},
    parameter::ParameterMap,
    shape::ShapeState,
};

use data::Volumes;

/// The most vertices that are written into a scene.
const MOST_VERTICES: usize = 300;

/// The text of a scene file.
pub fn scene(shapes: &[Shape], desc: &FrameDesc) -> String {
    let states: Vec<_> = shapes.iter().map(|s| (s.name().to_owned(), s.state())).collect();
    let volumes = Volumes::of(shapes);
    let mut out = String::from("Scene(\n    version: 1,\n    data: {\n");
    for (name, volume) in volumes.iter() {
        let d = volume.desc();
        _ = writeln!(
            out,
            "        {name:?}: (file: \"{name}.nrrd\", slope: {}, intercept: {}),",
            number(d.slope),
            number(d.intercept)
        );
    }
    out.push_str("    },\n    shapes: [\n");
    for (i, (name, state)) in states.iter().enumerate() {
        shape(&mut out, &format!("{name} {i}"), state, &volumes);
    }
    out.push_str("    ],\n");
    clip(&mut out, "    ", &desc.clip);
    _ = writeln!(out, "    camera: {},", camera(&desc.camera));
    image(&mut out, desc);
    if desc.opaque.is_some() {
        out.push_str("    // not written: the application's picture, which is laid out by the case's rule\n");
    }
    out.push_str(")\n");
    out
}

/// The files that the scene names.
pub fn files(shapes: &[Shape]) -> Vec<(String, Vec<u8>)> {
    Volumes::of(shapes).iter().map(|(name, volume)| (format!("{name}.nrrd"), data::nrrd(volume))).collect()
}

fn image(out: &mut String, desc: &FrameDesc) {
    let v = desc.viewport();
    let [r, g, b, a] = desc.background.map(f64::from).map(number);
    _ = writeln!(
        out,
        "    image: (size: ({}, {}), viewport: (x: {}, y: {}, width: {}, height: {}), background: ({r}, {g}, {b}, {a}), \
         depth_threshold: {}),",
        desc.width,
        desc.height,
        v.x,
        v.y,
        v.width,
        v.height,
        number(f64::from(desc.depth_threshold)),
    );
}

fn shape(out: &mut String, name: &str, state: &ShapeState, volumes: &Volumes) {
    _ = writeln!(out, "        (\n            name: {name:?},");
    geometry(out, &*state.geometry);
    _ = writeln!(out, "            shader: {:?},\n            parameters: {{", state.shader);
    parameters(out, &state.parameters, volumes);
    out.push_str("            },\n");
    _ = writeln!(out, "            transform: [{}],", affine(&state.transform));
    clip(out, "            ", &state.clip);
    if let Some(slices) = state.geometry.slices() {
        let style = if slices.style == SliceStyle::Opaque { "Opaque" } else { "Blended" };
        let planes = list(slices.planes.iter().map(plane));
        _ = writeln!(out, "            slices: (planes: [{planes}], style: {style}, volume: {}),", slices.volume);
    }
    out.push_str("        ),\n");
}

fn geometry(out: &mut String, geometry: &dyn Geometry) {
    if let Some(block) = geometry.as_block() {
        let (offset, size) = (vector(block.min), vector(block.size()));
        _ = writeln!(out, "            geometry: Block(offset: {offset}, dimensions: {size}),");
        return;
    }
    if let Some(surface) = geometry.as_surface() {
        let (points, triangles) = (surface.points(), surface.triangles());
        if points.len() > MOST_VERTICES {
            _ = writeln!(out, "            // not written: a surface of {} triangles", triangles.len());
            return;
        }
        let points = list(points.iter().map(vector));
        let triangles = list(triangles.iter().map(|t| format!("{t:?}")));
        _ = writeln!(out, "            geometry: Mesh(points: [{points}], triangles: [{triangles}]),");
        return;
    }
    match geometry.tessellate() {
        Ok(made) if made.vertices.len() <= MOST_VERTICES => {
            let points = list(made.vertices.iter().map(vector));
            let cells = list(made.tetrahedra.iter().map(|t| format!("{t:?}")));
            let texture = made
                .texture_coordinates
                .as_ref()
                .map_or(String::new(), |t| format!(", texture_coordinates: [{}]", list(t.iter().map(vector))));
            _ = writeln!(out, "            geometry: Mesh(points: [{points}], tetrahedra: [{cells}]{texture}),");
        }
        Ok(made) => {
            let (n, name) = (made.tetrahedra.len(), geometry.name());
            _ = writeln!(out, "            // not written: geometry {name:?} of {n} tetrahedra");
        }
        Err(_) => _ = writeln!(out, "            // not written: geometry {:?}", geometry.name()),
    }
}

fn parameters(out: &mut String, parameters: &ParameterMap, volumes: &Volumes) {
    for (name, value) in parameters {
        let text = match value {
            ParameterValue::Volume(texture) => volume(texture, volumes),
            ParameterValue::Table(t) => table(t),
            ParameterValue::Int(i) => i.to_string(),
            ParameterValue::Float(f) => number(*f),
            ParameterValue::Bool(b) => b.to_string(),
            ParameterValue::Choice(word) => format!("{word:?}"),
            ParameterValue::Vec3(v) => vector(*v),
            ParameterValue::Attribute(a) if a.len() * a.components <= 4 * MOST_VERTICES => {
                let each = (0..a.len()).flat_map(|i| (0..a.components).map(move |c| (i, c)));
                let values = list(each.map(|(i, c)| number(a.value(i, c))));
                let (name, components) = (&a.name, a.components);
                format!("Attribute(name: {name:?}, components: {components}, scalar: f64, values: [{values}])")
            }
            other => {
                _ = writeln!(out, "                // not written: {name:?}, a {}", other.kind().name());
                continue;
            }
        };
        _ = writeln!(out, "                {name:?}: {text},");
    }
}

fn volume(texture: &VolumeTexture, volumes: &Volumes) -> String {
    let name = volumes.name(texture.volume());
    let (data, place) = (texture.data_roi(), texture.geometry_roi());
    let corner = |c: [usize; 3]| format!("({}, {}, {})", c[0], c[1], c[2]);
    let [lo, hi] = texture.range().map(number);
    let filter = if texture.filter() == Filter::Nearest { "Nearest" } else { "Linear" };
    let luminance = texture.meaning() == volact_core::volume::Components::Luminance;
    format!(
        "Volume(data: {name:?}, data_roi: ({}, {}), geometry_roi: ({}, {}), range: ({lo}, {hi}), filter: {filter}, \
         luminance: {luminance})",
        corner(data.min),
        corner(data.max),
        vector(place.min),
        vector(place.max),
    )
}

fn table(table: &LookupTable) -> String {
    let points = table.points([0.0, 1.0]);
    let point = |p: &volact_core::ControlPoint| {
        format!("({}, {}, {})", number(p.value), vector(DVec3::from_array(p.color)), number(p.opacity))
    };
    let pre = table.interpolation() == TableInterpolation::Pre;
    format!("Table(points: [{}], pre_interpolated: {pre})", list(points.iter().map(point)))
}

fn clip(out: &mut String, indent: &str, clip: &Clip) {
    let region = |r: &volact_core::ClipRegion| {
        let planes = format!("Planes([{}])", list(r.bounding_planes().iter().map(plane)));
        if r.keeps_inside() { planes } else { format!("Cut({planes})") }
    };
    if !clip.is_none() {
        _ = writeln!(out, "{indent}clip: [{}],", list(clip.regions().iter().map(region)));
    }
}

fn plane(plane: &volact_core::Plane) -> String {
    let normal = plane.normal();
    // The point of the plane nearest to the origin: n·p + offset is 0 there.
    let point = normal * -plane.distance(DVec3::ZERO) / normal.length_squared();
    format!("Plane(point: {}, normal: {})", vector(point), vector(normal))
}

fn camera(camera: &Camera) -> String {
    match camera {
        Camera::LookAt { eye, target, up, projection, near, far } => {
            let (name, what, value) = match projection {
                Projection::Perspective { fov_y } => ("Perspective", "fov_y", fov_y),
                Projection::Orthographic { height } => ("Orthographic", "height", height),
            };
            format!(
                "{name}(eye: {}, target: {}, up: {}, {what}: {}, near: {}, far: {})",
                vector(*eye),
                vector(*target),
                vector(*up),
                number(*value),
                number(*near),
                number(*far)
            )
        }
        Camera::Matrices { view, projection, depth } => {
            let depth = if *depth == DepthRange::ZeroToOne { "ZeroToOne" } else { "MinusOneToOne" };
            format!("Matrices(view: {}, projection: {}, depth: {depth})", matrix(view), matrix(projection))
        }
    }
}

fn affine(map: &DAffine3) -> String {
    format!("Matrix{}", matrix(&DMat4::from(*map)))
}

/// Row by row, as on paper.
fn matrix(m: &DMat4) -> String {
    let row = |i: usize| {
        let r = m.row(i);
        format!("({}, {}, {}, {})", number(r.x), number(r.y), number(r.z), number(r.w))
    };
    format!("({}, {}, {}, {})", row(0), row(1), row(2), row(3))
}

fn vector(v: DVec3) -> String {
    format!("({}, {}, {})", number(v.x), number(v.y), number(v.z))
}

/// A number as RON has it.
fn number(v: f64) -> String {
    if v.is_nan() {
        "NaN".into()
    } else if v.is_infinite() {
        if v > 0.0 { "inf".into() } else { "-inf".into() }
    } else {
        format!("{v:?}")
    }
}

fn list(items: impl Iterator<Item = impl Display>) -> String {
    let mut out = String::new();
    for (i, item) in items.enumerate() {
        _ = write!(out, "{}{item}", if i > 0 { ", " } else { "" });
    }
    out
}
