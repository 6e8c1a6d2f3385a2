//! A plugin's loader as core's own trait.

use std::{
    ffi::c_void,
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{DAffine3, DVec3};

use super::{action::Shown, call, lend_path, needed};
use crate::{
    Buffer, Declaration, LoadError, LoadOptions, Loader, MeshData, Progress, Region, Roi, VolumeDesc, VolumeReader,
    Warning,
    loader::{Confidence, Content, Probe},
    plugin::{
        FloatState,
        abi::{self, ArrayView, LoaderTable, MeshView, ProgressView, RegionView, VolumeView},
        arena::{Arena, NO_TEXT, NO_VALUE, list_of, string_of},
        array::{Passing, receive, scalar_code, scalar_of, want_kind},
        geometry::{decode_geometry, empty_geometry},
        picture::warning_sink,
        status::{Code, Fault, caught},
        value::{decode_attribute, lend_map},
    },
};

type Probing = unsafe extern "C" fn(*mut c_void, abi::Text, *const u8, u64, u32) -> u32;

/// A file format of a plugin.
pub(super) struct PluginLoader {
    plugin: String,
    declaration: Declaration,
    content: Content,
    probe: Probing,
    table: Shown<LoaderTable>,
}

impl PluginLoader {
    pub fn new(plugin: &str, table: &'static LoaderTable, declaration: &Declaration) -> Result<Self, Fault> {
        let of = format!("loader {:?}", declaration.name);
        let content = match table.content {
            abi::CONTENT_VOLUME => Content::Volume,
            abi::CONTENT_MESH => Content::Mesh,
            other => return Err(Fault::new(Code::Unsupported, format!("content of {of} is {other}, wanted 0 or 1"))),
        };
        if content == Content::Volume {
            needed(table.open, &of, "open")?;
            needed(table.read_region, &of, "read_region")?;
            needed(table.close, &of, "close")?;
        } else {
            needed(table.read_mesh, &of, "read_mesh")?;
        }
        let probe = needed(table.probe, &of, "probe")?;
        Ok(Self { plugin: plugin.into(), declaration: declaration.clone(), content, probe, table: Shown(table) })
    }

    fn error(&self, path: &Path, fault: Fault) -> LoadError {
        error(&self.plugin, path, fault)
    }

    fn open_reader(&self, path: &Path, options: &LoadOptions) -> Result<PluginReader, Fault> {
        let table = self.table.get();
        let of = format!("loader {:?}", self.declaration.name);
        let open = needed(table.open, &of, "open")?;
        let mut arena = Arena::default();
        let (place, options) = (lend_path(path, &mut arena)?, lend_map(options, &mut arena));
        let mut view = empty_volume();
        let mut handle = std::ptr::null_mut();
        // SAFETY: the table's own function with what the boundary's rules demand.
        call(|| unsafe { open(table.user, place, options, &raw mut view, &raw mut handle) })?;
        if handle.is_null() {
            return Err(Fault::bad(format!("reader that open of {of} made"), "null", "a reader"));
        }
        // From here on the reader is closed, whatever happens.
        let mut reader = PluginReader {
            plugin: self.plugin.clone(),
            path: path.into(),
            desc: VolumeDesc::new([1; 3], crate::ScalarType::U8, 1),
            warnings: Vec::new(),
            read_region: needed(table.read_region, &of, "read_region")?,
            handle: Handle(handle),
            table: self.table,
        };
        reader.desc = desc_of(&view, path)?;
        reader.desc.validate().map_err(|e| Fault::new(Code::BadValue, e.to_string()))?;
        reader.ask_warnings()?;
        Ok(reader)
    }

    fn mesh(&self, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<MeshData, Fault> {
        let table = self.table.get();
        let read = needed(table.read_mesh, &format!("loader {:?}", self.declaration.name), "read_mesh")?;
        let mut arena = Arena::default();
        let (place, options) = (lend_path(path, &mut arena)?, lend_map(options, &mut arena));
        let mut geometry = empty_geometry();
        let mut view = MeshView {
            size: size_of::<MeshView>() as u32,
            reserved: 0,
            name: NO_TEXT,
            geometry: &raw mut geometry,
            attributes: std::ptr::null(),
            attribute_count: 0,
        };
        let mut warnings = Vec::new();
        let (sink, watched) = (warning_sink(&mut warnings), progress_view(&progress));
        // SAFETY: the table's own function with what the boundary's rules demand.
        call(|| unsafe { read(table.user, place, options, &raw const watched, &raw const sink, &raw mut view) })?;
        // All attributes are received before anything is refused, so that all are released.
        // SAFETY: the plugin answers for what it says, until its next call on this thread.
        let listed = unsafe { list_of(view.attributes, view.attribute_count, "attributes") }?;
        // SAFETY: as above.
        let attributes: Vec<_> = listed.iter().map(|a| unsafe { decode_attribute(a, Passing::Given) }).collect();
        // SAFETY: as above.
        let geometry = unsafe { decode_geometry(&geometry, Passing::Given, &self.plugin) }?;
        // SAFETY: as above.
        let name = unsafe { string_of(view.name, "name of the mesh") }?;
        let name = if name.is_empty() { file_name(path) } else { name };
        Ok(MeshData { name, geometry, attributes: attributes.into_iter().collect::<Result<_, _>>()?, warnings })
    }
}

fn error(plugin: &str, path: &Path, fault: Fault) -> LoadError {
    match fault.code {
        Code::Stopped => LoadError::Stopped { path: path.into() },
        _ => LoadError::Plugin { path: path.into(), source: fault.of(plugin) },
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

fn empty_volume() -> VolumeView {
    VolumeView {
        size: size_of::<VolumeView>() as u32,
        scalar: 0,
        components: 0,
        reserved: 0,
        dims: [0; 3],
        spacing: [1.0; 3],
        placement: DAffine3::IDENTITY.to_cols_array(),
        slope: 1.0,
        intercept: 0.0,
        name: NO_TEXT,
        unit: NO_TEXT,
    }
}

fn desc_of(view: &VolumeView, path: &Path) -> Result<VolumeDesc, Fault> {
    let dims = view.dims.map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    let mut desc = VolumeDesc::new(dims, scalar_of(view.scalar, "the voxels")?, view.components as usize);
    desc.spacing = DVec3::from_array(view.spacing);
    desc.placement = DAffine3::from_cols_array(&view.placement);
    (desc.slope, desc.intercept) = (view.slope, view.intercept);
    // SAFETY: the plugin answers for what it says, until the reader's next call.
    let name = unsafe { string_of(view.name, "name of the volume") }?;
    desc.name = if name.is_empty() { file_name(path) } else { name };
    // SAFETY: as above.
    desc.unit = unsafe { string_of(view.unit, "unit of the volume") }?;
    Ok(desc)
}

unsafe extern "C" fn advance(user: *mut c_void, done: u64, total: u64) -> u32 {
    // A watcher that panics asks to stop.
    let go_on = caught(|| {
        // SAFETY: `user` is the progress of the call that is still running.
        Ok(unsafe { &*user.cast::<&dyn Progress>() }.advance(done, total))
    });
    u32::from(go_on.unwrap_or(false))
}

fn progress_view(progress: &&dyn Progress) -> ProgressView {
    ProgressView { user: std::ptr::from_ref(progress).cast_mut().cast(), advance: Some(advance) }
}

impl fmt::Debug for PluginLoader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "loader {} of plugin {}", self.declaration.name, self.plugin)
    }
}

impl Loader for PluginLoader {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn probe(&self, probe: &Probe<'_>) -> Confidence {
        let mut arena = Arena::default();
        let Ok(path) = lend_path(probe.path, &mut arena) else { return Confidence::No };
        let (head, length) = (probe.head.as_ptr(), probe.head.len() as u64);
        let _state = FloatState::save();
        // SAFETY: the table's own function with what the boundary's rules demand.
        match unsafe { (self.probe)(self.table.get().user, path, head, length, u32::from(probe.is_dir)) } {
            abi::CONFIDENCE_CONTENT => Confidence::Content,
            abi::CONFIDENCE_EXTENSION => Confidence::Extension,
            abi::CONFIDENCE_NO => Confidence::No,
            other => {
                log::error!("{self:?}: how sure it is is {other}, wanted 0 to 2");
                Confidence::No
            }
        }
    }

    fn content(&self) -> Content {
        self.content
    }

    fn open(&self, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
        if self.content == Content::Mesh {
            let what = format!("a volume by loader {:?}", self.declaration.name);
            return Err(LoadError::Unsupported { path: path.into(), what, cure: "it reads meshes".into() });
        }
        match self.open_reader(path, options) {
            Ok(reader) => Ok(Box::new(reader)),
            Err(fault) => Err(self.error(path, fault)),
        }
    }

    fn read_mesh(&self, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<MeshData, LoadError> {
        if self.content == Content::Volume {
            let what = format!("a mesh by loader {:?}", self.declaration.name);
            return Err(LoadError::Unsupported { path: path.into(), what, cure: "it reads volumes".into() });
        }
        self.mesh(path, options, progress).map_err(|fault| self.error(path, fault))
    }
}

struct Handle(*mut c_void);

// SAFETY: a reader may move from thread to thread, and is used by one at a time.
unsafe impl Send for Handle {}

type ReadRegion = unsafe extern "C" fn(*mut c_void, *const RegionView, *const ProgressView, *mut ArrayView) -> i32;

struct PluginReader {
    plugin: String,
    path: PathBuf,
    desc: VolumeDesc,
    warnings: Vec<Warning>,
    read_region: ReadRegion,
    handle: Handle,
    table: Shown<LoaderTable>,
}

impl PluginReader {
    fn ask_warnings(&mut self) -> Result<(), Fault> {
        let Some(ask) = self.table.get().warnings else { return Ok(()) };
        let mut found = Vec::new();
        let sink = warning_sink(&mut found);
        // SAFETY: the reader's own function and handle.
        call(|| unsafe { ask(self.handle.0, &raw const sink) })?;
        self.warnings = found;
        Ok(())
    }

    /// Voxels that a function of the reader gives, of the size that they must have.
    fn voxels(
        &mut self,
        dims: [usize; 3],
        read: impl FnOnce(*mut c_void, *mut ArrayView) -> i32,
    ) -> Result<Buffer, Fault> {
        let mut view = NO_VALUE;
        call(|| read(self.handle.0, &raw mut view))?;
        // SAFETY: the plugin answers for what it says.
        let got = unsafe { receive(&view, "voxels", Passing::Given) }?;
        want_kind(&view, abi::KIND_ARRAY, "voxels")?;
        if got.scalar != scalar_code(self.desc.scalar) {
            let wanted = scalar_code(self.desc.scalar);
            return Err(Fault::bad("scalar type of the voxels", got.scalar, format!("{wanted}, as open said")));
        }
        let wanted = VolumeDesc { dims, ..self.desc.clone() }.bytes();
        if Some(got.buffer.len()) != wanted {
            let wanted = format!("{} for {dims:?} samples", wanted.unwrap_or(usize::MAX));
            return Err(Fault::bad("length of the voxels", format!("{} bytes", got.buffer.len()), wanted));
        }
        self.ask_warnings()?;
        Ok(got.buffer)
    }
}

impl VolumeReader for PluginReader {
    fn desc(&self) -> &VolumeDesc {
        &self.desc
    }

    fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        let dims = self.desc.dims;
        if (0..3).any(|a| region.min[a] > region.max[a] || region.max[a] >= dims[a]) {
            return Err(LoadError::Region { path: self.path.clone(), region, dims });
        }
        let view = RegionView { min: region.min.map(|n| n as u64), max: region.max.map(|n| n as u64) };
        let (read, watched) = (self.read_region, progress_view(&progress));
        // SAFETY: the reader's own function and handle.
        let read = |handle, voxels| unsafe { read(handle, &raw const view, &raw const watched, voxels) };
        self.voxels(region.dims(), read).map_err(|fault| error(&self.plugin, &self.path, fault))
    }

    fn read(&mut self, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        let Some(read) = self.table.get().read_all else {
            return self.read_region(Roi::whole(self.desc.dims), progress);
        };
        let watched = progress_view(&progress);
        // SAFETY: the reader's own function and handle.
        let read = |handle, voxels| unsafe { read(handle, &raw const watched, voxels) };
        self.voxels(self.desc.dims, read).map_err(|fault| error(&self.plugin, &self.path, fault))
    }
}

impl Drop for PluginReader {
    fn drop(&mut self) {
        if let Some(close) = self.table.get().close {
            let _state = FloatState::save();
            // SAFETY: the reader's own function and handle, which nobody uses after.
            unsafe { close(self.handle.0) };
        }
    }
}

/// A loader as registries keep it.
pub(super) fn shared(loader: PluginLoader) -> Arc<dyn Loader> {
    Arc::new(loader)
}
