//! The scenes of the peers' folder: JSON, described at the head of its `scene.py`.

use std::{collections::BTreeMap, fs, path::Path};

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use volact_core::{
    Appearance, Camera, ControlPoint, FrameDesc, LookupTable, ScalarType, Shape, Volume, VolumeDesc, glam::DVec3,
};

/// A scene file.
#[derive(Debug, Deserialize)]
pub struct PeerScene {
    /// Its name.
    pub name: String,
    /// `dvr`, `mip` or `shaded`.
    pub mode: String,
    volume: PeerVolume,
    tf: TransferFunction,
    shading: Option<Shading>,
    background: [f32; 3],
    views: BTreeMap<String, PeerView>,
}

#[derive(Debug, Deserialize)]
struct PeerVolume {
    file: String,
    dims: [usize; 3],
    dtype: String,
    spacing: [f64; 3],
}

#[derive(Debug, Deserialize)]
struct TransferFunction {
    color: Vec<[f64; 4]>,
    opacity: Vec<[f64; 2]>,
    unit_distance: f64,
}

/// A head light.
#[derive(Debug, Deserialize)]
struct Shading {
    model: String,
    ambient: f64,
    diffuse: f64,
    specular: f64,
    power: f64,
}

#[derive(Debug, Deserialize)]
struct PeerView {
    #[serde(rename = "type")]
    kind: String,
    eye: [f64; 3],
    center: [f64; 3],
    up: [f64; 3],
    height: Option<f64>,
    fovy: Option<f64>,
}

impl PeerScene {
    /// Reads a scene file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{}: is no peer scene", path.display()))
    }

    /// The shape, with the volume read from a folder of raw files.
    pub fn shape(&self, data: &Path) -> Result<Shape> {
        let v = &self.volume;
        let path = data.join(&v.file);
        let bytes = fs::read(&path).with_context(|| format!("{}: cannot be read", path.display()))?;
        let scalar = ScalarType::from_name(&v.dtype).with_context(|| format!("dtype {:?} is unknown", v.dtype))?;
        let spacing = DVec3::from_array(v.spacing);
        let desc = VolumeDesc { name: self.name.clone(), spacing, ..VolumeDesc::new(v.dims, scalar, 1) };
        let volume = Volume::new(desc, bytes)?;
        let shader = match self.mode.as_str() {
            "dvr" => "lut",
            "mip" => "mip",
            "shaded" => "gradient",
            other => bail!("mode is {other:?}, wanted dvr, mip or shaded"),
        };
        let mut appearance = Appearance::new(shader)
            .with("lookup_table", table(&self.tf.color, &self.tf.opacity)?)
            .with("unit_distance", self.tf.unit_distance);
        if let Some(light) = self.shading.as_ref().filter(|_| shader == "gradient") {
            let numbers = [("ambient", light.ambient), ("diffuse", light.diffuse), ("specular", light.specular)];
            appearance = numbers.into_iter().fold(appearance, |a, (name, value)| a.with(name, value));
            appearance = appearance.with("shininess", light.power).with("model", light.model.as_str());
        }
        Ok(Shape::around(&volume, appearance))
    }

    /// The frame of a view.
    pub fn frame(&self, view: &str, size: usize) -> Result<FrameDesc> {
        let v = self.views.get(view).with_context(|| format!("no view is called {view:?}"))?;
        let [eye, center, up] = [v.eye, v.center, v.up].map(DVec3::from_array);
        let camera = match v.kind.as_str() {
            "ortho" => Camera::orthographic(eye, center, up, v.height.context("an ortho view needs a height")?),
            "persp" => Camera::perspective(eye, center, up, v.fovy.context("a persp view needs fovy")?),
            other => bail!("view type is {other:?}, wanted ortho or persp"),
        };
        let [r, g, b] = self.background;
        Ok(FrameDesc::new(camera, size, size).with_background([r, g, b, 1.0]))
    }
}

/// A table of control points for colour (value, red, green, blue) and others for opacity (value,
/// opacity): it takes the positions of both.
pub fn table(colors: &[[f64; 4]], opacities: &[[f64; 2]]) -> Result<LookupTable> {
    let mut values: Vec<f64> = colors.iter().map(|c| c[0]).chain(opacities.iter().map(|o| o[0])).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let color: [Vec<[f64; 2]>; 3] = std::array::from_fn(|c| colors.iter().map(|r| [r[0], r[c + 1]]).collect());
    let point = |&value: &f64| ControlPoint {
        value,
        color: [0, 1, 2].map(|c| interpolate(&color[c], value)),
        opacity: interpolate(opacities, value),
    };
    Ok(LookupTable::from_points(values.iter().map(point).collect::<Vec<_>>())?)
}

/// Linear between points (position, value), constant outside.
pub fn interpolate(points: &[[f64; 2]], x: f64) -> f64 {
    let after = points.partition_point(|p| p[0] <= x);
    match (after.checked_sub(1).map(|i| points[i]), points.get(after)) {
        (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]),
        (Some(a), None) => a[1],
        (None, Some(b)) => b[1],
        (None, None) => 0.0,
    }
}
