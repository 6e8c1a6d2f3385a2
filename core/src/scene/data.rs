//! Loads the data of a scene, each file once, and gives it out as what a shape asks for.

use std::path::PathBuf;

use super::{
    DataAttributeSpec, DataSpec, GeometrySpec, KeptData, ParameterSpec, ShapeSpec, VolumeSpec,
    build::{Build, chain, compose},
};
use crate::{Attribute, Buffer, Data, MeshData, Progress, Volume, VolumeTexture};

/// What a mesh cannot have changed about it.
const OF_VOLUMES: [&str; 5] = ["spacing", "placement", "slope", "intercept", "unit"];

impl<'a> Build<'a> {
    /// Reads every file that a shape uses, once.
    pub(super) fn load(&mut self, progress: &dyn Progress, kept: &mut KeptData) {
        let scene = self.scene;
        let used = |name: &str| scene.shapes.iter().any(|shape| shape.uses(name));
        for (name, spec) in scene.data.iter().filter(|(name, _)| used(name)) {
            let Some((path, data)) = self.read(name, spec, progress, kept) else { continue };
            let adjusted = kept.adjusted(&path, spec).or_else(|| self.adjust(name, spec, data));
            if let Some(data) = adjusted {
                kept.set_adjusted(&path, spec, &data);
                self.data.insert(name, data);
            }
        }
    }

    fn read(
        &mut self,
        name: &str,
        spec: &DataSpec,
        progress: &dyn Progress,
        kept: &mut KeptData,
    ) -> Option<(PathBuf, Data)> {
        let at = format!("data.{name}.file");
        let path = match self.folders.path(&spec.file) {
            Ok(path) => path,
            Err((found, wanted)) => return self.refuse(&at, found, wanted),
        };
        match kept.load(self.registry, &path, spec, progress) {
            Ok(data) => Some((path, data)),
            Err(error) => self.refuse(&at, chain(&error), "a volume, mesh or surface"),
        }
    }

    /// The data with what the description changes about it; the numbers are shared.
    fn adjust(&mut self, name: &str, spec: &DataSpec, data: Data) -> Option<Data> {
        let volume = match data {
            Data::Volume(volume) => volume,
            Data::Mesh(mesh) => {
                let changed = OF_VOLUMES.iter().zip(spec.changes()).find(|(_, changed)| *changed);
                let Some((field, _)) = changed else { return Some(Data::Mesh(mesh)) };
                let wanted = "none: the file holds a mesh, and a shape's `transform` moves it";
                return self.refuse(&format!("data.{name}.{field}"), format!("a {field}"), wanted);
            }
        };
        let mut desc = volume.desc().clone();
        desc.spacing = spec.spacing.unwrap_or(desc.spacing);
        desc.placement = spec.placement.as_deref().map_or(desc.placement, |steps| compose(steps, desc.placement));
        desc.slope = spec.slope.unwrap_or(desc.slope);
        desc.intercept = spec.intercept.unwrap_or(desc.intercept);
        desc.unit = spec.unit.clone().unwrap_or(desc.unit);
        if desc == *volume.desc() {
            return Some(Data::Volume(volume));
        }
        match Volume::new(desc, volume.data().clone()) {
            Ok(volume) => Some(Data::Volume(volume)),
            Err(error) => self.refuse(&format!("data.{name}"), chain(&error), "changes that make a volume"),
        }
    }

    /// The volume of that name. Data that could not be read are a problem already.
    fn volume(&mut self, path: &str, name: &str) -> Option<Volume> {
        match self.data.get(name)? {
            Data::Volume(volume) => Some(volume.clone()),
            Data::Mesh(mesh) => {
                let what = if mesh.geometry.as_surface().is_some() { "surface" } else { "mesh" };
                let wanted = format!("data that is a volume; a {what} is used by `Mesh(data: {name:?})`");
                self.refuse(&format!("{path}.data"), format!("{name:?}, which is a {what}"), wanted)
            }
        }
    }

    /// The mesh of that name.
    pub(super) fn mesh(&mut self, path: &str, name: &str) -> Option<MeshData> {
        match self.data.get(name)? {
            Data::Mesh(mesh) => Some(mesh.clone()),
            Data::Volume(_) => {
                let wanted = format!("data that is a mesh; a volume is used by `Volume(data: {name:?})`");
                self.refuse(&format!("{path}.data"), format!("{name:?}, which is a volume"), wanted)
            }
        }
    }

