//! Measures how fast actions are on this machine.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use super::{Actor, Rate, Rates, knobs};
use crate::{
    ActionError, Appearance, Camera, ControlPoint, FrameDesc, LookupTable, Options, Registry, ScalarType, Shape, View,
    Volume, VolumeDesc, VolumeTexture,
};

/// Sides of the pictures, and steps in voxels, from few samples to many.
const FRAMES: [(usize, f64); 5] = [(64, 2.0), (96, 1.0), (160, 1.0), (256, 1.0), (256, 0.25)];

/// Frames of each, of which the fastest counts.
const TIMES: usize = 3;

/// A frame that takes longer than this is the last of its setting.
const LONG: Duration = Duration::from_millis(300);

/// Samples of the volume along each axis.
const SIDE: usize = 64;

/// Measures the rates of all settings that a planner chooses from, of actions by their names. An action that
/// cannot be made here, or does not count its samples, has none; `told` hears of each setting before it is measured.
///
/// # Errors
/// If an action fails to draw.
pub fn calibrate(registry: &Registry, names: &[String], mut told: impl FnMut(&str)) -> Result<Rates, ActionError> {
    let shape = scene();
    let mut rates = BTreeMap::new();
    for name in names {
        let action = match registry.action(name, &Options::new()) {
            Ok(action) => action,
            Err(e) => {
                log::info!("{name} is not calibrated: {e}");
                continue;
            }
        };
        let mut actor = Actor::new(name, action, Options::new());
        actor.manage(&shape)?;
        for choices in knobs::candidates(&actor.declaration, &Options::new()) {
            let setting = knobs::words(name, &choices);
            told(&setting);
            if let Some(rate) = measured(&mut actor, &choices, &shape)? {
                rates.insert(setting, rate);
            }
        }
    }
    Ok(Rates(rates))
}

fn measured(actor: &mut Actor, choices: &Options, shape: &Shape) -> Result<Option<Rate>, ActionError> {
    let mut frames = Vec::new();
    let bounds = shape.state().world_bounds();
    for (side, step) in FRAMES {
        let desc = FrameDesc::new(Camera::fit(&bounds, View::Iso, side, side), side, side);
        actor.apply(choices, Some(step))?;
        // The first makes what the step asks for.
        let shapes = std::slice::from_ref(shape);
        let samples = actor.draw(&desc, shapes)?.statistics.samples;
        let mut least = Duration::MAX;
        for _ in 0..TIMES {
            let started = Instant::now();
            actor.draw(&desc, shapes)?;
            least = least.min(started.elapsed());
            if least > LONG {
                break;
            }
        }
        if samples > 0 {
            frames.push((samples as f64, least.as_secs_f64()));
        }
        if least > LONG {
            break;
        }
    }
    Ok(Rate::fit(&frames))
}

/// A cloud without empty space: what a sample costs, not what skipping saves.
fn scene() -> Shape {
    let voxel = |i: usize| {
        let wave = |n: usize, length: f64| (n as f64 / length).sin();
        let (x, y, z) = (i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE);
        (128.0 + 90.0 * wave(x, 5.0) * wave(y, 7.0) * wave(z, 6.0) + 20.0 * wave(x + 2 * y + 3 * z, 2.5)) as u8
    };
    let voxels: Vec<u8> = (0..SIDE.pow(3)).map(voxel).collect();
    let desc = VolumeDesc::new([SIDE; 3], ScalarType::U8, 1);
    let volume = Volume::new(desc, voxels).expect("as many voxels as the sides say");
    let texture = VolumeTexture::new(&volume);
    let point = |value, color, opacity| ControlPoint { value, color, opacity };
    let points = [point(0.0, [0.9, 0.5, 0.2], 0.002), point(255.0, [0.3, 0.6, 1.0], 0.05)];
    let table = LookupTable::from_points(points).expect("points of a table, in order");
    let appearance =
        Appearance::new("lut").with("volume", texture.clone()).with("lookup_table", table).with("unit_distance", 1.0);
    Shape::around_texture(&texture, appearance)
}
