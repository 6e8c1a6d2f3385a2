//! File formats for Volact: volumes and meshes in, pictures out.
//!
//! [`loaders`] gives every format as a [`Loader`] for a registry. Each module says what it reads,
//! which options it takes and where its limits are.
//!
//! - Opening reads headers only and compares the promised sizes with the files; a compressed file
//!   that could not hold what its header promises is refused before memory is taken for it.
//! - Voxels arrive in native byte order, x fastest. Large raw files in that order are mapped:
//!   while such a volume lives, its file must not be changed or cut.
//! - Regions of uncompressed formats are read by seeking; of compressed ones by decoding up to the
//!   region's end and keeping the region only.
//! - Meshes and surfaces are read whole, with all numbers of their vertices. Arrays are shared with
//!   a mapped file where it has them raw, aligned and in native byte order.
//! - Memory is taken for what a file can hold, never on the word of a header.
//! - World space of medical formats is LPS.
//!
//! `volact-files-plugin`, beside this crate, is all of it as a plugin: a library to load, and an entry to link.

mod decode;
mod dicom;
mod elements;
mod exodus;
mod fields;
mod format;
mod mesh;
mod metaimage;
mod nifti;
mod nrrd;
mod numbers;
mod obj;
mod payload;
pub mod picture;
mod plot3d;
mod ply;
mod png_series;
mod raw;
mod series;
mod slices;
mod stl;
mod storage;
mod text;
mod tiff_pages;
mod vti;
mod vtk;
mod vtk_arrays;
mod vtk_blocks;
mod vtk_legacy;
mod vtk_mesh;
mod vtk_xml;
mod vtp;
mod vts;
mod vtu;
mod world;

use std::{path::Path, sync::Arc};

use volact_core::{
    LoadError, LoadOptions, Loader, MeshData, Progress, Registry, VolumeReader, names, registry::RegisterError,
};

pub use storage::Storage;

use format::Format;

fn formats() -> Vec<Format> {
    vec![
        nrrd::format(),
        metaimage::format(),
        nifti::format(),
        dicom::format(),
        tiff_pages::format(),
        png_series::format(),
        vtk::format(),
        vti::format(),
        vtk_mesh::format(),
        vtu::format(),
        vts::format(),
        vtp::format(),
        plot3d::format(),
        exodus::format(),
        obj::format(),
        ply::format(),
        stl::format(),
        raw::format(),
    ]
}

/// All loaders of this crate: of volumes nrrd, metaimage, nifti, dicom, tiff, png, vtk, vti and raw,
/// of meshes vtk-mesh, vtu, vts, vtp, plot3d, exodus, obj, ply and stl.
pub fn loaders() -> Vec<Arc<dyn Loader>> {
    formats().into_iter().map(|format| Arc::new(format) as Arc<dyn Loader>).collect()
}

/// Registers all loaders of this crate.
///
/// # Errors
/// If a name is taken.
pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    loaders().into_iter().try_for_each(|loader| registry.add_loader(loader))
}

/// Opens a file of a [`Storage`] with the loader of that name, as [`Loader::open`] does on disk.
///
/// # Errors
/// As [`Loader::open`], and if no loader has that name or an option is wrong.
pub fn open_in(
    storage: &Storage,
    loader: &str,
    path: &Path,
    options: &LoadOptions,
) -> Result<Box<dyn VolumeReader>, LoadError> {
    let (format, options) = resolve(loader, options)?;
    format.open_in(storage, path, &options)
}

/// Reads a mesh of a [`Storage`] with the loader of that name, as [`Loader::read_mesh`] does on
/// disk.
///
/// # Errors
/// As [`Loader::read_mesh`], and if no loader has that name or an option is wrong.
pub fn read_mesh_in(
    storage: &Storage,
    loader: &str,
    path: &Path,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let (format, options) = resolve(loader, options)?;
    format.read_mesh_in(storage, path, &options, progress)
}

fn resolve(loader: &str, options: &LoadOptions) -> Result<(Format, LoadOptions), LoadError> {
    let mut formats = formats();
    let Some(at) = formats.iter().position(|f| f.name() == loader) else {
        let names = || formats.iter().map(Format::name);
        let (hint, known) = (names::hint(loader, names()), names().collect::<Vec<_>>().join(", "));
        return Err(LoadError::UnknownLoader { name: loader.into(), hint, known });
    };
    let format = formats.swap_remove(at);
    let options = format.declaration().resolve(options, |_| false).map_err(|problems| LoadError::Options {
        loader: loader.into(),
        problem: problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
    })?;
    Ok((format, options))
}
