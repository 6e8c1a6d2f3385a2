//! Draws a scene on whatever backend a config prefers: nothing here names one.
//!
//! `cargo run --release --example backend -- examples/backend/wgpu.ron examples/head/scene.ron head.png`

use std::{env, error::Error, path::Path, process::ExitCode};

use volact::{
    core::{config::Config, loader::NoProgress},
    prelude::*,
    scene::Scene,
    select,
};

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [config, scene, picture] = arguments.as_slice() else {
        eprintln!("usage: backend CONFIG SCENE PICTURE");
        return ExitCode::from(2);
    };
    let drawn = draw(config.as_ref(), scene.as_ref()).and_then(|frame| Ok((frame.save(picture)?, frame)));
    match drawn {
        Ok((_, frame)) => {
            println!("{} drew {picture} in {:.0?}", frame.method.device, frame.statistics.total);
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// The picture of a scene by the first action that a config prefers and that can draw it.
pub fn draw(config: &Path, scene: &Path) -> Result<Frame, Box<dyn Error>> {
    let config = Config::open(config)?;
    let registry = Registry::with_builtins();
    let scene = Scene::open(scene, &registry, &NoProgress)?;
    // The action that is chosen manages the shapes already.
    let mut chosen = select::select(&registry, &config, None, &Options::new(), &scene.shapes)?;
    for (name, why) in &chosen.refused {
        println!("{name} is not taken: {why}");
    }
    chosen.action.begin_draw(&scene.frame)?;
    scene.shapes.iter().try_for_each(|shape| chosen.action.draw(shape))?;
    Ok(chosen.action.end_draw()?)
}
