//! Shapes: what to draw. A geometry, an appearance and an affine transform.
//!
//! A [`Shape`] is a handle, shared by reference and cheap to clone. Its parts may change between
//! frames; each carries a version, so that an action redoes only what depends on what changed.

use std::sync::{Arc, RwLock};

use glam::{DAffine3, DMat3, DVec3};

use crate::{
    Aabb, Block, Clip, Geometry, ParameterValue, Volume, VolumeTexture, Warning, WarningCode, parameter::ParameterMap,
    volume::next_version,
};

/// How a shape looks: a shader's name and its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Appearance {
    /// The shader's registered name.
    pub shader: String,
    /// The parameters by name.
    pub parameters: ParameterMap,
}

impl Appearance {
    /// An appearance without parameters.
    pub fn new(shader: impl Into<String>) -> Self {
        Self { shader: shader.into(), parameters: ParameterMap::new() }
    }

    /// Sets a parameter; setting one again replaces it.
    pub fn with(mut self, name: impl Into<String>, value: impl Into<ParameterValue>) -> Self {
        self.parameters.insert(name.into(), value.into());
        self
    }
}

/// The state of a shape at one moment. Cheap to clone: bulk data is shared.
#[derive(Clone, Debug)]
pub struct ShapeState {
    /// Where to draw, in object space.
    pub geometry: Arc<dyn Geometry>,
    /// Changes with the geometry.
    pub geometry_version: u64,
    /// The shader's name.
    pub shader: String,
    /// The shader's parameters.
    pub parameters: ParameterMap,
    /// Object space to world space.
    pub transform: DAffine3,
    /// What cuts it, in object space.
    pub clip: Clip,
}

impl ShapeState {
    /// The world box of the geometry's bounds.
    pub fn world_bounds(&self) -> Aabb {
        let corners = self.geometry.bounds().corners().map(|c| self.transform.transform_point3(c));
        let empty = Aabb::EMPTY;
        corners.iter().fold(empty, |b, &c| Aabb { min: b.min.min(c), max: b.max.max(c) })
    }

    /// The first volume among the parameters, `volume` before others.
    pub fn volume(&self) -> Option<&VolumeTexture> {
        let as_volume = |value: &'_ ParameterValue| matches!(value, ParameterValue::Volume(_));
        let named = self.parameters.get("volume").filter(|v| as_volume(v));
        match named.or_else(|| self.parameters.values().find(|v| as_volume(v))) {
            Some(ParameterValue::Volume(texture)) => Some(texture),
            _ => None,
        }
    }
}

/// Something to draw.
#[derive(Clone, Debug)]
pub struct Shape(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    id: u64,
    name: String,
    notes: Vec<Warning>,
    state: RwLock<ShapeState>,
}

impl Shape {
    /// A shape of a geometry and an appearance, at the world's origin.
    ///
    /// Without a `unit_distance`, the appearance gets the smallest voxel spacing of its volume in
    /// world units, or a hundredth of the diagonal of the geometry's bounds where it has none;
    /// [`notes`](Self::notes) then says so, but for the shader `surface`, which has no use for one.
    pub fn new(geometry: impl Geometry, appearance: Appearance) -> Self {
        Self::build("shape", Arc::new(geometry), appearance, DAffine3::IDENTITY)
    }

