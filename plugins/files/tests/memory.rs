//! Memory is taken for what a file holds, not for what it says: every promise of a huge volume in
//! a small file, and every bomb, read under an allocator that counts.
//!
//! One test alone in this file, so that nobody else allocates meanwhile.

#![expect(unsafe_code, reason = "an allocator is unsafe to implement")]

mod samples;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    path::Path,
    sync::atomic::{AtomicUsize, Ordering::SeqCst},
};

use volact_core::loader::{LoadOptions, NoProgress};
use volact_files::{Storage, open_in};

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
    // Bombs: 64 MiB of zeros in a few kB, of which the header wants 60 bytes.
    for (encoding, data) in [("gzip", samples::gzip(&zeros)), ("bzip2", samples::bzip2(&zeros))] {
        assert!(data.len() < 100_000);
        let (peak, accepted) = peak("nrrd", "v.nrrd", nrrd("5 4 3", encoding, &data));
        assert!(accepted, "{encoding}");
        // bzip2's own tables take up to 8 MiB.
        assert!(peak < 8 * MIB, "{encoding} took {peak} bytes");
    }
}
