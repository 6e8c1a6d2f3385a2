//! Geometries across the boundary, whichever side made them. A new kind of geometry is added here,
//! in [`give_geometry`] and [`decode_geometry`].

use std::{any::Any, ffi::c_void, fmt, sync::Arc};

use glam::DVec3;

use super::{
    abi::{self, ArrayView, GeometryView, TessellationView},
    arena::{Arena, NO_VALUE, Reference, flag, list_of, string_of},
    array::{Passing, Received, give, is_none, receive, scalar_code, scalar_of, want_kind},
    services::answer,
    status::{Code, Fault, result_of},
    value::extents,
};
use crate::{
    Aabb, Block, Buffer, CellType, CellTypes, Geometry, Mesh, Plane, Points, SliceStyle, Sliced, Slices,
    StructuredMesh, Surface, Tessellation, geometry::GeometryError,
};

/// A geometry without anything.
pub(super) fn empty_geometry() -> GeometryView {
    GeometryView {
        size: size_of::<GeometryView>() as u32,
        kind: abi::GEOMETRY_OTHER,
        name: super::arena::NO_TEXT,
        bounds: [0.0; 6],
        dims: [0; 3],
        vertex_count: u64::MAX,
        vertices: NO_VALUE,
        cells: NO_VALUE,
        types: NO_VALUE,
        normals: NO_VALUE,
        texture_coordinates: NO_VALUE,
        blanked: NO_VALUE,
        cell_type: 0,
        slice_style: 0,
        slice_volume: 0,
        reserved: 0,
        planes: std::ptr::null(),
        plane_count: 0,
        owner: std::ptr::null_mut(),
        retain: None,
        release: None,
        tessellate: None,
    }
}

fn points(points: &Points) -> ArrayView {
    give(abi::KIND_ARRAY, scalar_code(points.scalar()), &[3, points.len() as u64], points.data())
}

fn plain(scalar: u32, number: usize, buffer: &Buffer) -> ArrayView {
    give(abi::KIND_ARRAY, scalar, &[number as u64], buffer)
}

/// A geometry as a view whose arrays and owner come with one reference each; name and planes are
/// valid as long as the arena.
pub(super) fn give_geometry(geometry: &Arc<dyn Geometry>, arena: &mut Arena) -> GeometryView {
    let mut view = GeometryView { name: arena.text(geometry.name()), ..empty_geometry() };
    let bounds = geometry.bounds();
    view.bounds[..3].copy_from_slice(&bounds.min.to_array());
    view.bounds[3..].copy_from_slice(&bounds.max.to_array());
    view.vertex_count = geometry.vertex_count().map_or(u64::MAX, |n| n as u64);
    if let Some(slices) = geometry.slices() {
        let numbers = |p: &Plane| [p.normal().x, p.normal().y, p.normal().z, p.offset()];
        let (planes, count) = arena.list(slices.planes.iter().map(numbers).collect::<Vec<_>>());
        (view.planes, view.plane_count) = (planes.cast(), count);
        view.slice_style = u32::from(slices.style == SliceStyle::Blended);
        view.slice_volume = u32::from(slices.volume);
    }
    let mut inner: &dyn Geometry = geometry.as_ref();
    while let Some(sliced) = inner.as_any().downcast_ref::<Sliced>() {
        inner = sliced.geometry().as_ref();
    }
    fill(&mut view, inner);
    view.owner = Arc::into_raw(Arc::new(Arc::clone(geometry))).cast_mut().cast();
    view.retain = Some(retain);
    view.release = Some(release);
    view.tessellate = Some(tessellate);
    view
}

