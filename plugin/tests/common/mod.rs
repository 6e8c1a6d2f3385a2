//! Libraries for tests: C with the system's compiler, Rust with cargo in a profile of its own.

#![expect(dead_code, reason = "each test file uses a part")]

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

use volact_plugin::{
    Registry,
    plugin::{
        PluginError,
        host::{self, Loaded, Search, Wanted, file_name},
    },
};

/// The repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A C source of `tests/plugins/c`.
pub fn source(name: &str) -> PathBuf {
    root().join("tests/plugins/c").join(name)
}

/// Compiles a C source into a shared library.
pub fn compile(source: &Path, library: &Path, flags: &[&str]) {
    let host = host_triple();
    let compiler = cc::Build::new().cargo_metadata(false).target(host).host(host).opt_level(1).get_compiler();
    let mut command = compiler.to_command();
    command.args(["-shared", "-fPIC", "-Wall", "-Wextra"]).args(flags);
    command.arg("-I").arg(root().join("plugin/include")).arg(source).arg("-o").arg(library).arg("-lm");
    let output = command.output().expect("the system's C compiler");
    assert!(output.status.success(), "{}:\n{}", source.display(), String::from_utf8_lossy(&output.stderr));
}

fn host_triple() -> &'static str {
    static TRIPLE: OnceLock<String> = OnceLock::new();
    TRIPLE.get_or_init(|| {
        let output = Command::new("rustc").arg("-vV").output().expect("rustc");
        let text = String::from_utf8(output.stdout).unwrap();
        text.lines().find_map(|line| line.strip_prefix("host: ")).unwrap().to_owned()
    })
}

/// Compiles a source of `tests/plugins/c` as the plugin `name` into `folder`.
pub fn c_plugin(folder: &Path, source_name: &str, name: &str, flags: &[&str]) -> PathBuf {
    let library = folder.join(file_name(name));
    compile(&source(source_name), &library, flags);
    library
}

/// The folder with the library of `tests/plugins/rust`, built once, in that crate's own profile.
pub fn rust_plugin() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let package = root().join("tests/plugins/rust");
        // The same versions as the workspace's, so that nothing is downloaded.
        fs::copy(root().join("Cargo.lock"), package.join("Cargo.lock")).unwrap();
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("plugins");
        let mut command = Command::new(env!("CARGO"));
        command.args(["build", "--quiet", "--manifest-path"]).arg(package.join("Cargo.toml"));
        command.arg("--target-dir").arg(&target).env_remove("RUSTFLAGS").env_remove("CARGO_TARGET_DIR");
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        target.join("debug")
    })
}

/// A search for some plugins in one folder.
pub fn search(folder: &Path, names: &[&str]) -> Search {
    let wanted = names.iter().map(|name| Wanted { name: (*name).into(), sha256: None }).collect();
    Search { folders: vec![folder.into()], wanted, ..Search::default() }
}

/// Loads one plugin into a registry.
pub fn load(folder: &Path, name: &str, registry: &mut Registry) -> Result<Loaded, PluginError> {
    load_all(&search(folder, &[name]), registry).remove(0)
}

/// Loads plugins into a registry.
#[expect(unsafe_code, reason = "loading a library runs its code")]
pub fn load_all(search: &Search, registry: &mut Registry) -> Vec<Result<Loaded, PluginError>> {
    // SAFETY: the libraries are those of these tests, and the broken ones are broken in ways that
    // the host must see.
    unsafe { host::load(search, registry) }.into_iter().map(|outcome| outcome.result).collect()
}
