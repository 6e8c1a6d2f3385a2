#![no_main]

use libfuzzer_sys::fuzz_target;
use volact_core::{
    Registry,
    scene::{ParameterSpec, SceneFile},
};

fuzz_target!(|text: &str| {
    _ = SceneFile::parse_with(text, &Registry::with_core());
    _ = ParameterSpec::parse(text);
});