    /// The whole of a volume, in its own extent and place, as the parameter `volume`.
    ///
    /// ```
    /// use volact_core::{Appearance, LookupTable, ScalarType, Shape, Volume, VolumeDesc};
    ///
    /// let volume = Volume::new(VolumeDesc::new([2, 2, 2], ScalarType::U8, 1), vec![0u8; 8])?;
    /// let table = LookupTable::window_level(200.0, 100.0, 0.5)?;
    /// let shape = Shape::around(&volume, Appearance::new("lut").with("lookup_table", table));
    /// assert_eq!(shape.state().geometry.bounds().size(), volact_core::glam::DVec3::ONE);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn around(volume: &Volume, appearance: Appearance) -> Self {
        Self::around_texture(&VolumeTexture::new(volume), appearance)
    }

    /// As [`around`](Self::around), for a texture with regions, range or filter of its own: the
    /// block is the texture's geometry ROI.
    pub fn around_texture(texture: &VolumeTexture, appearance: Appearance) -> Self {
        let block = Block::from(texture.geometry_roi());
        let transform = texture.volume().desc().placement;
        let appearance = appearance.with("volume", texture.clone());
        Self::build(texture.volume().name(), Arc::new(block), appearance, transform)
    }

    /// A shape from all its parts.
    pub fn build(
        name: impl Into<String>,
        geometry: Arc<dyn Geometry>,
        appearance: Appearance,
        transform: DAffine3,
    ) -> Self {
        let name = name.into();
        let Appearance { shader, parameters } = appearance;
        let geometry_version = next_version();
        let mut state = ShapeState { geometry, geometry_version, shader, parameters, transform, clip: Clip::NONE };
        let mut notes = Vec::new();
        if !state.parameters.contains_key("unit_distance") {
            let unit = default_unit_distance(&state);
            // The shader of surfaces has no use for one, but may be switched for another.
            if state.shader != "surface" {
                let message = format!("no unit_distance given, {unit:?} world units taken");
                notes.push(Warning::note(WarningCode::UnitDistanceDefaulted, &name, message));
            }
            state.parameters.insert("unit_distance".into(), unit.into());
        }
        notes.iter().for_each(Warning::emit);
        Self(Arc::new(Inner { id: next_version(), name, notes, state: RwLock::new(state) }))
    }

    /// The same shape under another name, as a shape of its own.
    pub fn named(&self, name: impl Into<String>) -> Self {
        let (notes, state) = (self.0.notes.clone(), RwLock::new(self.state()));
        Self(Arc::new(Inner { id: next_version(), name: name.into(), notes, state }))
    }

    /// What identifies the shape.
    pub fn id(&self) -> u64 {
        self.0.id
    }

    /// The name used in messages.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Choices that were made when the shape was built.
    pub fn notes(&self) -> &[Warning] {
        &self.0.notes
    }

    /// The shape as it is now.
    pub fn state(&self) -> ShapeState {
        self.0.state.read().unwrap_or_else(|e| e.into_inner()).clone()
    }

    /// Replaces the geometry.
    pub fn set_geometry(&self, geometry: impl Geometry) {
        let mut state = self.write();
        state.geometry = Arc::new(geometry);
        state.geometry_version = next_version();
    }

    /// Replaces the transform from object to world space.
    pub fn set_transform(&self, transform: DAffine3) {
        self.write().transform = transform;
    }

    /// Replaces what cuts the shape, in object space.
    pub fn set_clip(&self, clip: Clip) {
        self.write().clip = clip;
    }

    /// Switches the shader and keeps the parameters.
    pub fn set_shader(&self, shader: impl Into<String>) {
        self.write().shader = shader.into();
    }

    /// Sets a parameter; setting it again replaces it.
    pub fn set_parameter(&self, name: impl Into<String>, value: impl Into<ParameterValue>) {
        self.write().parameters.insert(name.into(), value.into());
    }

    /// Removes a parameter; `false` if there was none.
    pub fn remove_parameter(&self, name: &str) -> bool {
        self.write().parameters.remove(name).is_some()
    }

    fn write(&self) -> std::sync::RwLockWriteGuard<'_, ShapeState> {
        self.0.state.write().unwrap_or_else(|e| e.into_inner())
    }
}

/// Smallest distance between neighbouring samples of a texture in world units.
pub fn smallest_voxel(texture: &VolumeTexture, transform: &DAffine3) -> f64 {
    let size = texture.voxel_size();
    let axes = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let several: Vec<_> = (0..3).filter(|&a| texture.data_roi().dims()[a] > 1).collect();
    let lengths = axes.map(|axis| transform.transform_vector3(axis).length());
    let chosen = if several.is_empty() { vec![0, 1, 2] } else { several };
    chosen.into_iter().map(|a| lengths[a]).fold(f64::INFINITY, f64::min)
}

/// Smallest distance between neighbouring layers of samples of a texture in world units: that of its
/// samples, but where a transform shears them nearer.
pub fn thinnest_layer(texture: &VolumeTexture, transform: &DAffine3) -> f64 {
    let layers = (transform.matrix3 * DMat3::from_diagonal(texture.voxel_size())).inverse();
    let dims = texture.data_roi().dims();
    let distances = (0..3).filter(|&a| dims[a] > 1).map(|a| layers.row(a).length().recip());
    distances.fold(smallest_voxel(texture, transform), f64::min)
}

fn default_unit_distance(state: &ShapeState) -> f64 {
    match state.volume() {
        Some(texture) => smallest_voxel(texture, &state.transform),
        None => state.world_bounds().size().length() / 100.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ScalarType, VolumeDesc};

    #[test]
    fn layers_are_as_far_apart_as_voxels_but_where_they_are_sheared() {
        let desc = VolumeDesc { spacing: DVec3::new(1.0, 2.0, 4.0), ..VolumeDesc::new([3, 3, 3], ScalarType::U8, 1) };
        let texture = VolumeTexture::new(&Volume::new(desc, vec![0u8; 27]).unwrap());
        let plain = DAffine3::from_axis_angle(DVec3::ONE.normalize(), 0.7) * DAffine3::from_scale(DVec3::splat(3.0));
        assert!((thinnest_layer(&texture, &plain) - 3.0).abs() < 1e-12);
        // y leans 10 along x over each unit: layers of x are 1/√(1 + 10²) apart.
        let leaning = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::new(10.0, 1.0, 0.0), DVec3::Z));
        assert!((thinnest_layer(&texture, &leaning) - 1.0 / 101f64.sqrt()).abs() < 1e-12);
        assert_eq!(smallest_voxel(&texture, &leaning), 1.0);
    }
}
