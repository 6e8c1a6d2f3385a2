//! What a frame says about how it was made.

use volact_core::{Compositing, Method, ParameterValue, Warning, WarningCode, resolve::ResolvedShape};
use volact_shaders::gpu::action;

use crate::{
    device::Gpu,
    draw::Drawn,
    options::Settings,
    resources::{Held, Volumes},
};

/// How the shapes drawn were made into a picture.
pub fn method(drawn: &[&ResolvedShape], held: &Volumes, made: &Drawn, settings: &Settings, gpu: &Gpu) -> Method {
    let held: Vec<&Held> = all(drawn, held).map(|(_, held)| held).collect();
    let first = |s: &&ResolvedShape| s.compositing() == Compositing::First;
    let mut classification = Vec::new();
    if drawn.iter().any(|s| !first(s)) || drawn.is_empty() {
        classification.push("shader evaluated in the middle of segments");
    }
    if drawn.iter().any(first) {
        classification.push("crossings found by the shader's values");
    }
    let volumes = match made.planes {
        Some(_) => "planes along the view axis, midpoint lattice",
        None => "ray casting, midpoint lattice",
    };
    let hardware = settings.hardware && held.iter().any(|h| h.filterable);
    Method {
        sampling: action::sampling(drawn, volumes),
        sample_distance: made.step,
        classification: classification.join(", "),
        table_width: 0,
        texture_format: action::formats(held.iter().map(|h| h.encoding.name())),
        filter: if hardware { "hardware" } else { "f32, exact weights" }.into(),
        blend: "f32".into(),
        termination: settings.termination,
        device: gpu.description().into(),
    }
}

/// Settings asked for that could not be followed.
pub fn adjusted(drawn: &[&ResolvedShape], volumes: &Volumes, settings: &Settings) -> Vec<Warning> {
    let unfiltered = all(drawn, volumes).filter(|(_, held)| settings.hardware && !held.filterable);
    let warn = |(shape, _): (&ResolvedShape, _)| {
        let message = "the adapter's sampler does not interpolate single precision; the shader does, exactly";
        Warning::new(WarningCode::SettingAdjusted, &shape.name, message)
    };
    unfiltered.map(warn).collect()
}

fn all<'a>(
    drawn: &'a [&'a ResolvedShape],
    volumes: &'a Volumes,
) -> impl Iterator<Item = (&'a ResolvedShape, &'a Held)> {
    drawn.iter().flat_map(move |shape| {
        shape.parameters.values().filter_map(move |value| match value {
            ParameterValue::Volume(texture) => Some((*shape, volumes.get(texture.volume())?)),
            _ => None,
        })
    })
}