/// What the geometry's kind needs.
fn fill(view: &mut GeometryView, geometry: &dyn Geometry) {
    let any = geometry.as_any();
    if let Some(bounds) = geometry.as_block() {
        view.kind = abi::GEOMETRY_BLOCK;
        view.bounds[..3].copy_from_slice(&bounds.min.to_array());
        view.bounds[3..].copy_from_slice(&bounds.max.to_array());
    } else if let Some(surface) = geometry.as_surface() {
        view.kind = abi::GEOMETRY_SURFACE;
        view.vertices = points(surface.points());
        view.cells = plain(abi::SCALAR_U32, surface.triangles().len() * 3, surface.triangle_data());
        view.normals = surface.normals().map_or(NO_VALUE, points);
    } else if let Some(mesh) = any.downcast_ref::<Mesh>() {
        view.kind = abi::GEOMETRY_MESH;
        view.vertices = points(mesh.points());
        view.cells = plain(abi::SCALAR_U32, mesh.connectivity().len() / 4, mesh.connectivity());
        view.texture_coordinates = mesh.texture_coordinates().map_or(NO_VALUE, points);
        match mesh.types() {
            CellTypes::All(cell_type) => view.cell_type = *cell_type as u32,
            CellTypes::Each(codes) => view.types = plain(abi::SCALAR_U8, codes.len(), codes),
        }
    } else if let Some(mesh) = any.downcast_ref::<StructuredMesh>() {
        view.kind = abi::GEOMETRY_STRUCTURED;
        view.dims = mesh.dims().map(|n| n as u64);
        view.vertices = points(mesh.points());
        view.blanked = mesh.blanked().map_or(NO_VALUE, |flags| plain(abi::SCALAR_U8, flags.len(), flags));
        view.texture_coordinates = mesh.texture_coordinates().map_or(NO_VALUE, points);
    }
}

/// A geometry as a view that is valid as long as the arena.
pub(super) fn lend_geometry(geometry: &Arc<dyn Geometry>, arena: &mut Arena) -> GeometryView {
    let view = give_geometry(geometry, arena);
    for array in arrays(&view) {
        arena.own(array);
    }
    arena.keep(Reference { owner: view.owner, release: view.release });
    view
}

fn arrays(view: &GeometryView) -> [&ArrayView; 6] {
    [&view.vertices, &view.cells, &view.types, &view.normals, &view.texture_coordinates, &view.blanked]
}

unsafe extern "C" fn retain(owner: *mut c_void) {
    // SAFETY: `owner` is what `give_geometry` made, and the caller has a reference to it.
    unsafe { Arc::increment_strong_count(owner.cast::<Arc<dyn Geometry>>()) };
}

unsafe extern "C" fn release(owner: *mut c_void) {
    answer(|| {
        // SAFETY: `owner` is what `give_geometry` made, and the caller gives its reference up.
        unsafe { Arc::decrement_strong_count(owner.cast::<Arc<dyn Geometry>>()) };
        Ok(())
    });
}

unsafe extern "C" fn tessellate(owner: *mut c_void, made: *mut TessellationView) -> i32 {
    answer(|| {
        // SAFETY: `owner` is what `give_geometry` made, and the caller has a reference to it.
        let geometry = unsafe { &*owner.cast::<Arc<dyn Geometry>>() };
        // SAFETY: the caller gives a table whose size it has set.
        let made = unsafe { made.as_mut() }.ok_or_else(|| Fault::bad("tessellation", "a null pointer", "a table"))?;
        if (made.size as usize) < size_of::<TessellationView>() {
            return Err(Fault::bad("size of a tessellation", made.size, size_of::<TessellationView>()));
        }
        let cut = geometry.tessellate().map_err(|error| Fault::new(Code::BadValue, error.to_string()))?;
        made.vertices = points(&cut.vertices);
        let count = cut.tetrahedra.len() as u64;
        made.tetrahedra = give(abi::KIND_ARRAY, abi::SCALAR_U32, &[4, count], &Buffer::from_vec(cut.tetrahedra));
        made.texture_coordinates = cut.texture_coordinates.as_ref().map_or(NO_VALUE, points);
        (made.collapsed, made.inverted, made.folded) = (cut.collapsed as u64, cut.inverted as u64, cut.folded as u64);
        Ok(())
    })
}