    pub(super) fn texture(&mut self, path: &str, spec: &VolumeSpec) -> Option<VolumeTexture> {
        let volume = self.volume(path, &spec.data)?;
        let mut texture = VolumeTexture::new(&volume).with_filter(spec.filter);
        if spec.luminance {
            texture = texture.as_luminance();
        }
        if let Some(roi) = spec.data_roi {
            let Ok(cut) = texture.with_data_roi(roi) else {
                let wanted = format!("a part of {:?} samples", volume.dims());
                return self.refuse(&format!("{path}.data_roi"), format!("{:?} to {:?}", roi.min, roi.max), wanted);
            };
            texture = cut;
        }
        let ranged = spec.range.map_or(Ok(texture.clone()), |range| texture.with_range(range));
        match ranged.and_then(|t| spec.geometry_roi.map_or(Ok(t.clone()), |roi| t.with_geometry_roi(roi))) {
            Ok(texture) => Some(texture),
            Err(error) => self.refuse(path, chain(&error), "a volume texture"),
        }
    }

    /// The numbers of a mesh's vertices.
    pub(super) fn attribute(&mut self, path: &str, spec: &DataAttributeSpec) -> Option<Attribute> {
        let mesh = self.mesh(path, &spec.data)?;
        let attribute = self.named_attribute(&format!("{path}.name"), &mesh, &spec.name)?;
        let Some(component) = spec.component else { return Some(attribute) };
        if component >= attribute.components {
            let wanted = format!("less than {}, the components of {:?}", attribute.components, spec.name);
            return self.refuse(&format!("{path}.component"), component.to_string(), wanted);
        }
        Some(one_component(&attribute, component))
    }

    /// The attribute of that name, or a problem with all names that there are.
    pub(super) fn named_attribute(&mut self, path: &str, mesh: &MeshData, name: &str) -> Option<Attribute> {
        if let Some(attribute) = mesh.attribute(name) {
            return Some(attribute.clone());
        }
        let known: Vec<_> = mesh.attributes.iter().map(|a| a.name.as_str()).collect();
        let wanted = match known.is_empty() {
            true => "an attribute of the file's vertices, which have none".to_owned(),
            false => format!("an attribute of the file's vertices: {}", known.join(", ")),
        };
        self.problems.push(self.scene.problem(path, format!("{name:?}"), wanted).near(name, known));
        None
    }
}

/// One component as an attribute of its own; nothing is copied where there is but one.
fn one_component(attribute: &Attribute, component: usize) -> Attribute {
    if attribute.components == 1 {
        return attribute.clone();
    }
    let size = attribute.scalar.size();
    let vertices = attribute.data.bytes().chunks_exact(size * attribute.components);
    let bytes: Vec<u8> = vertices.flat_map(|v| &v[component * size..(component + 1) * size]).copied().collect();
    Attribute { components: 1, data: Buffer::from_vec(bytes), ..attribute.clone() }
}

impl DataSpec {
    /// Which of [`OF_VOLUMES`] are given.
    fn changes(&self) -> [bool; 5] {
        [
            self.spacing.is_some(),
            self.placement.is_some(),
            self.slope.is_some(),
            self.intercept.is_some(),
            self.unit.is_some(),
        ]
    }
}

impl ShapeSpec {
    /// Whether a parameter of the shape or its geometry reads that data.
    fn uses(&self, name: &str) -> bool {
        let of_geometry = match &self.geometry {
            GeometrySpec::Named { parameters, .. } => Some(parameters),
            GeometrySpec::Data { data, .. } if data == name => return true,
            _ => None,
        };
        let values = self.parameters.values().chain(of_geometry.into_iter().flat_map(|p| p.values()));
        values.into_iter().any(|value| value.data() == Some(name))
    }
}

impl ParameterSpec {
    /// The name of the data that it reads.
    pub(super) fn data(&self) -> Option<&str> {
        match self {
            Self::Volume(volume) => Some(&volume.data),
            Self::DataAttribute(attribute) => Some(&attribute.data),
            Self::Value(_) | Self::Table(_) | Self::Attribute(_) => None,
        }
    }
}
