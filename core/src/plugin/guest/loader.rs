//! Loaders in Rust behind the table that the host calls.

use std::{ffi::c_void, path::Path, sync::Arc};

use super::{drop_quietly, given, keep, place, user};
use crate::{
    Buffer, LoadError, LoadOptions, Loader, Progress, Region, VolumeReader,
    loader::{Confidence, Content, Probe},
    plugin::{
        abi::{
            self, ArrayView, LoaderTable, MeshView, Parameter, Parameters, ProgressView, RegionView, Text, VolumeView,
            WarningSink,
        },
        arena::{Arena, bytes_of},
        array::{give, scalar_code},
        declare::lend_declaration,
        geometry::give_geometry,
        host::path_of,
        picture::tell_warnings,
        services::answer,
        status::{Code, Fault, caught, chain},
        value::{Identities, decode_map, lend_attribute},
    },
};

/// The table of a loader.
pub(super) fn table(loader: &Arc<dyn Loader>, arena: &mut Arena) -> LoaderTable {
    LoaderTable {
        size: size_of::<LoaderTable>() as u32,
        content: if loader.content() == Content::Mesh { abi::CONTENT_MESH } else { abi::CONTENT_VOLUME },
        declaration: lend_declaration(loader.declaration(), arena),
        user: arena.one(Arc::clone(loader)).cast_mut().cast(),
        probe: Some(probe),
        open: Some(open),
        read_region: Some(read_region),
        read_all: Some(read_all),
        warnings: Some(warnings),
        close: Some(close),
        read_mesh: Some(read_mesh),
    }
}

fn fault(error: LoadError) -> Fault {
    let code = match &error {
        LoadError::Io { .. } | LoadError::Write { .. } => Code::Io,
        LoadError::Stopped { .. } => Code::Stopped,
        LoadError::Unsupported { .. } => Code::Unsupported,
        LoadError::UnknownFormat { .. } | LoadError::UnknownLoader { .. } => Code::BadName,
        LoadError::Plugin { source, .. } => source.code,
        _ => Code::BadValue,
    };
    Fault::new(code, chain(&error))
}

/// The progress that the host watches.
struct Watched(ProgressView);

// SAFETY: the host says that its progress is heard from any thread.
unsafe impl Sync for Watched {}

impl Progress for Watched {
    fn advance(&self, done: u64, total: u64) -> bool {
        // SAFETY: the host keeps the sink as long as the call.
        self.0.advance.is_none_or(|advance| unsafe { advance(self.0.user, done, total) } != 0)
    }
}

/// # Safety
/// The pointer is null or valid.
unsafe fn watched(progress: *const ProgressView) -> Result<Watched, Fault> {
    // SAFETY: as promised by the caller.
    Ok(Watched(*unsafe { given(progress, "progress") }?))
}

unsafe extern "C" fn probe(at: *mut c_void, path: Text, head: *const u8, head_length: u64, is_folder: u32) -> u32 {
    let found = caught(|| {
        // SAFETY: the host gives what the table was made with, and valid texts.
        let (loader, path) = unsafe { (user::<Arc<dyn Loader>>(at), path_of(path)?) };
        // SAFETY: as above.
        let head = unsafe { bytes_of(Text { data: head, length: head_length }, "head") }?;
        Ok(loader.probe(&Probe { path: &path, head, is_dir: is_folder == 1 }))
    });
    match found {
        Ok(Confidence::Content) => abi::CONFIDENCE_CONTENT,
        Ok(Confidence::Extension) => abi::CONFIDENCE_EXTENSION,
        Ok(Confidence::No) => abi::CONFIDENCE_NO,
        Err(fault) => {
            log::error!("a loader cannot look at a file: {fault}");
            abi::CONFIDENCE_NO
        }
    }
}

/// An open file, and what its description points to.
struct Reader {
    inner: Box<dyn VolumeReader>,
    _texts: Arena,
}

unsafe extern "C" fn open(
    at: *mut c_void,
    path: Text,
    options: Parameters,
    volume: *mut VolumeView,
    reader: *mut *mut c_void,
) -> i32 {
    answer(|| {
        // SAFETY: the host gives what the table was made with, and valid arguments.
        let (loader, path, volume, reader) = unsafe {
            (user::<Arc<dyn Loader>>(at), path_of(path)?, place(volume, "volume")?, place(reader, "reader")?)
        };
        // SAFETY: as above.
        let options: LoadOptions = unsafe { decode_map(options, &mut Identities::default()) }?;
        let inner = loader.open(&path, &options).map_err(fault)?;
        let desc = inner.desc();
        let mut texts = Arena::default();
        volume.scalar = scalar_code(desc.scalar);
        volume.components = u32::try_from(desc.components).unwrap_or(0);
        volume.dims = desc.dims.map(|n| n as u64);
        volume.spacing = desc.spacing.to_array();
        volume.placement = desc.placement.to_cols_array();
        (volume.slope, volume.intercept) = (desc.slope, desc.intercept);
        (volume.name, volume.unit) = (texts.text(&desc.name), texts.text(&desc.unit));
        *reader = Box::into_raw(Box::new(Reader { inner, _texts: texts })).cast();
        Ok(())
    })
}

