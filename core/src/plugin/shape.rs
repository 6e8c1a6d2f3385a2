//! Shapes and frames as they are asked for: the host shows them, an action sees them.

use std::sync::Arc;

use glam::{DAffine3, DMat4, DVec3};

use super::{
    abi::{self, ArrayView, CameraView, ClipRegionView, FrameView, RaysView, ShapeView},
    arena::{Arena, NO_VALUE, flag, list_of, string_of},
    array::{Passing, is_none, lend, receive},
    declare::compositing_code,
    geometry::{decode_geometry, lend_geometry, planes_of},
    status::{Code, Fault},
    value::{Identities, decode_map, lend_map},
};
use crate::{
    Appearance, Camera, Clip, ClipRegion, FrameDesc, Geometry, Opaque, OpaqueDepth, Plane, Projection, Viewport,
    camera::{DepthRange, LinearRays},
    resolve::ResolvedShape,
};

/// A resolved shape as a view that is valid as long as the arena.
pub(super) fn lend_shape(shape: &ResolvedShape, arena: &mut Arena) -> ShapeView {
    let state = &shape.state;
    let geometry = lend_geometry(&state.geometry, arena);
    let block = shape.block();
    let unused = state.parameters.iter().filter(|(name, _)| !shape.parameters.contains_key(*name));
    let unused = lend_map(unused, arena);
    let (clip, clip_count) = lend_clip(&state.clip, arena);
    ShapeView {
        size: size_of::<ShapeView>() as u32,
        compositing: compositing_code(shape.compositing()),
        id: shape.id,
        name: arena.text(&shape.name),
        geometry: arena.one(geometry),
        geometry_version: state.geometry_version,
        shader: arena.text(&state.shader),
        parameters: lend_map(&shape.parameters, arena),
        unused,
        transform: state.transform.to_cols_array(),
        to_object: shape.to_object.to_cols_array(),
        is_block: u32::from(block.is_some()),
        reserved: 0,
        block: block.map_or([0.0; 6], |b| [b.min.x, b.min.y, b.min.z, b.max.x, b.max.y, b.max.z]),
        clip,
        clip_count,
    }
}

fn lend_clip(clip: &Clip, arena: &mut Arena) -> (*const ClipRegionView, u64) {
    let mut regions = Vec::new();
    for region in clip.regions() {
        let numbers = |p: &Plane| [p.normal().x, p.normal().y, p.normal().z, p.offset()];
        let (planes, plane_count) = arena.list(region.bounding_planes().iter().map(numbers).collect::<Vec<_>>());
        let keep = u32::from(region.keeps_inside());
        regions.push(ClipRegionView { planes: planes.cast(), plane_count, keep, reserved: 0 });
    }
    arena.list(regions)
}

/// # Safety
/// What the views say is true.
unsafe fn decode_clip(clip: *const ClipRegionView, count: u64) -> Result<Clip, Fault> {
    let mut all = Clip::NONE;
    // SAFETY: as promised by the caller.
    for region in unsafe { list_of(clip, count, "clip regions") }? {
        // SAFETY: as promised by the caller.
        let planes = unsafe { planes_of(region.planes, region.plane_count) }?;
        all = all.with(ClipRegion::from_planes(planes, flag(region.keep, "whether a region is kept")?));
    }
    Ok(all)
}

/// A shape as an action in Rust sees it.
pub(super) struct SeenShape {
    pub id: u64,
    pub name: String,
    /// Nothing where the version is the one that was known.
    pub geometry: Option<Arc<dyn Geometry>>,
    pub geometry_version: u64,
    pub appearance: Appearance,
    pub transform: DAffine3,
    pub clip: Clip,
}

/// A shape that the host shows; its geometry where that is not of the version `have`.
///
/// # Safety
/// What the view says is true.
pub(super) unsafe fn decode_shape(
    view: &ShapeView,
    known: &mut Identities,
    have: Option<u64>,
) -> Result<SeenShape, Fault> {
    // SAFETY: as promised by the caller.
    let geometry = unsafe { view.geometry.as_ref() };
    let geometry = geometry.ok_or_else(|| Fault::bad("geometry", "a null pointer", "a table"))?;
    let changed = have != Some(view.geometry_version);
    // SAFETY: as promised by the caller.
    let geometry = changed.then(|| unsafe { decode_geometry(geometry, Passing::Lent, "host") }).transpose()?;
    // SAFETY: as promised by the caller.
    let mut appearance = Appearance::new(unsafe { string_of(view.shader, "shader") }?);
    // SAFETY: as promised by the caller.
    appearance.parameters = unsafe { decode_map(view.parameters, known) }?;
    // SAFETY: as promised by the caller.
    appearance.parameters.extend(unsafe { decode_map(view.unused, known) }?);
    Ok(SeenShape {
        id: view.id,
        // SAFETY: as promised by the caller.
        name: unsafe { string_of(view.name, "name of a shape") }?,
        geometry,
        geometry_version: view.geometry_version,
        appearance,
        transform: DAffine3::from_cols_array(&view.transform),
        // SAFETY: as promised by the caller.
        clip: unsafe { decode_clip(view.clip, view.clip_count) }?,
    })
}

