//! What a frame says of how it was made, read: on which lattice, and how precisely.
//!
//! These words of [`Method`] are what an action is held to:
//!
//! | field | words | means |
//! |---|---|---|
//! | `sampling` | `ray casting`, `shells` | segments along each ray |
//! | | `planes` | segments along the view axis, that carry 1/cosθ |
//! | | `cell by cell`, `nearest triangle`, none of the above | no lattice: the integral itself |
//! | `classification` | `pre-integrated`, `over segments` | linear between the ends of each segment |
//! | | anything else | the value in its middle |
//! | `table_width` | N | the table is N nodes, on its control points, linear between |
//! | `filter` | `f64` | f64 throughout |
//! | | `exact` | f32 with weights of f32 |
//! | | `N-bit`, `hardware` | weights of N fractional bits, 8 of hardware |
//! | `blend` | `f64`, `f32`, `f16`, `8-bit` | precision of what is accumulated |
//!
//! Planes along an axis of the data, and lattices of objects or primitives, say `axis-aligned`,
//! `object` or `primitive`: the reference cannot repeat them.

use volact_core::Method;
use volact_cpu::reference;

/// Where the samples of a frame lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lattice {
    /// Nowhere: the frame is the integral itself.
    Exact,
    /// Along each ray.
    Rays {
        /// World distance of samples.
        step: f64,
        /// Linear between the ends of each segment.
        segments: bool,
    },
    /// On planes along the view axis.
    Planes {
        /// World distance of planes.
        step: f64,
        /// Linear between the ends of each segment.
        segments: bool,
    },
}

impl Lattice {
    /// Reads what a frame says.
    ///
    /// # Errors
    /// If the suite cannot repeat it, in words.
    pub fn of(method: &Method) -> Result<Self, String> {
        let sampling = method.sampling.as_str();
        let has = |word: &str| sampling.contains(word);
        if let Some(word) = ["axis-aligned", "object", "primitive"].into_iter().find(|w| has(w)) {
            return Err(format!("the frame is sampled {sampling:?}, and the reference has no {word} lattice"));
        }
        let step = method.sample_distance;
        let segments = ["pre-integrated", "over segments"].iter().any(|w| method.classification.contains(w));
        let lattice = if has("planes") {
            Self::Planes { step, segments }
        } else if has("ray casting") || has("shells") {
            Self::Rays { step, segments }
        } else if has("cell by cell") || has("nearest triangle") {
            return Ok(Self::Exact);
        } else {
            return Err(format!(
                "the frame's method says sampling {sampling:?}, wanted ray casting, planes, shells, cell by cell or \
                 nearest triangle"
            ));
        };
        if step > 0.0 && step.is_finite() {
            Ok(lattice)
        } else {
            Err(format!("the frame's method says sampling {sampling:?} with a sample_distance of {step}"))
        }
    }

    /// World distance between samples, where there is a lattice.
    pub fn step(self) -> Option<f64> {
        match self {
            Self::Exact => None,
            Self::Rays { step, .. } | Self::Planes { step, .. } => Some(step),
        }
    }

    /// The reference's options that repeat it.
    pub fn options(self) -> reference::ReferenceOptions {
        use reference::{Classification, Method};
        let (method, segments) = match self {
            Self::Exact => (Method::Exact, false),
            Self::Rays { segments, .. } => (Method::Rays, segments),
            Self::Planes { segments, .. } => (Method::Planes, segments),
        };
        reference::ReferenceOptions {
            method,
            classification: if segments { Classification::PreIntegrated } else { Classification::Post },
            sample_distance: self.step().unwrap_or(0.0),
            threads: 0,
            ..Default::default()
        }
    }

    /// In words.
    pub fn name(self) -> String {
        let how = |segments| if segments { ", pre-integrated" } else { "" };
        match self {
            Self::Exact => "reference, the certified integral".into(),
            Self::Rays { step, segments } => format!("reference on rays, step {step}{}", how(segments)),
            Self::Planes { step, segments } => format!("reference on planes, step {step}{}", how(segments)),
        }
    }
}

/// How precisely a frame was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// Half a unit in the last place of positions and values: a relative error.
    pub arithmetic: f64,
    /// Error of an interpolation weight.
    pub weight: f64,
    /// Half a step of what is accumulated, absolute for fixed point and relative for floats.
    pub blend: f64,
    /// Whether the blend's step is one of fixed point.
    pub fixed: bool,
    /// Transmittance below which rays end.
    pub termination: f64,
}

/// Half a unit in the last place of f32, relative.
pub const F32: f64 = 1.0 / 16_777_216.0;

impl Precision {
    /// Reads what a frame says.
    pub fn of(method: &Method) -> Self {
        let double = method.filter.contains("f64");
        let arithmetic = if double { f64::EPSILON } else { F32 };
        let bits = bits(&method.filter).or(method.filter.contains("hardware").then_some(8));
        let (blend, fixed) = match method.blend.as_str() {
            b if b.contains("f64") => (f64::EPSILON, false),
            b if b.contains("f16") => (1.0 / 2048.0, false),
            b if bits_of_blend(b).is_some() => (0.5 / (2f64.powi(bits_of_blend(b).unwrap_or(8)) - 1.0), true),
            _ => (F32, false),
        };
        Self {
            arithmetic,
            weight: bits.map_or(arithmetic, |b| 0.5f64.powi(b + 1)),
            blend,
            fixed,
            termination: method.termination,
        }
    }
}

fn bits_of_blend(blend: &str) -> Option<i32> {
    bits(blend)
}

/// The number before `-bit` in a text.
fn bits(text: &str) -> Option<i32> {
    let end = text.find("-bit")?;
    let start = text[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + 1);
    text[start..end].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn method(sampling: &str, classification: &str, step: f64) -> Method {
        Method {
            sampling: sampling.into(),
            classification: classification.into(),
            sample_distance: step,
            ..Method::default()
        }
    }

    #[test]
    fn words_of_the_actions_are_read() {
        let of = |s, c, h| Lattice::of(&method(s, c, h));
        let rays = |segments| Ok(Lattice::Rays { step: 0.5, segments });
        assert_eq!(of("ray casting, midpoint lattice, nearest triangle", "post-interpolated", 0.5), rays(false));
        assert_eq!(of("ray casting", "pre-integrated", 0.5), rays(true));
        assert_eq!(of("slicing, spherical shells", "post-interpolated", 0.5), rays(false));
        assert_eq!(of("view-aligned planes", "", 2.0), Ok(Lattice::Planes { step: 2.0, segments: false }));
        assert_eq!(of("cell by cell", "exact", 0.0), Ok(Lattice::Exact));
        assert!(of("ray casting", "", 0.0).is_err());
        assert!(of("axis-aligned planes", "", 1.0).is_err());
        assert!(of("magic", "", 1.0).unwrap_err().contains("magic"));
    }

    #[test]
    fn precision_is_read() {
        let of = |filter: &str, blend: &str| {
            Precision::of(&Method { filter: filter.into(), blend: blend.into(), ..Method::default() })
        };
        assert_eq!(of("f32, exact weights", "f32").weight, F32);
        assert_eq!(of("hardware", "f32").weight, 1.0 / 512.0);
        assert_eq!(of("hardware, 6-bit weights", "f32").weight, 1.0 / 128.0);
        assert_eq!(of("f64, exact", "f64").blend, f64::EPSILON);
        assert!((of("f32", "8-bit").blend - 0.5 / 255.0).abs() < 1e-15 && of("f32", "8-bit").fixed);
    }
}