/// # Safety
/// `reader` is what `open` made, and nobody else uses it meanwhile.
unsafe fn reader_of<'a>(reader: *mut c_void) -> Result<&'a mut Reader, Fault> {
    // SAFETY: as promised by the caller.
    unsafe { place(reader.cast(), "reader") }
}

fn voxels_of(reader: &Reader, data: &Buffer) -> ArrayView {
    let scalar = reader.inner.desc().scalar;
    give(abi::KIND_ARRAY, scalar_code(scalar), &[(data.len() / scalar.size()) as u64], data)
}

unsafe extern "C" fn read_region(
    reader: *mut c_void,
    region: *const RegionView,
    progress: *const ProgressView,
    voxels: *mut ArrayView,
) -> i32 {
    answer(|| {
        // SAFETY: the host gives a reader of `open` and valid arguments.
        let (reader, region, progress, voxels) =
            unsafe { (reader_of(reader)?, given(region, "region")?, watched(progress)?, place(voxels, "voxels")?) };
        let at = |corner: [u64; 3]| corner.map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        let region = Region { min: at(region.min), max: at(region.max) };
        let data = reader.inner.read_region(region, &progress).map_err(fault)?;
        *voxels = voxels_of(reader, &data);
        Ok(())
    })
}

unsafe extern "C" fn read_all(reader: *mut c_void, progress: *const ProgressView, voxels: *mut ArrayView) -> i32 {
    answer(|| {
        // SAFETY: the host gives a reader of `open` and valid arguments.
        let (reader, progress, voxels) = unsafe { (reader_of(reader)?, watched(progress)?, place(voxels, "voxels")?) };
        let data = reader.inner.read(&progress).map_err(fault)?;
        *voxels = voxels_of(reader, &data);
        Ok(())
    })
}

unsafe extern "C" fn warnings(reader: *mut c_void, sink: *const WarningSink) -> i32 {
    answer(|| {
        // SAFETY: the host gives a reader of `open` and a sink.
        let (reader, sink) = unsafe { (reader_of(reader)?, given(sink, "sink")?) };
        // SAFETY: as above.
        unsafe { tell_warnings(sink, reader.inner.warnings()) };
        Ok(())
    })
}

unsafe extern "C" fn close(reader: *mut c_void) {
    answer(|| {
        if !reader.is_null() {
            // SAFETY: `reader` is what `open` made, and the host gives it up.
            drop_quietly(unsafe { Box::from_raw(reader.cast::<Reader>()) }, "a reader");
        }
        Ok(())
    });
}

unsafe extern "C" fn read_mesh(
    at: *mut c_void,
    path: Text,
    options: Parameters,
    progress: *const ProgressView,
    warnings: *const WarningSink,
    mesh: *mut MeshView,
) -> i32 {
    answer(|| {
        // SAFETY: the host gives what the table was made with, and valid arguments.
        let (loader, path, progress, mesh) =
            unsafe { (user::<Arc<dyn Loader>>(at), path_of(path)?, watched(progress)?, place(mesh, "mesh")?) };
        // SAFETY: as above.
        let options: LoadOptions = unsafe { decode_map(options, &mut Identities::default()) }?;
        let path: &Path = &path;
        let read = loader.read_mesh(path, &options, &progress).map_err(fault)?;
        let mut arena = Arena::default();
        let mut attributes = Vec::new();
        for attribute in &read.attributes {
            // Given, since it is a result: the arena lets go of its own reference only.
            let value = lend_attribute(attribute, &mut arena);
            if let Some(retain) = value.retain {
                // SAFETY: the arena has a reference.
                unsafe { retain(value.owner) };
            }
            attributes.push(Parameter { name: arena.text(&attribute.name), value });
        }
        (mesh.attributes, mesh.attribute_count) = arena.list(attributes);
        mesh.name = arena.text(&read.name);
        // SAFETY: as above.
        *unsafe { place(mesh.geometry, "geometry") }? = give_geometry(&read.geometry, &mut arena);
        // SAFETY: as above.
        if let Some(sink) = unsafe { warnings.as_ref() } {
            // SAFETY: as above.
            unsafe { tell_warnings(sink, &read.warnings) };
        }
        keep(arena);
        Ok(())
    })
}
