//! Libraries of the workspace's own plugins, and errors as the two sides of the boundary have them.

use std::{env, error::Error};

use volact_plugin::{
    Registry,
    plugin::host::{self, Search, Wanted},
};

/// Loads the library of a package that these tests depend on: it was built with them.
#[expect(unsafe_code, reason = "loading a library runs its code")]
pub fn load_library(package: &str, registry: &mut Registry) {
    let program = env::current_exe().unwrap();
    let wanted = vec![Wanted { name: package.into(), sha256: None }];
    let search = Search { folders: vec![program.parent().unwrap().to_owned()], wanted, ..Search::default() };
    // SAFETY: the library is a crate of this repository.
    let loaded = unsafe { host::load(&search, registry) }.remove(0).result.unwrap();
    assert!(loaded.path.is_some() && !loaded.registered.is_empty(), "{loaded:?}");
}

/// An error with its causes on one line.
pub fn words(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let next = inner.to_string();
        // A transparent error has its cause's words.
        if !text.ends_with(&next) {
            text = format!("{text}: {next}");
        }
        cause = inner.source();
    }
    text
}
