//! Bulk data cross without a copy: every large allocation of this program is counted.
//!
//! The plugins are in C and have their memory from elsewhere, so that what is counted is the host's.

mod common;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    fs,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

use volact_plugin::{
    Appearance, Camera, FrameDesc, Mesh, Options, Registry, Shape,
    glam::DVec3,
    parameter::{ParameterMap, ParameterValue},
};

/// What counts as bulk: more than anything else of these tests takes.
const BULK: usize = 1 << 20;

static LARGE: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: all is the system allocator's; counting touches no memory of it.
#[expect(unsafe_code, reason = "counts what the system's allocator is asked for")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if layout.size() >= BULK {
            LARGE.fetch_add(1, Ordering::Relaxed);
        }
        // SAFETY: as promised by the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as promised by the caller.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The counter is the program's: one test at a time.
static ONE: Mutex<()> = Mutex::new(());

/// How often `run` takes a megabyte or more.
fn large<T>(run: impl FnOnce() -> T) -> (usize, T) {
    let before = LARGE.load(Ordering::Relaxed);
    let made = run();
    (LARGE.load(Ordering::Relaxed) - before, made)
}

#[test]
fn the_counter_counts() {
    let _one = ONE.lock().unwrap();
    assert_eq!(large(|| vec![1u8; BULK]).0, 1);
    assert_eq!(large(|| vec![1u8; BULK / 2]).0, 0);
}

#[test]
fn voxels_and_frames_are_not_copied() {
    let _one = ONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(folder.path(), "kit.c", "kit", &[]);
    let mut registry = Registry::with_core();
    common::load(folder.path(), "kit", &mut registry).unwrap();
    let path = folder.path().join("data.any");
    let voxels = vec![7u8; 160 * 160 * 160];
    fs::write(&path, [b"RAMP 160 160 160\n", &voxels[..]].concat()).unwrap();
    drop(voxels);
    let (count, volume) = large(|| registry.load(&path).unwrap());
    assert_eq!((count, volume.data().len()), (0, 4_096_000), "four megabytes are read by the plugin and shared");
    let shape = Shape::around(&volume, Appearance::new("mip"));
    let mut action = registry.action("zmax", &Options::new()).unwrap();
    let middle = DVec3::new(79.5, 79.5, 0.0);
    let camera = Camera::orthographic(middle + DVec3::Z * 500.0, middle, DVec3::Y, 200.0);
    let desc = FrameDesc::new(camera, 600, 600);
    for _ in 0..2 {
        let (count, ()) = large(|| {
            action.manage(&shape).unwrap();
            action.begin_draw(&desc).unwrap();
            action.draw(&shape).unwrap();
        });
        assert_eq!(count, 0, "voxels go to the action as they are");
        let (count, frame) = large(|| action.end_draw().unwrap());
        assert_eq!((count, frame.color.len()), (2, 360_000), "the frame's own colours and depths, and nothing else");
    }
}

#[test]
fn vertices_and_cells_are_not_copied() {
    let _one = ONE.lock().unwrap();
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(folder.path(), "codes.c", "codes", &["-pthread"]);
    let mut registry = Registry::with_core();
    common::load(folder.path(), "codes", &mut registry).unwrap();
    let parameters = ParameterMap::from([("n".to_owned(), ParameterValue::Int(300))]);
    let (count, geometry) = large(|| registry.geometry("sheet", &parameters).unwrap());
    let mesh = geometry.as_any().downcast_ref::<Mesh>().unwrap();
    assert_eq!((count, mesh.points().len(), mesh.cell_count()), (0, 180_000, 89_401));
    assert!(mesh.points().data().len() > 4 * BULK && mesh.connectivity().len() > 2 * BULK);
}