/// A geometry of the other side; `from` is its name in errors.
///
/// # Safety
/// What the view says is true.
pub(super) unsafe fn decode_geometry(
    view: &GeometryView,
    passing: Passing,
    from: &str,
) -> Result<Arc<dyn Geometry>, Fault> {
    let names = ["vertices", "cells", "types of cells", "normals", "texture coordinates", "blanking flags"];
    // All are received before anything is refused, so that all are released.
    let mut got = Vec::new();
    for (array, what) in arrays(view).into_iter().zip(names) {
        // SAFETY: as promised by the caller.
        let received = (!is_none(array)).then(|| unsafe { receive(array, what, passing) });
        let kind = if is_none(array) { Ok(()) } else { want_kind(array, abi::KIND_ARRAY, what) };
        got.push(received.map(|r| kind.and(r)));
    }
    if passing == Passing::Lent
        && let Some(retain) = view.retain
    {
        // SAFETY: the view is valid during the call that it was lent for.
        unsafe { retain(view.owner) };
    }
    let held = passing == Passing::Given || view.retain.is_some();
    let reference = Reference { owner: view.owner, release: view.release.filter(|_| held) };
    if (view.size as usize) < size_of::<GeometryView>() {
        return Err(Fault::bad("size of a geometry", view.size, format!("at least {}", size_of::<GeometryView>())));
    }
    let mut parts = Vec::new();
    for part in got {
        parts.push(part.transpose()?);
    }
    let parts: [Option<Received>; 6] = parts.try_into().map_err(|_| Fault::bad("geometry", "odd", "six arrays"))?;
    // SAFETY: as promised by the caller.
    let name = unsafe { string_of(view.name, "name of a geometry") }?;
    let inner: Arc<dyn Geometry> = match view.kind {
        abi::GEOMETRY_OTHER => Arc::new(Foreign::new(view, &name, reference, from)?),
        _ => concrete(view, parts)?,
    };
    let named: Arc<dyn Geometry> =
        if name.is_empty() || inner.name() == name { inner } else { Arc::new(Named { name, inner }) };
    // SAFETY: as promised by the caller.
    unsafe { with_planes(view, named) }
}

/// One of core's own geometries over the other side's arrays.
fn concrete(view: &GeometryView, parts: [Option<Received>; 6]) -> Result<Arc<dyn Geometry>, Fault> {
    let [vertices, cells, types, normals, texture, blanked] = parts;
    let missing =
        |what: &str| Fault::bad(what, "left out", format!("an array, since the geometry's kind is {}", view.kind));
    let vertices = || positions(vertices.ok_or_else(|| missing("vertices"))?, "vertices");
    let texture = texture.map(|t| positions(t, "texture coordinates")).transpose()?;
    Ok(match view.kind {
        abi::GEOMETRY_BLOCK => block(bounds_of(view)?)?,
        abi::GEOMETRY_SURFACE => {
            let triangles = indices(cells.ok_or_else(|| missing("cells"))?, "cells")?;
            let surface = Surface::new(vertices()?, triangles).map_err(wrong)?;
            match normals {
                Some(normals) => Arc::new(surface.with_normals(positions(normals, "normals")?).map_err(wrong)?),
                None => Arc::new(surface),
            }
        }
        abi::GEOMETRY_MESH => {
            let cells = indices(cells.ok_or_else(|| missing("cells"))?, "cells")?;
            let mesh = Mesh::new(vertices()?, cell_types(view, types)?, cells).map_err(wrong)?;
            match texture {
                Some(texture) => Arc::new(mesh.with_texture_coordinates(texture).map_err(wrong)?),
                None => Arc::new(mesh),
            }
        }
        abi::GEOMETRY_STRUCTURED => {
            let dims = view.dims.map(|n| usize::try_from(n).unwrap_or(usize::MAX));
            let mut mesh = StructuredMesh::new(dims, vertices()?).map_err(wrong)?;
            if let Some(flags) = blanked {
                mesh = mesh.with_blanking(bytes(flags, "blanking flags")?).map_err(wrong)?;
            }
            if let Some(texture) = texture {
                mesh = mesh.with_texture_coordinates(texture).map_err(wrong)?;
            }
            Arc::new(mesh)
        }
        other => {
            return Err(Fault::new(Code::Unsupported, format!("kind of a geometry is {other}, which nobody knows")));
        }
    })
}

fn wrong(error: GeometryError) -> Fault {
    Fault::new(Code::BadValue, error.to_string())
}

