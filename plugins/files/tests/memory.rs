//! Memory is taken for what a file holds, not for what it says: every promise of a huge volume in
//! a small file, and every bomb, read under an allocator that counts.
//!
//! One test alone in this file, so that nobody else allocates meanwhile.

#![expect(unsafe_code, reason = "an allocator is unsafe to implement")]

mod mesh_samples;
mod samples;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    path::Path,
    sync::atomic::{AtomicUsize, Ordering::SeqCst},
};

use volact_core::loader::{LoadOptions, NoProgress};
use volact_files::{Storage, open_in, read_mesh_in};

struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(NOW.fetch_add(layout.size(), SeqCst) + layout.size(), SeqCst);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), SeqCst);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Bytes that opening and reading a file took at their highest, and whether it was accepted.
fn peak(loader: &str, path: &str, bytes: Vec<u8>) -> (usize, bool) {
    let storage = Storage::memory([(path, bytes)]);
    let before = NOW.load(SeqCst);
    PEAK.store(before, SeqCst);
    let read = open_in(&storage, loader, Path::new(path), &LoadOptions::new()).and_then(|mut r| r.read(&NoProgress));
    (PEAK.load(SeqCst) - before, read.is_ok())
}

/// The same of a mesh.
fn mesh_peak(loader: &str, path: &str, bytes: Vec<u8>) -> (usize, bool) {
    let storage = Storage::memory([(path, bytes)]);
    let before = NOW.load(SeqCst);
    PEAK.store(before, SeqCst);
    let read = read_mesh_in(&storage, loader, Path::new(path), &LoadOptions::new(), &NoProgress);
    (PEAK.load(SeqCst) - before, read.is_ok())
}

/// Files of a kilobyte that say they hold two billion cells or vertices.
fn huge_meshes() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    use mesh_samples::{OBJ, PLAIN, Xml, ply, small, stl_binary, tetrahedron, vtk, vtu};
    let replaced = |bytes: Vec<u8>, from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
    };
    let mut all = Vec::new();
    for (mode, compressor) in (0..4).flat_map(|mode| (0..3).map(move |c| (mode, c))) {
        let file = || vtu(&small(), Xml { mode, compressor, ..PLAIN });
        all.push(("vtu", "m.vtu", replaced(file(), "NumberOfCells=\"3\"", "NumberOfCells=\"2000000000\"")));
        all.push(("vtu", "m.vtu", replaced(file(), "NumberOfPoints=\"8\"", "NumberOfPoints=\"2000000000\"")));
    }
    for text in [false, true] {
        all.push((
            "vtk-mesh",
            "m.vtk",
            replaced(vtk(&small(), text, true), "CELLS 4 14", "CELLS 2000000000 9000000000"),
        ));
        all.push((
            "vtk-mesh",
            "m.vtk",
            replaced(vtk(&small(), text, false), "CELLS 3 17", "CELLS 2000000000 9000000000"),
        ));
        all.push(("vtk-mesh", "m.vtk", replaced(vtk(&small(), text, false), "POINTS 8", "POINTS 2000000000")));
    }
    for encoding in ["ascii", "binary_big_endian"] {
        all.push(("ply", "m.ply", replaced(ply(encoding), "vertex 4", "vertex 2000000000")));
        all.push(("ply", "m.ply", replaced(ply(encoding), "face 3", "face 2000000000")));
        all.push(("ply", "m.ply", replaced(ply(encoding), "edge 1\nproperty int vertex1\n", "edge 2000000000\n")));
    }
    let mut stl = stl_binary(&tetrahedron(), "x");
    stl[80..84].copy_from_slice(&2_000_000_000u32.to_le_bytes());
    all.push(("stl", "m.stl", stl));
    let mut plot3d = 1_200i32.to_le_bytes().repeat(3);
    plot3d.extend([0; 1000]);
    all.push(("plot3d", "m.xyz", plot3d));
    for dimension in ["num_nodes\0\0\0", "num_el_in_blk1\0\0", "num_el_blk\0\0"] {
        let mut file = include_bytes!("fixtures/mesh_classic.exo").to_vec();
        let at = file.windows(dimension.len()).position(|w| w == dimension.as_bytes()).unwrap() + dimension.len();
        file[at..at + 4].copy_from_slice(&2_000_000_000u32.to_be_bytes());
        all.push(("exodus", "m.exo", file));
    }
    all.push(("obj", "m.obj", OBJ.replace("f 1 2 5", "f 1 2 2000000000").into_bytes()));
    all
}

