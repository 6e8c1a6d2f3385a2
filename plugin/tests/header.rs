//! The C header that is checked in is what the sources give, and compiles alone.

#[path = "../../xtask/src/header.rs"]
mod header;

#[path = "common/mod.rs"]
mod common;

use std::fs;

#[test]
fn header_is_current() {
    let path = common::root().join("plugin/include/volact.h");
    if std::env::var_os("VOLACT_WRITE_HEADER").is_some() {
        header::run().unwrap();
    }
    let (kept, made) = (fs::read_to_string(path).unwrap(), header::generate().unwrap());
    let differs = kept.lines().zip(made.lines()).find(|(a, b)| a != b);
    assert!(kept == made, "run `cargo xtask header`: {differs:?}");
}

#[test]
fn header_compiles_alone_in_c99() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("alone.c");
    fs::write(&source, "#include \"volact.h\"\nint32_t size(void) { return (int32_t)sizeof(VolactPlugin); }\n")
        .unwrap();
    common::compile(
        &source,
        &folder.path().join("alone.so"),
        &["-std=c99", "-pedantic", "-Werror", "-Wno-unused-function"],
    );
}
