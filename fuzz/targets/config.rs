#![no_main]

use libfuzzer_sys::fuzz_target;
use volact_core::config::Config;

fuzz_target!(|text: &str| {
    _ = Config::parse(text);
});