#[test]
fn small_files_take_little_memory_whatever_they_say() {
    const MIB: usize = 1 << 20;
    let zeros = vec![0; 64 * MIB];
    let nrrd = |sizes: &str, encoding: &str, data: &[u8]| {
        let header = format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: {sizes}\nencoding: {encoding}\n\n");
        samples::join(&header, data)
    };
    let mut nifti = samples::nifti1(64, 64, b"n+1\0", false);
    nifti[42..48].copy_from_slice(&[0xff, 0x7f, 0xff, 0x7f, 0xff, 0x7f]);
    let refused = [
        ("nrrd", "v.nrrd", nrrd("1048576 1048576 65536", "raw", &[0; 99])),
        ("nrrd", "v.nrrd", nrrd("1048576 1048576 65536", "gzip", &[0; 99])),
        ("nrrd", "v.nrrd", nrrd("65536 65536 1024", "bzip2", &[0; 99])),
        ("nrrd", "v.nrrd", nrrd("65536 65536 1024", "ascii", &[b'1'; 99])),
        // As many as 200 kB of gzip could hold, but what it holds is not gzip.
        ("nrrd", "v.nrrd", nrrd("1000 1000 200", "gzip", &[0; 200_000])),
        ("nrrd", "v.nrrd", nrrd("1000 1000 40", "bzip2", b"BZh91AY&SY and nothing more")),
        ("nifti", "v.nii", nifti.clone()),
        ("nifti", "v.nii.gz", samples::gzip(&nifti)),
        ("tiff", "v.tif", samples::tiff_plain(&[vec![0; 20]], 1 << 20, 1 << 20, 8, 1)),
        (
            "vti",
            "v.vti",
            samples::vti_text(
                "compressor=\"vtkZLibDataCompressor\"",
                "type=\"UInt8\" format=\"binary\">////f////38AAAAA////fw==</DataArray>",
                "</VTKFile>",
            )
            .replace("2 6 0 3 0 2", "0 65535 0 65535 0 1023")
            .into_bytes(),
        ),
    ];
    for (loader, path, bytes) in refused {
        let what = format!("{loader} of {} bytes", bytes.len());
        let (peak, accepted) = peak(loader, path, bytes);
        assert!(!accepted, "{what}");
        // The tables of a bzip2 decoder alone take 4 MiB.
        assert!(peak < 6 * MIB, "{what} took {peak} bytes");
    }
    for (loader, path, bytes) in huge_meshes() {
        let what = format!("{loader} of {} bytes", bytes.len());
        let (peak, accepted) = mesh_peak(loader, path, bytes);
        assert!(!accepted, "{what}");
        assert!(peak < MIB, "{what} took {peak} bytes");
    }
    // Bombs: 64 MiB of zeros in a few kB, of which the header wants 60 bytes.
    for (encoding, data) in [("gzip", samples::gzip(&zeros)), ("bzip2", samples::bzip2(&zeros))] {
        assert!(data.len() < 100_000);
        let (peak, accepted) = peak("nrrd", "v.nrrd", nrrd("5 4 3", encoding, &data));
        assert!(accepted, "{encoding}");
        // bzip2's own tables take up to 8 MiB.
        assert!(peak < 8 * MIB, "{encoding} took {peak} bytes");
    }
}