fn positions(got: Received, what: &str) -> Result<Points, Fault> {
    let [width, _] = extents::<2>(&got.shape, what)?;
    if width != 3 {
        return Err(Fault::bad(format!("shape of {what}"), format!("{:?}", got.shape), "[3, n]"));
    }
    Points::new(scalar_of(got.scalar, what)?, got.buffer).map_err(wrong)
}

fn indices(got: Received, what: &str) -> Result<Buffer, Fault> {
    if got.scalar != abi::SCALAR_U32 {
        return Err(Fault::bad(format!("scalar type of {what}"), format!("code {}", got.scalar), "u32"));
    }
    Ok(got.buffer)
}

fn bytes(got: Received, what: &str) -> Result<Buffer, Fault> {
    if got.scalar != abi::SCALAR_U8 {
        return Err(Fault::bad(format!("scalar type of {what}"), format!("code {}", got.scalar), "u8"));
    }
    Ok(got.buffer)
}

fn cell_types(view: &GeometryView, types: Option<Received>) -> Result<CellTypes, Fault> {
    if let Some(types) = types {
        return Ok(CellTypes::Each(bytes(types, "types of cells")?));
    }
    let known = u8::try_from(view.cell_type).ok().and_then(CellType::from_code);
    known.map(CellTypes::All).ok_or_else(|| Fault::bad("type of cells", view.cell_type, "10, 12, 13 or 14"))
}

fn bounds_of(view: &GeometryView) -> Result<Aabb, Fault> {
    let [a, b, c, d, e, f] = view.bounds;
    let bounds = Aabb { min: DVec3::new(a, b, c), max: DVec3::new(d, e, f) };
    if bounds.min.is_finite() && bounds.max.is_finite() && !bounds.is_empty() {
        return Ok(bounds);
    }
    Err(Fault::bad("bounds", format!("{:?}", view.bounds), "finite corners, none below the other"))
}

fn block(bounds: Aabb) -> Result<Arc<dyn Geometry>, Fault> {
    let block = Block::new(bounds.min, bounds.size()).map_err(wrong)?;
    // A corner that rounding would move makes another picture.
    Ok(if block.bounds() == bounds { Arc::new(block) } else { Arc::new(ExactBlock { block, bounds }) })
}

/// # Safety
/// What the view says is true.
unsafe fn with_planes(view: &GeometryView, geometry: Arc<dyn Geometry>) -> Result<Arc<dyn Geometry>, Fault> {
    if view.plane_count == 0 {
        return Ok(geometry);
    }
    // SAFETY: as promised by the caller.
    let planes = unsafe { planes_of(view.planes, view.plane_count) }?;
    let style = if flag(view.slice_style, "slice style")? { SliceStyle::Blended } else { SliceStyle::Opaque };
    let slices = Slices { planes, style, volume: flag(view.slice_volume, "whether the volume is drawn")? };
    Ok(Arc::new(Sliced::new(geometry, slices).map_err(wrong)?))
}

/// Planes of four numbers each.
///
/// # Safety
/// `data` is null or valid for so many planes.
pub(super) unsafe fn planes_of(data: *const f64, count: u64) -> Result<Vec<Plane>, Fault> {
    // SAFETY: as promised by the caller.
    let planes = unsafe { list_of(data.cast::<[f64; 4]>(), count, "planes") }?;
    let plane = |n: &[f64; 4]| {
        Plane::from_numbers(*n).ok_or_else(|| Fault::bad("a plane", format!("{n:?}"), "a unit normal and an offset"))
    };
    planes.iter().map(plane).collect()
}

/// A box whose corners are not its lengths to the last bit.
#[derive(Debug)]
struct ExactBlock {
    block: Block,
    bounds: Aabb,
}

impl Geometry for ExactBlock {
    fn name(&self) -> &str {
        self.block.name()
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        let vertices = self.bounds.corners().into_iter().collect();
        Ok(Tessellation { vertices, ..self.block.tessellate()? })
    }

