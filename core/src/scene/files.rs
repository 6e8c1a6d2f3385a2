//! The files that a scene names.

use std::path::{Path, PathBuf};

use super::{
    AttributeValues, Folders, GeometrySpec, OpaqueDepthSpec, ParameterSpec, PointsSpec, SceneFile, ShapeSpec,
    TableEntries,
};

/// The files that a scene names, each once, where they lie.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SceneFiles {
    /// Data: what loaders read. A loader may read others beside one that is named here.
    pub data: Vec<PathBuf>,
    /// Tables, numbers of vertices, points and opaque pictures.
    pub others: Vec<PathBuf>,
}

impl SceneFile {
    /// All files that are read when the scene is built. Those in a folder that nobody named are left
    /// out: building the scene says what is wrong with them.
    pub fn files<'a>(&self, folders: impl Into<Folders<'a>>) -> SceneFiles {
        let folders = folders.into();
        let places = |files: Vec<&Path>| {
            let mut places: Vec<_> = files.into_iter().filter_map(|file| folders.path(file).ok()).collect();
            places.sort();
            places.dedup();
            places
        };
        let mut others: Vec<&Path> = self.shapes.iter().flat_map(of_shape).collect();
        if let Some(opaque) = &self.opaque {
            let (OpaqueDepthSpec::Distance(depth) | OpaqueDepthSpec::Buffer { file: depth, .. }) = &opaque.depth;
            others.extend(opaque.color.as_deref());
            others.push(depth);
        }
        SceneFiles { data: places(self.data.values().map(|d| d.file.as_path()).collect()), others: places(others) }
    }
}

fn of_shape(shape: &ShapeSpec) -> Vec<&Path> {
    let mut files: Vec<_> = shape.parameters.values().filter_map(of_parameter).collect();
    match &shape.geometry {
        GeometrySpec::Named { parameters, .. } => files.extend(parameters.values().filter_map(of_parameter)),
        GeometrySpec::Mesh(mesh) => {
            files.extend([Some(&mesh.points), mesh.texture_coordinates.as_ref()].into_iter().flatten().filter_map(of));
        }
        GeometrySpec::StructuredMesh { points, texture_coordinates, .. } => {
            files.extend([Some(points), texture_coordinates.as_ref()].into_iter().flatten().filter_map(of));
        }
        GeometrySpec::Surface { points, .. } => files.extend(of(points)),
        _ => {}
    }
    files
}

fn of(points: &PointsSpec) -> Option<&Path> {
    match points {
        PointsSpec::File(file) => Some(file),
        PointsSpec::Inline(_) => None,
    }
}

fn of_parameter(value: &ParameterSpec) -> Option<&Path> {
    match value {
        ParameterSpec::Table(table) => match &table.entries {
            TableEntries::File { file, .. } => Some(file),
            _ => None,
        },
        ParameterSpec::Attribute(attribute) => match &attribute.values {
            AttributeValues::File(file) => Some(file),
            AttributeValues::Inline(_) => None,
        },
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_file_is_found_where_it_lies() {
        let text = r#"(version: 1, data: {"a": (file: "a.nrrd"), "b": (file: "$VOLACT_DATA/b.vtu"), "c": (file: "a.nrrd")},
            shapes: [
                (shader: "lut", parameters: {"volume": Volume(data: "a"), "lookup_table": Entries(file: "t.f32")}),
                (shader: "surface", geometry: Mesh(points: File("p.f32"), triangles: [[0, 1, 2]]), parameters: {
                    "scalars": Attribute(name: "t", components: 1, scalar: f32, file: "n.f32")}),
            ],
            opaque: (color: "c.f32", depth: "d.f32"))"#;
        let file = SceneFile::parse(text).unwrap();
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let with = file.files(Folders { base: Path::new("x"), data: Some(Path::new("y")) });
        assert_eq!(with.data, paths(&["x/a.nrrd", "y/b.vtu"]));
        assert_eq!(with.others, paths(&["x/c.f32", "x/d.f32", "x/n.f32", "x/p.f32", "x/t.f32"]));
        assert_eq!(file.files(Path::new("x")).data, paths(&["x/a.nrrd"]), "nobody named the folder");
    }
}
