//! Makes the geometry of a shape.

use std::sync::Arc;

use super::{
    GeometrySpec, MeshSpec, PointsSpec, ShapeSpec,
    build::{Build, chain},
    values,
};
use crate::{
    Attribute, Block, Buffer, CellType, CellTypes, Cylinder, Geometry, Mesh, Points, ScalarType, Sliced, Sphere,
    StructuredMesh, Surface, VolumeTexture, geometry::GeometryError,
};

type Made = Result<Arc<dyn Geometry>, GeometryError>;

impl Build<'_> {
    /// A shape's geometry with its slice planes; `None` after a problem.
    pub(super) fn geometry(
        &mut self,
        path: &str,
        shape: &ShapeSpec,
        volume: Option<&VolumeTexture>,
    ) -> Option<Arc<dyn Geometry>> {
        let at = format!("{path}.geometry");
        let geometry = self.plain_geometry(&at, shape, volume)?;
        let Some(slices) = &shape.slices else { return Some(geometry) };
        match Sliced::new(geometry, slices.clone()) {
            Ok(sliced) => Some(Arc::new(sliced)),
            Err(error) => self.refuse(&format!("{path}.slices"), chain(&error), "planes through a volume or mesh"),
        }
    }

    fn plain_geometry(
        &mut self,
        path: &str,
        shape: &ShapeSpec,
        volume: Option<&VolumeTexture>,
    ) -> Option<Arc<dyn Geometry>> {
        let made: Made = match &shape.geometry {
            GeometrySpec::Around => match volume {
                Some(volume) => return Some(Arc::new(Block::from(volume.geometry_roi()))),
                None => return self.mesh(path, shape.attribute_data()?).map(|mesh| mesh.geometry),
            },
            GeometrySpec::Data { data, texture_coordinates } => {
                return self.data_geometry(path, data, texture_coordinates.as_deref());
            }
            GeometrySpec::Block { offset, dimensions } => Block::new(*offset, *dimensions).map(shared),
            GeometrySpec::Named { name, parameters } => {
                let declarations = self.registry.declarations();
                let declaration = declarations.into_iter().find(|d| d.name == *name).cloned();
                let declared = |name: &str| declaration.as_ref()?.parameter(name).cloned();
                let parameters = self.parameters(&format!("{path}.parameters"), parameters, declared);
                self.registry.geometry(name, &parameters)
            }
            GeometrySpec::Mesh(spec) => self.mesh_geometry(path, spec)?,
            GeometrySpec::StructuredMesh { dims, points, texture_coordinates } => {
                let points = self.points(path, "points", points)?;
                let coordinates = self.coordinates(path, texture_coordinates.as_ref())?;
                StructuredMesh::new(*dims, points).and_then(|mesh| match coordinates {
                    Some(coordinates) => mesh.with_texture_coordinates(coordinates).map(shared),
                    None => Ok(shared(mesh)),
                })
            }
            GeometrySpec::Surface { points, triangles } => {
                let points = self.points(path, "points", points)?;
                Surface::new(points, Buffer::from_vec(triangles.concat())).map(shared)
            }
            GeometrySpec::Sphere { center, radius, segments } => Sphere::new(*center, *radius, *segments).map(shared),
            GeometrySpec::Cylinder { ends, radius, segments } => Cylinder::new(*ends, *radius, *segments).map(shared),
        };
        self.checked(path, made)
    }

    fn checked(&mut self, path: &str, made: Made) -> Option<Arc<dyn Geometry>> {
        match made {
            Ok(geometry) => Some(geometry),
            Err(error) => self.refuse(path, chain(&error), "a geometry"),
        }
    }

    /// A file's mesh or surface, with an attribute of its own as texture coordinates.
    fn data_geometry(&mut self, path: &str, name: &str, coordinates: Option<&str>) -> Option<Arc<dyn Geometry>> {
        let data = self.mesh(path, name)?;
        let Some(coordinates) = coordinates else { return Some(data.geometry) };
        let at = format!("{path}.texture_coordinates");
        let attribute = self.named_attribute(&at, &data, coordinates)?;
        if attribute.components != 3 {
            let wanted = "an attribute of 3 components";
            return self.refuse(&at, format!("{coordinates:?} of {} components", attribute.components), wanted);
        }
        let points = match to_points(&attribute) {
            Ok(points) => points,
            Err(error) => return self.refuse(&at, chain(&error), "texture coordinates"),
        };
        let geometry = data.geometry.as_any();
        let made: Made = if let Some(mesh) = geometry.downcast_ref::<Mesh>() {
            mesh.clone().with_texture_coordinates(points).map(shared)
        } else if let Some(mesh) = geometry.downcast_ref::<StructuredMesh>() {
            mesh.clone().with_texture_coordinates(points).map(shared)
        } else {
            return self.refuse(&at, "texture coordinates for a surface", "none: a surface shows no volume");
        };
        self.checked(&at, made)
    }

    fn mesh_geometry(&mut self, path: &str, spec: &MeshSpec) -> Option<Made> {
        let points = self.points(path, "points", &spec.points)?;
        let coordinates = self.coordinates(path, spec.texture_coordinates.as_ref())?;
        let parts = [
            (CellType::Tetrahedron, spec.tetrahedra.len(), spec.tetrahedra.as_flattened()),
            (CellType::Hexahedron, spec.hexahedra.len(), spec.hexahedra.as_flattened()),
            (CellType::Wedge, spec.wedges.len(), spec.wedges.as_flattened()),
            (CellType::Pyramid, spec.pyramids.len(), spec.pyramids.as_flattened()),
        ];
        let codes: Vec<u8> = parts.iter().flat_map(|(t, n, _)| std::iter::repeat_n(*t as u8, *n)).collect();
        let indices: Vec<u32> = parts.iter().flat_map(|(_, _, indices)| *indices).copied().collect();
        let made = Mesh::new(points, CellTypes::Each(codes.into()), indices.into());
        Some(made.and_then(|mesh| match coordinates {
            Some(coordinates) => mesh.with_texture_coordinates(coordinates).map(shared),
            None => Ok(shared(mesh)),
        }))
    }

    /// `Some(None)` where there are none.
    fn coordinates(&mut self, path: &str, spec: Option<&PointsSpec>) -> Option<Option<Points>> {
        spec.map_or(Some(None), |spec| self.points(path, "texture_coordinates", spec).map(Some))
    }

    fn points(&mut self, path: &str, field: &str, spec: &PointsSpec) -> Option<Points> {
        let file = match spec {
            PointsSpec::Inline(points) => return Some(points.clone().into()),
            PointsSpec::File(file) => file,
        };
        let at = format!("{path}.{field}");
        match self.folders.path(file).and_then(|file| values::read(&file, 12)) {
            Ok(bytes) => match Points::new(ScalarType::F32, values::numbers(&bytes).into()) {
                Ok(points) => Some(points),
                Err(error) => self.refuse(&at, chain(&error), "points"),
            },
            Err((found, wanted)) => self.refuse(&at, found, wanted),
        }
    }
}

fn shared<G: Geometry>(geometry: G) -> Arc<dyn Geometry> {
    Arc::new(geometry)
}

/// Three numbers a vertex as points: shared where they are floats, else converted.
fn to_points(attribute: &Attribute) -> Result<Points, GeometryError> {
    if matches!(attribute.scalar, ScalarType::F32 | ScalarType::F64)
        && let Ok(points) = Points::new(attribute.scalar, attribute.data.clone())
    {
        return Ok(points);
    }
    let numbers = (0..3 * attribute.len()).map(|i| attribute.value(i / 3, i % 3));
    Points::new(ScalarType::F64, numbers.collect::<Vec<f64>>().into())
}

impl ShapeSpec {
    /// The data of the first attribute among the parameters, `scalars` before others.
    pub(super) fn attribute_data(&self) -> Option<&str> {
        use super::ParameterSpec::DataAttribute;
        let named = self.parameters.get("scalars").filter(|value| matches!(value, DataAttribute(_)));
        let first = named.or_else(|| self.parameters.values().find(|value| matches!(value, DataAttribute(_))));
        first.and_then(|value| value.data())
    }
}
