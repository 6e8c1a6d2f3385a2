//! Plugins that are broken, each in its own way: one clear error, and a host that goes on.

mod common;

use std::{fs, path::Path};

use volact_plugin::{
    Appearance, FrameDesc, LoadOptions, Options, Registry, ScalarType, Shape, View, Volume, VolumeDesc,
    loader::NoProgress,
    parameter::{Kind, ParameterMap},
    plugin::{
        Code, PluginError,
        host::{Search, Wanted, sha256_of},
    },
};

/// What a plugin that is broken from the start is refused with.
fn refusal(folder: &Path, case: u32) -> PluginError {
    let name = format!("broken{case}");
    let flags = [
        format!("-DCASE={case}"),
        format!("-DNAME={name}"),
        "-Wno-unused-variable".into(),
        "-Wno-unused-function".into(),
    ];
    common::c_plugin(folder, "broken.c", &name, &flags.each_ref().map(String::as_str));
    let mut registry = Registry::with_core();
    let before = format!("{registry:?}");
    let error = common::load(folder, &name, &mut registry).unwrap_err();
    assert_eq!(format!("{registry:?}"), before, "case {case} left something behind");
    assert_eq!(error.plugin, name);
    error
}

#[test]
fn broken_tables_are_refused_with_one_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(u32, Code, &str); 28] = [
        (1, Code::BadValue, "wanted the symbol volact_plugin_broken1"),
        (2, Code::BadVersion, "speaks version 0.9 of the boundary, wanted 1.0"),
        (3, Code::BadVersion, "speaks version 2.1 of the boundary, wanted 1.0"),
        (4, Code::BadVersion, "table of the plugin is 40 bytes, wanted at least"),
        (5, Code::BadVersion, "table of an action is 64 bytes, wanted at least"),
        (6, Code::BadValue, "function create of action \"act\" is null, wanted a function"),
        (7, Code::BadName, "name of the plugin is \"\\xff\\xfe\", wanted UTF-8"),
        (8, Code::BadName, "geometry \"lump\": name of a parameter is \"si\\xc3\", wanted UTF-8"),
        (9, Code::BadValue, "table of the plugin is a null pointer"),
        (10, Code::BadValue, "tables of kind geometry is a null pointer, wanted 1 of them"),
        (11, Code::BadName, "calls itself \"somebody\", wanted the name of its library"),
        (12, Code::BadName, "geometry name is \"Lump!\", wanted lower-case letters"),
        (13, Code::Unknown(-5), "of a kind of its own"),
        (14, Code::OutOfMemory, "no memory for tables"),
        (15, Code::BadValue, "whether parameter \"size\" is required is 7, wanted 0 or 1"),
        (16, Code::BadValue, "function make of geometry \"lump\" is null"),
        (17, Code::BadValue, "function open of loader \"load\" is null"),
        (18, Code::BadName, "source of shader \"shine\" is \"\\xc0\", wanted UTF-8"),
        (19, Code::Unsupported, "way of compositing is code 99, wanted 1 to 6"),
        (20, Code::BadValue, "number of tables of kind geometry is 18446744073709551615"),
        (21, Code::BadValue, "table 0 of kind geometry is null or odd"),
        (22, Code::BadValue, "name of the plugin is a null pointer, wanted 4 bytes"),
        (23, Code::BadValue, "length of name of the plugin is 18446744073709551615"),
        (24, Code::Failed, "an error without a message"),
        (25, Code::BadValue, "number of declared parameters is 2000000"),
        (26, Code::Unsupported, "kinds of parameter \"size\" are 0x0"),
        (27, Code::Unsupported, "content of loader \"load\" is 9"),
        (28, Code::BadName, "name of a registered geometry is empty"),
    ];
    for (case, code, wanted) in cases {
        let error = refusal(folder.path(), case);
        assert!(error.message.contains(wanted), "case {case}: {error}");
        assert_eq!(error.code, code, "case {case}: {error}");
    }
    assert!(refusal(folder.path(), 29).message.contains("an aligned one"));
}

