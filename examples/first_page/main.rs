//! The first page: loads a volume, draws it with a table, saves a picture.
//!
//! `cargo run --release --example first_page -- head.nrrd head.png`

use std::{env, error::Error, process::ExitCode};

use volact::prelude::*;

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [input, output] = arguments.as_slice() else {
        eprintln!("usage: first_page VOLUME PICTURE");
        return ExitCode::from(2);
    };
    match draw(input, output) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn draw(input: &str, output: &str) -> Result<(), Box<dyn Error>> {
    let registry = Registry::with_builtins();
    let volume = registry.load(input)?;
    // A grey ramp over all the values that there are.
    let [low, high] = volume.value_range().unwrap_or([0.0, 1.0]);
    let table = LookupTable::window_level((high - low).max(f64::MIN_POSITIVE), (low + high) / 2.0, 0.1)?;
    let shape = Shape::around(&volume, Appearance::new("lut").with("lookup_table", table));
    let mut action = registry.action("cpu", &Options::default())?;
    action.manage(&shape)?;
    action.begin_draw(&FrameDesc::fit(&shape, View::Front, 512, 512))?;
    action.draw(&shape)?;
    action.end_draw()?.save(output)?;
    Ok(())
}
