//! The planner: ask for an error or a time, and get the cheapest settings that keep it.
//!
//! [`PlannedAction`] wraps one or more actions and is an action itself, `planned`. It reads what there is to
//! choose from the options that they declare ([`knobs`]), so that a stranger's plugin is planned for like a
//! built-in. For each frame it
//!
//! 1. draws a sparse picture, some hundred pixels of the same view, with the settings that it means to take, and
//!    one much finer, and takes their difference for the error ([`errors`]);
//! 2. takes a finer or coarser sample distance where that error asks for it, on a lattice of quarters of an
//!    octave and with hysteresis, so that pictures do not flicker between two settings ([`steps`]);
//! 3. draws, and says in [`Frame::plan`](crate::Frame) what it chose, what error it expects and whether that keeps
//!    the bound.
//!
//! Where the shapes are others than in the last frame, all candidates are looked at, and that one is taken that
//! is the fastest by the machine's [`rates`] at the distance that its errors allow.
//!
//! Errors are estimated, not proved: the sparse picture misses what lies between its pixels, and a largest error
//! is extrapolated from its tail. `docs/accuracy.md` says how often the bound was kept.

mod action;
mod actor;
mod calibrate;
pub mod errors;
pub mod knobs;
pub mod rates;
mod search;
pub mod steps;

pub use action::{PlannedAction, declaration};
pub use actor::Actor;
pub use calibrate::calibrate;
pub use rates::{Rate, Rates};

use std::{fmt, time::Duration};

use crate::Options;

/// A bound of a frame's error against the contract's integral, in numbers from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Of the largest difference of any channel of any pixel.
    MaxError(f64),
    /// Of the root of the mean square over all channels.
    Rmse(f64),
}

impl Bound {
    /// The number.
    pub fn value(self) -> f64 {
        match self {
            Self::MaxError(e) | Self::Rmse(e) => e,
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MaxError(e) => write!(f, "max_error {e:?}"),
            Self::Rmse(e) => write!(f, "rmse {e:?}"),
        }
    }
}

/// What is asked of frames: an error, a time, or both.
///
/// With an error, the cheapest settings that keep it. With a time, the least error within it. With both, a
/// picture within the time at once, and finer ones while nothing changes until the error is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Goals {
    /// The error.
    pub bound: Option<Bound>,
    /// The time of a frame.
    pub time: Option<Duration>,
}

/// What was chosen for a frame, and why.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// The action that draws.
    pub action: String,
    /// Its options.
    pub options: Options,
    /// Both in words.
    pub setting: String,
    /// The world distance of samples; `None` where the action has none to choose.
    pub step: Option<f64>,
    /// The largest error that is expected.
    pub max_error: f64,
    /// The root of the mean square that is expected.
    pub rmse: f64,
    /// The time that is expected of the drawing alone.
    pub seconds: f64,
    /// Whether goals are expected to be kept.
    pub kept: bool,
    /// Whether the next frame is a finer one if nothing changes: both an error and a time were asked for.
    pub refining: bool,
    /// All candidates, where they were looked at for this frame: setting, distance, error, seconds.
    pub considered: Vec<Considered>,
    /// How long planning took.
    pub planning: Duration,
    /// Pixels of the sparse picture.
    pub sparse: usize,
}

/// A candidate that was looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Considered {
    /// In words.
    pub setting: String,
    /// The distance that it would take.
    pub step: Option<f64>,
    /// The error that is expected there, of the kind that is bounded.
    pub error: f64,
    /// The time that is expected.
    pub seconds: f64,
    /// Why it cannot be taken, where it cannot.
    pub refused: Option<String>,
}

impl Considered {
    /// A candidate that cannot be taken.
    fn refused(setting: &str, why: &str) -> Self {
        Self { setting: setting.into(), step: None, error: f64::NAN, seconds: f64::NAN, refused: Some(why.into()) }
    }
}