/// Tables in which all is there but one function, and, to begin with, in which all is.
#[test]
fn each_function_that_is_null_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let load = |case: u32, empty: Option<&str>| {
        let name = format!("empty{case}{}", empty.unwrap_or_default());
        let mut flags = vec![format!("-DCASE={case}"), format!("-DNAME={name}"), "-Wno-unused-variable".into()];
        flags.extend(empty.map(|function| format!("-DEMPTY={function}")));
        flags.push("-Wno-unused-function".into());
        common::c_plugin(folder.path(), "broken.c", &name, &flags.iter().map(String::as_str).collect::<Vec<_>>());
        let mut registry = Registry::with_core();
        common::load(folder.path(), &name, &mut registry)
    };
    let tables: [(u32, &str, &[&str]); 3] = [
        (40, "action \"act\"", &["create", "destroy", "caps", "begin_draw", "draw", "end_draw"]),
        (41, "loader \"load\"", &["probe", "open", "read_region", "close"]),
        (42, "loader \"load\"", &["probe", "read_mesh"]),
    ];
    for (case, of, functions) in tables {
        // What may be null is null here: `manage`, `unmanage`, `set_option`, `read_all`, `warnings`.
        // The table and, as in all of them, a geometry.
        assert_eq!(load(case, None).unwrap().registered.len(), 2, "case {case}");
        for function in functions {
            let error = load(case, Some(function)).unwrap_err();
            let wanted = format!("function {function} of {of} is null, wanted a function");
            assert_eq!((error.code, error.message), (Code::BadValue, wanted));
        }
    }
}

#[test]
fn what_is_no_library_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(volact_plugin::plugin::host::file_name(name));
    fs::write(place("text"), "not a library at all").unwrap();
    fs::write(place("empty"), "").unwrap();
    fs::create_dir(place("folder")).unwrap();
    for (name, wanted) in [
        ("text", "cannot be loaded"),
        ("empty", "cannot be loaded"),
        ("folder", "is a folder, wanted a library"),
        ("absent", "is in none of the folders"),
        ("../text", "wanted up to 64 letters"),
    ] {
        let error = common::load(folder.path(), name, &mut Registry::new()).unwrap_err();
        assert!(error.message.contains(wanted), "{error}");
    }
}

#[test]
fn pinned_hash_decides() {
    let folder = tempfile::tempdir().unwrap();
    let library = common::c_plugin(folder.path(), "kit.c", "kit", &[]);
    let output = std::process::Command::new("sha256sum").arg(&library).output();
    let Ok(output) = output else {
        println!("skipped: this system has no sha256sum");
        return;
    };
    let right = sha256_of(String::from_utf8(output.stdout).unwrap().split_whitespace().next().unwrap()).unwrap();
    let load = |sha256: [u8; 32]| {
        let wanted = vec![Wanted { name: "kit".into(), sha256: Some(sha256) }];
        let mut registry = Registry::with_core();
        let search = Search { folders: vec![folder.path().into()], wanted, ..Search::default() };
        common::load_all(&search, &mut registry).remove(0).map(|loaded| (loaded, registry))
    };
    let mut wrong = right;
    wrong[31] ^= 1;
    let error = load(wrong).unwrap_err();
    assert!(error.message.starts_with("SHA-256 of the library is ") && error.message.ends_with("as pinned"), "{error}");
    let (loaded, registry) = load(right).unwrap();
    assert_eq!(loaded.registered.len(), 4);
    let octa = registry.geometry("octa", &ParameterMap::from([("radius".into(), 1.0.into())])).unwrap();
    assert_eq!(octa.vertex_count(), Some(6));
    // A second pinned load does not take the first one's place.
    assert_eq!(load(right).unwrap().0.registered.len(), 4);
}

#[test]
fn a_name_claimed_twice_names_both_unless_the_config_says_which() {
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(folder.path(), "kit.c", "kit", &[]);
    common::c_plugin(folder.path(), "kit.c", "kat", &["-Dvolact_plugin_kit=volact_plugin_kat", "-DKIT_NAME=kat"]);
    let mut search = common::search(folder.path(), &["kit", "kat"]);
    let mut registry = Registry::with_core();
    let results = common::load_all(&search, &mut registry);
    assert!(results[0].is_ok());
    let error = results[1].as_ref().unwrap_err();
    // All of them at once, and the words that go into the config.
    let wanted = "action \"zmax\", shader \"tint\", geometry \"octa\", loader \"ramp\" are claimed by plugin \"kat\" \
                  and by plugin \"kit\"; say which in the config: \
                  names: {\"octa\": \"kat\", \"ramp\": \"kat\", \"tint\": \"kat\", \"zmax\": \"kat\"}";
    assert_eq!(error.message, wanted);

    let names = [("zmax", "kat"), ("tint", "kit"), ("octa", "kat"), ("ramp", "kit")];
    search.names = names.map(|(name, plugin)| (name.to_owned(), plugin.to_owned())).into();
    let mut registry = Registry::with_core();
    let results = common::load_all(&search, &mut registry);
    assert!(results.iter().all(Result::is_ok), "{results:?}");
    let origin = |kind, name| registry.origin(kind, name);
    assert_eq!((origin(Kind::Action, "zmax"), origin(Kind::Shader, "tint")), (Some("kat"), Some("kit")));
    assert_eq!(results[0].as_ref().unwrap().passed_over.len(), 2);
}

