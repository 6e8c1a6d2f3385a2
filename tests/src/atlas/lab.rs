//! Where ladders are climbed: actions of a registry, and truth.

use std::{
    collections::HashMap,
    sync::{Mutex, PoisonError},
};

use volact_core::{Frame, Registry, RenderAction, Severity, registry::RegisterError};

use super::{Measured, Missing};
use crate::{
    metrics::{Picture, max_error, wide},
    rig::{Scene, Setup, draw, truth},
    runner::Suite,
    truth::chain,
};

/// Actions that need a device. Making one, and its first frame, take seconds: one is kept for each setting.
const ON_DEVICES: [&str; 2] = ["wgpu", "vulkan"];

/// An action, or why there is none.
type Kept = Result<Box<dyn RenderAction>, String>;

/// A registry, and actions that are kept.
pub struct Lab {
    registry: Registry,
    kept: Mutex<HashMap<String, Kept>>,
}

impl Lab {
    /// Actions as a registry makes them, with the shaders that come with Volact.
    ///
    /// # Errors
    /// If one of these is named as another is.
    pub fn new(registry: &Registry) -> Result<Self, RegisterError> {
        Ok(Self { registry: Suite::new(registry)?.registry().clone(), kept: Mutex::default() })
    }

    /// The registry.
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// A frame by a fresh action; by the one kept, where it needs a device.
    ///
    /// # Errors
    /// If there is no device, or the action refuses.
    pub fn frame(&self, how: &Setup, scene: &Scene) -> Result<Frame, Missing> {
        let refused = |e: &dyn std::error::Error| Missing::Refused(chain(e));
        if ON_DEVICES.contains(&how.name()) {
            return self.on_device(how, scene);
        }
        let mut action = self.registry.action(how.name(), how.options()).map_err(|e| refused(&e))?;
        draw(&mut *action, &scene.shapes, &scene.desc).map_err(|e| refused(&e))
    }

    fn on_device(&self, how: &Setup, scene: &Scene) -> Result<Frame, Missing> {
        let mut options = how.options().clone();
        let step = options.remove("sample_distance");
        let key = format!("{} {options:?} {}", how.name(), step.is_some());
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let make = || self.registry.action(how.name(), &options).map_err(|e| chain(&e));
        let action = kept.entry(key).or_insert_with(make);
        let action = action.as_mut().map_err(|why| Missing::Skipped(why.clone()))?;
        let refused = |e: &dyn std::error::Error| Missing::Refused(chain(e));
        if let Some(step) = step {
            action.set_option("sample_distance", step).map_err(|e| refused(&e))?;
        }
        let drawn = draw(&mut **action, &scene.shapes, &scene.desc).map_err(|e| refused(&e));
        for shape in &scene.shapes {
            // What failed to be managed is not there.
            _ = action.unmanage(shape);
        }
        drawn
    }

    /// The largest difference of any channel of any pixel from a true picture.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn error(&self, how: &Setup, scene: &Scene, truth: &[[f64; 4]]) -> Measured {
        Ok(max_error(&wide(&self.frame(how, scene)?), truth))
    }

    /// The difference from the certified integral.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame); also if the truth is not known to 1e-6.
    pub fn from_truth(&self, how: &Setup, scene: &Scene) -> Measured {
        self.error(how, scene, &certified(scene)?)
    }
}

/// The certified integral, known to 1e-6 in every channel.
///
/// # Errors
/// If it is not.
pub fn certified(scene: &Scene) -> Result<Picture, Missing> {
    let picture = truth(&scene.shapes, &scene.desc);
    if picture.widest > 1e-6 {
        return Err(Missing::Refused(format!("the truth is known to {:.1e} only", picture.widest)));
    }
    Ok(picture.color)
}

/// By how much the one channel that a closed form gives is off, as a part of it.
pub fn relative(found: f64, wanted: f64) -> f64 {
    if wanted == 0.0 { found.abs() } else { (found / wanted - 1.0).abs() }
}

/// Leaves out what a device has too little room for, which others may have.
///
/// # Errors
/// Those that were there.
pub fn limited(found: Measured) -> Measured {
    match found {
        Err(Missing::Refused(why)) if why.contains("on adapter") => Err(Missing::Skipped(why)),
        other => other,
    }
}

/// A check as a result.
///
/// # Errors
/// The words, if it does not hold.
pub fn ensure(holds: bool, words: impl Into<String>) -> Result<(), String> {
    if holds { Ok(()) } else { Err(words.into()) }
}

/// What a refusal says.
///
/// # Errors
/// If there was none, or without one of these words.
pub fn refused_with<T>(found: Result<T, Missing>, words: &[&str]) -> Result<(), String> {
    match found {
        Err(Missing::Refused(why)) => {
            ensure(words.iter().all(|w| why.contains(w)), format!("{why:?}, wanted words {words:?}"))
        }
        Err(Missing::Skipped(_)) => Ok(()),
        Ok(_) => Err(format!("drawn, wanted an error with {words:?}")),
    }
}

/// What is wrong and comes without a warning: once it comes with one, the atlas is to say so.
///
/// # Errors
/// If there is a warning, or no picture where something is there to draw it.
pub fn unwarned(found: Result<Frame, Missing>) -> Result<(), String> {
    match found {
        Ok(frame) => {
            let warned = frame.warnings.iter().any(|w| w.severity == Severity::Warning);
            ensure(!warned, format!("it is warned of: {:?}", frame.warnings))
        }
        Err(Missing::Skipped(_)) => Ok(()),
        Err(Missing::Refused(why)) => Err(why),
    }
}
