//! What is timed where actions on GPUs are compared with themselves: one volume, seen in three ways.

use std::time::Instant;

use volact_core::{
    ActionError, ControlPoint, Frame, FrameDesc, LookupTable, RenderAction, ScalarType, Shape, Volume, VolumeDesc,
    glam::DVec3, table::TableError, volume::VolumeError,
};

/// What makes scenes differ: how much of a volume is seen.
pub const SCENES: [&str; 3] = ["haze", "shells", "solid"];

/// Shells around the middle, waved, 8 bits: `size`³ samples.
///
/// # Errors
/// If the size is one that no volume has.
pub fn volume(size: usize) -> Result<Volume, VolumeError> {
    let value = |i: usize| {
        let at = [i % size, i / size % size, i / size / size].map(|v| v as f64 / (size - 1) as f64 - 0.5);
        let p = DVec3::from_array(at);
        let waves = 0.05 * ((20.0 * p.x).sin() * (17.0 * p.y).cos() + (23.0 * p.z).sin());
        (255.0 * (1.0 - 1.6 * p.length() + waves)).clamp(0.0, 255.0) as u8
    };
    let bytes: Vec<u8> = (0..size * size * size).map(value).collect();
    Volume::new(VolumeDesc::new([size; 3], ScalarType::U8, 1), bytes)
}

/// The table of a scene.
///
/// # Errors
/// None: its points are in order.
pub fn table(scene: &str) -> Result<LookupTable, TableError> {
    let point = |value: f64, opacity: f64| ControlPoint { value, color: [value / 255.0, 0.5, 0.2], opacity };
    let points = match scene {
        "haze" => vec![point(0.0, 0.0005), point(255.0, 0.004)],
        "shells" => vec![point(150.0, 0.0), point(155.0, 0.02), point(160.0, 0.0), point(254.0, 0.0)],
        _ => vec![point(120.0, 0.0), point(130.0, 0.9), point(255.0, 0.9)],
    };
    LookupTable::from_points(points)
}

/// A frame, and the milliseconds that it took.
///
/// # Errors
/// Those of the action.
pub fn draw(action: &mut dyn RenderAction, shape: &Shape, desc: &FrameDesc) -> Result<(Frame, f64), ActionError> {
    let start = Instant::now();
    action.manage(shape)?;
    action.begin_draw(desc)?;
    action.draw(shape)?;
    let frame = action.end_draw()?;
    Ok((frame, start.elapsed().as_secs_f64() * 1e3))
}