/// A frame that is asked for as a view that is valid as long as the arena.
///
/// # Errors
/// If the camera cannot be used.
pub(super) fn lend_frame(desc: &FrameDesc, arena: &mut Arena) -> Result<FrameView, Fault> {
    let viewport = desc.viewport();
    let grid = desc.camera.rays(&viewport).map_err(|e| Fault::new(Code::BadValue, e.to_string()))?;
    let (clip, clip_count) = lend_clip(&desc.clip, arena);
    let [x, y, width, height] = [viewport.x, viewport.y, viewport.width, viewport.height].map(|n| n as u32);
    let mut view = FrameView {
        size: size_of::<FrameView>() as u32,
        width: desc.width as u32,
        height: desc.height as u32,
        is_opaque: 0,
        viewport: [x, y, width, height],
        background: desc.background,
        depth_threshold: desc.depth_threshold,
        opaque_kind: 0,
        rays: rays_view(&grid.linear()),
        camera: camera_view(&desc.camera),
        clip,
        clip_count,
        opaque_color: NO_VALUE,
        opaque_depth: NO_VALUE,
        opaque_matrix: DMat4::IDENTITY.to_cols_array(),
    };
    if let Some(opaque) = &desc.opaque {
        lend_opaque(&mut view, opaque, arena);
    }
    Ok(view)
}

fn lend_opaque(view: &mut FrameView, opaque: &Opaque, arena: &mut Arena) {
    let (width, height) = (u64::from(view.width), u64::from(view.height));
    view.is_opaque = 1;
    if let Some(color) = &opaque.color {
        let color = Arc::clone(color).into();
        view.opaque_color = lend(abi::KIND_ARRAY, abi::SCALAR_F32, &[4, width, height], &color, arena);
    }
    let values = match &opaque.depth {
        OpaqueDepth::Distance(values) => values,
        OpaqueDepth::Buffer { values, range, world_to_clip } => {
            view.opaque_kind = if *range == DepthRange::ZeroToOne { 1 } else { 2 };
            view.opaque_matrix = world_to_clip.to_cols_array();
            values
        }
    };
    view.opaque_depth = lend(abi::KIND_ARRAY, abi::SCALAR_F32, &[width, height], &Arc::clone(values).into(), arena);
}

fn rays_view(rays: &LinearRays) -> RaysView {
    RaysView {
        perspective: u32::from(rays.eye.is_some()),
        reserved: 0,
        eye: rays.eye.unwrap_or_default().to_array(),
        direction: rays.direction.to_array(),
        depth_zero: rays.depth_zero,
        corner: rays.corner.to_array(),
        dx: rays.dx.to_array(),
        dy: rays.dy.to_array(),
        axis: rays.axis.to_array(),
        near: rays.near,
        far: rays.far,
    }
}

fn camera_view(camera: &Camera) -> CameraView {
    match *camera {
        Camera::LookAt { eye, target, up, projection, near, far } => {
            let (projection, extent) = match projection {
                Projection::Perspective { fov_y } => (0, fov_y),
                Projection::Orthographic { height } => (1, height),
            };
            let [eye, target, up] = [eye, target, up].map(|v| v.to_array());
            CameraView { kind: 0, projection, eye, target, up, extent, near, far, ..CameraView::default() }
        }
        Camera::Matrices { view, projection, depth } => CameraView {
            kind: 1,
            depth_range: u32::from(depth == DepthRange::MinusOneToOne),
            view: view.to_cols_array(),
            projection_matrix: projection.to_cols_array(),
            ..CameraView::default()
        },
    }
}

fn decode_camera(view: &CameraView) -> Result<Camera, Fault> {
    if flag(view.kind, "kind of camera")? {
        let minus = flag(view.depth_range, "depth range")?;
        return Ok(Camera::Matrices {
            view: DMat4::from_cols_array(&view.view),
            projection: DMat4::from_cols_array(&view.projection_matrix),
            depth: if minus { DepthRange::MinusOneToOne } else { DepthRange::ZeroToOne },
        });
    }
    let [eye, target, up] = [view.eye, view.target, view.up].map(DVec3::from_array);
    let projection = match flag(view.projection, "projection")? {
        true => Projection::Orthographic { height: view.extent },
        false => Projection::Perspective { fov_y: view.extent },
    };
    Ok(Camera::LookAt { eye, target, up, projection, near: view.near, far: view.far })
}