    fn as_block(&self) -> Option<Aabb> {
        Some(self.bounds)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// A geometry under another name, or behind a pointer.
#[derive(Debug)]
pub(super) struct Named {
    pub name: String,
    pub inner: Arc<dyn Geometry>,
}

impl Geometry for Named {
    fn name(&self) -> &str {
        &self.name
    }

    fn bounds(&self) -> Aabb {
        self.inner.bounds()
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        self.inner.tessellate()
    }

    fn as_block(&self) -> Option<Aabb> {
        self.inner.as_block()
    }

    fn as_surface(&self) -> Option<&Surface> {
        self.inner.as_surface()
    }

    fn slices(&self) -> Option<&Slices> {
        self.inner.slices()
    }

    fn vertex_count(&self) -> Option<usize> {
        self.inner.vertex_count()
    }

    fn as_any(&self) -> &dyn Any {
        self.inner.as_any()
    }
}

type Tessellate = unsafe extern "C" fn(*mut c_void, *mut TessellationView) -> i32;

/// A geometry that only its maker can cut.
struct Foreign {
    from: String,
    name: String,
    bounds: Aabb,
    vertex_count: Option<usize>,
    tessellate: Tessellate,
    reference: Reference,
}

impl Foreign {
    fn new(view: &GeometryView, name: &str, reference: Reference, from: &str) -> Result<Self, Fault> {
        let Some(tessellate) = view.tessellate else {
            return Err(Fault::bad("function tessellate", "null", "a function, since the geometry's kind is 0"));
        };
        let vertex_count = (view.vertex_count != u64::MAX).then(|| usize::try_from(view.vertex_count));
        let vertex_count = vertex_count.transpose().map_err(|_| Fault::bad("number of vertices", "huge", "less"))?;
        let bounds = bounds_of(view)?;
        Ok(Self { from: from.into(), name: name.into(), bounds, vertex_count, tessellate, reference })
    }

    fn cut(&self) -> Result<Tessellation, Fault> {
        let mut made = TessellationView {
            size: size_of::<TessellationView>() as u32,
            reserved: 0,
            vertices: NO_VALUE,
            tetrahedra: NO_VALUE,
            texture_coordinates: NO_VALUE,
            collapsed: 0,
            inverted: 0,
            folded: 0,
        };
        super::status::clear();
        let status = {
            let _state = super::float::FloatState::save();
            // SAFETY: the reference keeps the owner, whose function this is.
            unsafe { (self.tessellate)(self.reference.owner, &raw mut made) }
        };
        result_of(status)?;
        let take = |view: &ArrayView, what| {
            // SAFETY: the boundary's rules, which the maker keeps.
            (!is_none(view)).then(|| unsafe { receive(view, what, Passing::Given) }).transpose()
        };
        let (vertices, corners) = (take(&made.vertices, "vertices"), take(&made.tetrahedra, "tetrahedra"));
        let texture = take(&made.texture_coordinates, "texture coordinates")?;
        let missing = |what: &str| Fault::bad(what, "left out", "an array");
        let vertices = positions(vertices?.ok_or_else(|| missing("vertices"))?, "vertices")?;
        let corners = indices(corners?.ok_or_else(|| missing("tetrahedra"))?, "tetrahedra")?;
        let found = corners.as_slice::<[u32; 4]>();
        let corners = found.ok_or_else(|| Fault::bad("tetrahedra", "odd", "four indices each"))?;
        let tessellation = Tessellation {
            vertices,
            tetrahedra: corners.to_vec(),
            texture_coordinates: texture.map(|t| positions(t, "texture coordinates")).transpose()?,
            collapsed: made.collapsed as usize,
            inverted: made.inverted as usize,
            folded: made.folded as usize,
        };
        tessellation.validate(&self.name).map_err(wrong)?;
        Ok(tessellation)
    }
}

impl fmt::Debug for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct(&self.name).field("bounds", &self.bounds).finish_non_exhaustive()
    }
}

impl Geometry for Foreign {
    fn name(&self) -> &str {
        &self.name
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        self.cut().map_err(|fault| fault.of(&self.from).into())
    }

    fn vertex_count(&self) -> Option<usize> {
        self.vertex_count
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
