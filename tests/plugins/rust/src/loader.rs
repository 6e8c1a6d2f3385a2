//! A loader of volumes and one of meshes; the files say what goes wrong.

use std::{fs, path::Path, sync::Arc};

use volact_plugin::{
    Attribute, Buffer, Bulk, CellType, CellTypes, Declaration, LoadError, LoadOptions, Loader, Mesh, MeshData, Points,
    Progress, Region, Registry, ScalarType, VolumeDesc, VolumeReader, Warning, WarningCode,
    glam::DVec3,
    loader::{Confidence, Content, Probe},
    parameter::Kind,
    registry::RegisterError,
};

use crate::panic_at;

/// The word after the first one of a file.
fn mode_of(path: &Path) -> Result<String, LoadError> {
    let text = fs::read_to_string(path).map_err(|e| LoadError::io(path, e))?;
    Ok(text.split_whitespace().nth(1).unwrap_or_default().to_owned())
}

struct Grid(Declaration);

struct Reader {
    desc: VolumeDesc,
    mode: String,
    warnings: Vec<Warning>,
}

/// Voxels that can panic when nobody uses them any more.
struct Voxels(Buffer, String);

impl Bulk for Voxels {
    fn bytes(&self) -> &[u8] {
        self.0.bytes()
    }
}

impl Drop for Voxels {
    fn drop(&mut self) {
        panic_at(&self.1, "release");
    }
}

impl VolumeReader for Reader {
    fn desc(&self) -> &VolumeDesc {
        &self.desc
    }

    fn warnings(&self) -> &[Warning] {
        panic_at(&self.mode, "warnings");
        &self.warnings
    }

    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        panic_at(&self.mode, "read");
        if !progress.advance(1, 2) {
            return Err(LoadError::Stopped { path: self.desc.name.clone().into() });
        }
        let mut values = Vec::new();
        for z in region.min[2]..=region.max[2] {
            for y in region.min[1]..=region.max[1] {
                values.extend((region.min[0]..=region.max[0]).map(|x| (x + 10 * y + 100 * z) as u16));
            }
        }
        Ok(Buffer::new(Voxels(values.into(), self.mode.clone())))
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        panic_at(&self.mode, "close");
    }
}

impl Loader for Grid {
    fn declaration(&self) -> &Declaration {
        &self.0
    }

    fn probe(&self, probe: &Probe<'_>) -> Confidence {
        let text = String::from_utf8_lossy(probe.head);
        panic_at(text.split_whitespace().nth(1).unwrap_or_default(), "probe");
        if probe.head.starts_with(b"GRID") { Confidence::Content } else { Confidence::No }
    }

    fn open(&self, path: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
        let mode = mode_of(path)?;
        panic_at(&mode, "open");
        if mode == "invalid" {
            return Err(LoadError::invalid(path, "mode", "invalid", "another"));
        }
        let mut desc = VolumeDesc::new([4, 3, 2], ScalarType::U16, 1);
        desc.spacing = DVec3::new(1.0, 2.0, 3.0);
        desc.unit = "steps".into();
        let warnings = vec![Warning::new(WarningCode::FileContent, "grid", "is made up")];
        Ok(Box::new(Reader { desc, mode, warnings }))
    }
}

struct Wedge(Declaration);

impl Loader for Wedge {
    fn declaration(&self) -> &Declaration {
        &self.0
    }

    fn probe(&self, probe: &Probe<'_>) -> Confidence {
        if probe.head.starts_with(b"WEDGE") { Confidence::Content } else { Confidence::No }
    }

    fn content(&self) -> Content {
        Content::Mesh
    }

    fn open(&self, path: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
        Err(LoadError::Unsupported { path: path.into(), what: "a volume".into(), cure: "it reads meshes".into() })
    }

    fn read_mesh(&self, path: &Path, _: &LoadOptions, _: &dyn Progress) -> Result<MeshData, LoadError> {
        let mode = mode_of(path)?;
        panic_at(&mode, "read_mesh");
        let points = Points::from(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        let mesh = Mesh::new(points, CellTypes::All(CellType::Tetrahedron), Buffer::from_vec(vec![0u32, 1, 2, 3]));
        let heat = Attribute::new("heat", ScalarType::F32, 1, Buffer::from_vec(vec![1f32, 2.0, 3.0, 4.0]));
        Ok(MeshData {
            name: "wedge".into(),
            geometry: Arc::new(mesh.map_err(|e| LoadError::geometry(path, e))?),
            attributes: heat.into_iter().collect(),
            warnings: vec![Warning::note(WarningCode::FileContent, "wedge", "is made up")],
        })
    }
}

pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    let version = env!("CARGO_PKG_VERSION");
    registry.add_loader(Arc::new(Grid(Declaration::new(Kind::Loader, "grid", version, "numbers by rule"))))?;
    registry.add_loader(Arc::new(Wedge(Declaration::new(Kind::Loader, "wedge", version, "one tetrahedron"))))
}