/// A frame that the host asks for.
///
/// # Safety
/// What the view says is true.
pub(super) unsafe fn decode_frame(view: &FrameView) -> Result<FrameDesc, Fault> {
    let [x, y, width, height] = view.viewport.map(|n| n as usize);
    let viewport = Viewport { x, y, width, height };
    let mut desc = FrameDesc::new(decode_camera(&view.camera)?, view.width as usize, view.height as usize);
    desc.viewport = (viewport != desc.viewport()).then_some(viewport);
    desc.background = view.background;
    desc.depth_threshold = view.depth_threshold;
    // SAFETY: as promised by the caller.
    desc.clip = unsafe { decode_clip(view.clip, view.clip_count) }?;
    if flag(view.is_opaque, "whether there are opaque depths")? {
        // SAFETY: as promised by the caller.
        desc.opaque = Some(unsafe { decode_opaque(view) }?);
    }
    Ok(desc)
}

/// # Safety
/// What the view says is true.
unsafe fn decode_opaque(view: &FrameView) -> Result<Opaque, Fault> {
    let read = |array: &ArrayView, what| {
        // SAFETY: as promised by the caller.
        unsafe { receive(array, what, Passing::Lent) }.map(|got| got.buffer)
    };
    let odd = || Fault::bad("opaque picture", "odd", "f32 numbers, one or four a pixel");
    let color = (!is_none(&view.opaque_color)).then(|| read(&view.opaque_color, "opaque colours")).transpose()?;
    let color = color.map(|c| c.as_slice::<[f32; 4]>().map(Arc::from).ok_or_else(odd)).transpose()?;
    let values = read(&view.opaque_depth, "opaque depths")?;
    let values: Arc<[f32]> = values.as_slice().map(Arc::from).ok_or_else(odd)?;
    let depth = match view.opaque_kind {
        0 => OpaqueDepth::Distance(values),
        kind @ (1 | 2) => OpaqueDepth::Buffer {
            values,
            range: if kind == 1 { DepthRange::ZeroToOne } else { DepthRange::MinusOneToOne },
            world_to_clip: DMat4::from_cols_array(&view.opaque_matrix),
        },
        other => return Err(Fault::bad("kind of opaque depths", other, "0 to 2")),
    };
    Ok(Opaque { color, depth })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, View};

    fn through(desc: &FrameDesc) -> FrameDesc {
        let mut arena = Arena::default();
        let view = lend_frame(desc, &mut arena).unwrap();
        // SAFETY: the view is one of this module.
        unsafe { decode_frame(&view) }.unwrap()
    }

    #[test]
    fn frames_come_through_to_the_last_bit() {
        let bounds = Aabb::new(DVec3::splat(0.1), DVec3::new(3.3, 5.7, 7.1));
        let mut desc =
            FrameDesc::new(Camera::fit(&bounds, View::Iso, 7, 5), 7, 5).with_background([0.1, 0.2, 0.3, 0.4]);
        assert_eq!(through(&desc), desc);
        let plane = Plane::new(DVec3::new(0.3, 0.7, 0.1), DVec3::new(0.2, 0.5, 0.9)).unwrap();
        desc.clip = Clip::new([ClipRegion::plane(plane).cut(), ClipRegion::crop(bounds)]);
        desc.viewport = Some(Viewport { x: 1, y: 2, width: 3, height: 2 });
        desc.camera = Camera::orthographic(DVec3::X, DVec3::ZERO, DVec3::Z, 3.0);
        desc.opaque = Some(Opaque {
            color: Some(vec![[0.5; 4]; 35].into()),
            depth: OpaqueDepth::Buffer {
                values: vec![0.25; 35].into(),
                range: DepthRange::MinusOneToOne,
                world_to_clip: DMat4::from_scale(DVec3::new(1.0, 2.0, 3.0)),
            },
        });
        assert_eq!(through(&desc), desc);
        desc.camera = Camera::Matrices {
            view: DMat4::from_rotation_x(0.3),
            projection: DMat4::from_cols_array(&std::array::from_fn(|i| 0.1 + (i * i) as f64)),
            depth: DepthRange::ZeroToOne,
        };
        assert_eq!(through(&desc), desc);
    }
}
