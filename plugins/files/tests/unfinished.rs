//! A program that is told to end while it writes a picture leaves no part of one behind. In a
//! process of its own, since no picture can be written afterwards.

use std::{fs, thread, time::Duration};

use volact_core::{Camera, Frame, FrameDesc, glam::DVec3};
use volact_files::picture;

#[test]
fn pictures_under_way_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.exr");
    let camera = Camera::perspective(DVec3::ONE, DVec3::ZERO, DVec3::Z, 30.0);
    let frame = Frame::empty(&FrameDesc::new(camera, 2048, 2048));
    let names = || fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect::<Vec<_>>();
    let written = thread::scope(|scope| {
        let writer = scope.spawn(|| picture::save_exr(&path, &frame));
        while names().is_empty() && !writer.is_finished() {
            thread::sleep(Duration::from_millis(1));
        }
        picture::discard_unfinished();
        writer.join().unwrap()
    });
    // Where the writer was fast, the picture is there as a whole.
    assert_eq!(names().len(), usize::from(written.is_ok()), "{:?}", names());
    assert_eq!(path.exists(), written.is_ok());
    assert!(picture::save_exr(&path, &Frame::empty(&FrameDesc::new(camera, 2, 2))).is_err());
}
