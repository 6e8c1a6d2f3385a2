//! True pictures, kept on disk under a hash of all that they depend on.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};
use volact_core::{FrameDesc, Geometry, ParameterValue, Registry, Shape, VolumeTexture, resolve::ResolvedShape};
use volact_cpu::reference::{ReferenceOptions, integrate};

use super::TruthNote;
use crate::{metrics::Picture, report, truth::chain};

/// The first line of a file.
const MAGIC: &[u8] = b"volact truth 1\n";

/// A true picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// What it depends on, as a hash.
    pub key: String,
    /// Its pixels, premultiplied.
    pub color: Picture,
    /// What is known of it.
    pub note: TruthNote,
    /// Whether it lay on disk.
    pub kept: bool,
}

/// The true picture of shapes, from `folder` if it lies there; else it is made, and laid there.
///
/// # Errors
/// If the reference does not draw it, in words.
pub fn truth(registry: &Registry, shapes: &[Shape], desc: &FrameDesc, folder: Option<&Path>) -> Result<Truth, String> {
    let resolve = |shape: &Shape| ResolvedShape::new(shape, registry.shaders()).map_err(|e| chain(&e));
    let resolved = shapes.iter().map(resolve).collect::<Result<Vec<_>, _>>()?;
    let (key, whole) = key(&resolved, desc);
    // What the application brings is not in the hash.
    let path = folder.filter(|_| whole).map(|folder| file(folder, &key));
    let pixels = desc.width * desc.height;
    if let Some((color, note)) = path.as_deref().and_then(|path| read(path, pixels)) {
        return Ok(Truth { key, color, note, kept: true });
    }
    let made = integrate(&resolved, desc, &ReferenceOptions::default()).map_err(|e| chain(&e))?;
    let note = TruthNote { widest: finite(made.widest), not_certified: made.not_certified, estimated: made.estimated };
    if let Some(path) = path
        && let Err(error) = write(&path, &made.color, &note)
    {
        // It can be made again.
        log::warn!("the true picture is not kept: {}", chain(&error));
    }
    Ok(Truth { key, color: made.color, note, kept: false })
}

/// JSON has no infinity.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX }
}

fn file(folder: &Path, key: &str) -> PathBuf {
    folder.join(format!("{key}.truth"))
}

fn write(path: &Path, color: &Picture, note: &TruthNote) -> Result<(), report::ReportError> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(serde_json::json!(note).to_string().bytes());
    bytes.push(b'\n');
    bytes.extend(color.iter().flatten().flat_map(|v| v.to_le_bytes()));
    report::write(path, &bytes)
}

/// What lies in a file; nothing where it is not whole.
fn read(path: &Path, pixels: usize) -> Option<(Picture, TruthNote)> {
    let bytes = fs::read(path).ok()?;
    let rest = bytes.strip_prefix(MAGIC)?;
    let end = rest.iter().position(|b| *b == b'\n')?;
    let note = serde_json::from_slice(&rest[..end]).ok()?;
    let (numbers, odd) = rest[end + 1..].as_chunks::<8>();
    if numbers.len() != 4 * pixels || !odd.is_empty() {
        return None;
    }
    let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_le_bytes(*b)).collect();
    Some((numbers.as_chunks::<4>().0.to_vec(), note))
}

/// A hash of all that a picture depends on, and whether it is of all.
fn key(shapes: &[ResolvedShape], desc: &FrameDesc) -> (String, bool) {
    let mut hash = Sha256::new();
    hash.update(format!("volact {} {:?}", env!("CARGO_PKG_VERSION"), FrameDesc { opaque: None, ..desc.clone() }));
    for shape in shapes {
        let state = &shape.state;
        let source = shape.shader.source.as_ref().map_or("", |s| s.text.as_str());
        hash.update(format!("{:?} {:?} {} {source}", state.transform, state.clip, state.shader));
        geometry(&mut hash, &*state.geometry);
        for (name, value) in &shape.parameters {
            hash.update(format!("\n{name} "));
            parameter(&mut hash, value);
        }
    }
    let digest = hash.finalize();
    (digest.iter().map(|b| format!("{b:02x}")).collect(), desc.opaque.is_none())
}

fn geometry(hash: &mut Sha256, geometry: &dyn Geometry) {
    hash.update(format!("{} {:?} {:?}", geometry.name(), geometry.bounds(), geometry.slices()));
    if geometry.as_block().is_some() {
        return;
    }
    if let Some(surface) = geometry.as_surface() {
        surface.points().iter().for_each(|p| hash.update(format!("{p:?}")));
        surface.triangles().iter().for_each(|t| hash.update(format!("{t:?}")));
        return;
    }
    if let Ok(made) = geometry.tessellate() {
        made.vertices.iter().for_each(|p| hash.update(format!("{p:?}")));
        made.tetrahedra.iter().flatten().for_each(|i| hash.update(i.to_le_bytes()));
        made.texture_coordinates.iter().flat_map(|t| t.iter()).for_each(|p| hash.update(format!("{p:?}")));
    }
}

fn parameter(hash: &mut Sha256, value: &ParameterValue) {
    match value {
        ParameterValue::Volume(texture) => volume(hash, texture),
        ParameterValue::Table(table) => {
            // Over two ranges, lest entries over the range be taken for those over 0 to 1.
            let points = [[0.0, 1.0], [0.0, 2.0]].map(|range| table.points(range));
            hash.update(format!("{:?} {points:?}", table.interpolation()));
        }
        ParameterValue::Attribute(a) => {
            hash.update(format!("{} {:?} {}", a.name, a.scalar, a.components));
            hash.update(a.data.bytes());
        }
        other => hash.update(format!("{other:?}")),
    }
}

fn volume(hash: &mut Sha256, texture: &VolumeTexture) {
    let volume = texture.volume();
    // Its name and unit do not matter to its picture.
    let d = volume.desc();
    hash.update(format!("{:?} {:?} {} {} {}", d.dims, d.scalar, d.components, d.slope, d.intercept));
    hash.update(format!("{:?} {:?} {:?}", d.spacing, d.placement, texture.range()));
    hash.update(format!(
        "{:?} {:?} {:?} {:?}",
        texture.data_roi(),
        texture.geometry_roi(),
        texture.filter(),
        texture.meaning()
    ));
    hash.update(volume.data().bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        cases::stock::{around, usual, warm},
        rig::registry,
        scene::{greys, lut},
    };

    #[test]
    fn what_is_kept_is_what_was_made_and_only_for_the_same_scene() {
        let folder = std::env::temp_dir().join(format!("volact-truth-{}", std::process::id()));
        let registry = registry();
        let make = |table| {
            let scene = around([lut(&usual(), table, 1.0)]);
            truth(&registry, &scene.shapes, &scene.desc, Some(&folder)).unwrap()
        };
        let (first, again, other) = (make(warm()), make(warm()), make(greys(&[(0.0, 0.3, 0.1)])));
        assert!(!first.kept && again.kept && !other.kept, "shapes of equal content are one scene");
        assert_eq!((&first.color, &first.note), (&again.color, &again.note));
        assert_ne!(first.key, other.key);
        // A torn file is made again.
        let path = file(&folder, &first.key);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 5]).unwrap();
        assert!(!make(warm()).kept);
        fs::remove_dir_all(&folder).unwrap();
    }
}