/// A crate `two-words` calls itself `two_words`; the config may write either.
#[test]
fn a_name_with_dashes_is_the_same_with_underscores() {
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(
        folder.path(),
        "kit.c",
        "two_words",
        &["-Dvolact_plugin_kit=volact_plugin_two_words", "-DKIT_NAME=two_words"],
    );
    common::c_plugin(folder.path(), "kit.c", "kit", &[]);
    for chosen in ["two-words", "two_words"] {
        let mut search = common::search(folder.path(), &["kit", chosen]);
        search.names = ["zmax", "tint", "octa", "ramp"].map(|name| (name.to_owned(), chosen.to_owned())).into();
        let mut registry = Registry::with_core();
        let results = common::load_all(&search, &mut registry);
        let counts = results.iter().map(|r| r.as_ref().unwrap()).map(|l| (l.registered.len(), l.passed_over.len()));
        assert_eq!(counts.collect::<Vec<_>>(), [(0, 4), (4, 0)]);
        assert_eq!(registry.origin(Kind::Action, "zmax"), Some("two_words"));
    }
}

fn faulty() -> (tempfile::TempDir, Registry) {
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(folder.path(), "faulty.c", "faulty", &[]);
    let mut registry = Registry::with_core();
    common::load(folder.path(), "faulty", &mut registry).unwrap();
    (folder, registry)
}

/// References of the plugin that the host still has.
#[expect(unsafe_code, reason = "reads a counter of the library")]
fn live(folder: &Path) -> i64 {
    use std::sync::atomic::{AtomicI64, Ordering};
    let path = fs::canonicalize(folder.join(volact_plugin::plugin::host::file_name("faulty"))).unwrap();
    // SAFETY: the library is loaded already, and the symbol is an integer that is written atomically.
    unsafe {
        let library = libloading::Library::new(path).unwrap();
        (**library.get::<*const AtomicI64>(b"faulty_live").unwrap()).load(Ordering::SeqCst)
    }
}

#[test]
fn faulty_geometries_are_errors_and_leak_nothing() {
    let (folder, registry) = faulty();
    let cases: [(i64, &str); 25] = [
        (1, "what make made is nothing, wanted a geometry with a kind"),
        (2, "no memory at all [out of memory]"),
        (3, "an error without a message [bad value]"),
        (4, "[unknown code -99]"),
        (5, "vertex index of cell 0 is 77, wanted below 4"),
        (6, "number of indices is 3, wanted 4"),
        (7, "data of vertices is a null pointer, wanted 96 bytes"),
        (8, "point 3 is"),
        (9, "shape of vertices is [18446744073709551615, 4], wanted a size that memory can hold"),
        (10, "kind of a geometry is 77, which nobody knows [unsupported]"),
        (11, "type of cells is 99, wanted 10, 12, 13 or 14"),
        (12, "kind of vertices is 1, wanted 32"),
        (13, "scalar type of vertices is code 99"),
        (14, "stride 1 of vertices is 32 bytes, wanted 24: numbers without gaps [unsupported]"),
        (15, "wanted an address that is a multiple of 8"),
        (16, "name of a geometry is \"\\xff\\xff\", wanted UTF-8"),
        (17, "function tessellate is null"),
        (18, "dimensions is [9, 0, 0], wanted at least 2 vertices an axis"),
        (19, "bounds is [5.0, 0.0, 0.0, 0.0, 0.0, 0.0], wanted finite corners"),
        (20, ""),
        (21, "vertex index of tetrahedron 0 is 77, wanted below 4"),
        (22, "volume of tetrahedron 0 is -"),
        (23, "no memory for a tetrahedron [out of memory]"),
        (24, "tetrahedra is odd, wanted four indices each"),
        (25, "vertices is left out, wanted an array"),
    ];
    for (mode, wanted) in cases {
        let made = registry.geometry("lump", &ParameterMap::from([("mode".into(), mode.into())]));
        let cut = made.and_then(|geometry| geometry.tessellate());
        match cut {
            Ok(cut) => assert!(wanted.is_empty() && cut.tetrahedra.len() == 1, "mode {mode}"),
            Err(error) => {
                let words = error.to_string();
                assert!(words.starts_with("plugin \"faulty\": ") && words.contains(wanted), "mode {mode}: {words}");
            }
        }
        // What comes with an error stays with whoever made it; a null array holds nothing.
        let kept = i64::from(mode == 23) * 2 + i64::from(mode == 25);
        assert_eq!(live(folder.path()), kept, "mode {mode}");
        reset(folder.path());
    }
}

#[expect(unsafe_code, reason = "writes a counter of the library")]
fn reset(folder: &Path) {
    use std::sync::atomic::{AtomicI64, Ordering};
    let path = fs::canonicalize(folder.join(volact_plugin::plugin::host::file_name("faulty"))).unwrap();
    // SAFETY: as in `live`.
    unsafe {
        let library = libloading::Library::new(path).unwrap();
        (**library.get::<*const AtomicI64>(b"faulty_live").unwrap()).store(0, Ordering::SeqCst);
    }
}

#[test]
fn faulty_loaders_are_errors() {
    let (folder, registry) = faulty();
    let path = folder.path().join("file");
    fs::write(&path, "F  and more").unwrap();
    let cases: [(i64, &str); 12] = [
        (0, ""),
        (1, "the disk is gone [input or output]"),
        (2, "scalar type of the voxels is code 42"),
        (3, "components is 9, wanted 1 to 4"),
        (4, "spacing is [1, -1, 1], wanted positive and finite"),
        (5, "wanted a size that memory can hold"),
        (6, "name of the volume is \"\\xff\", wanted UTF-8"),
        (7, "reader that open of loader \"fault\" made is null"),
        (11, "length of the voxels is 7 bytes, wanted 8 for [2, 2, 2] samples"),
        (12, "scalar type of the voxels is 2, wanted 1, as open said"),
        (13, "no memory for voxels [out of memory]"),
        (14, "scalar type of voxels is code 0"),
    ];
    for (mode, wanted) in cases {
        let options = LoadOptions::from([("mode".to_owned(), mode.into())]);
        match registry.load_with(&path, None, &options, &NoProgress) {
            Ok(volume) => assert_eq!((wanted, volume.data().bytes()), ("", &[1u8, 2, 3, 4, 5, 6, 7, 8][..])),
            Err(error) => {
                let cause = std::error::Error::source(&error).unwrap().to_string();
                assert!(cause.contains(wanted), "mode {mode}: {cause}");
            }
        }
    }
    fs::write(&path, "FX").unwrap();
    assert!(registry.load(&path).is_err(), "a confidence that is none counts as no");
}

#[test]
fn faulty_actions_are_errors_and_can_be_used_again() {
    let (_folder, registry) = faulty();
    let volume = Volume::new(VolumeDesc::new([2; 3], ScalarType::U8, 1), vec![0u8; 8]).unwrap();
    let shape = Shape::around(&volume, Appearance::new("mip"));
    let desc = FrameDesc::fit(&shape, View::Front, 4, 3);
    let cases: [(i64, &str); 11] = [
        (0, ""),
        (1, "no memory for an action [out of memory]"),
        (2, "what create of action \"act\" made is null"),
        (5, "no such frame [unsupported]"),
        (6, "not this one [failed]"),
        (7, "end_draw gave no picture"),
        (8, "the paint is dry [failed]"),
        (9, "shape of the colours is [4, 1, 1] of scalar type 8, wanted [4, 4, 3] of f32 [bad value]"),
        (10, "an error without a message [bad value]"),
        (11, "no figure is called \"nonsense\" [bad name]"),
        (3, ""),
    ];
    for (mode, wanted) in cases {
        let made = registry.action("act", &Options::from([("mode".into(), mode.into())]));
        let drawn = made.and_then(|mut action| {
            action.manage(&shape)?;
            let mut last = None;
            // Twice, since an action is usable after an error.
            for _ in 0..2 {
                let begun = action.begin_draw(&desc);
                let drawn = begun.and_then(|()| {
                    let drawn = action.draw(&shape);
                    action.end_draw().and_then(|frame| drawn.map(|()| frame))
                });
                last = Some(drawn);
            }
            if mode == 3 {
                // A bool that is none: nothing is promised.
                assert_eq!(action.caps(), volact_plugin::Caps::default());
            }
            last.unwrap()
        });
        match drawn {
            Ok(frame) => assert_eq!((wanted, frame.color.len()), ("", 12), "mode {mode}"),
            Err(error) => assert!(error.to_string().contains(wanted) && !wanted.is_empty(), "mode {mode}: {error}"),
        }
    }
}
