//! How errors fall: drawn at several steps against the certified integral, or handed in by a case.

use volact_core::{Frame, ParameterValue};

use super::{How, Rig, Scene};
use crate::{
    case::Stop,
    method::Lattice,
    metrics::{rms_error, wide},
    study::{Expected, Study},
    truth::Change,
};

impl Rig<'_> {
    /// The error against the certified integral falls with the step as expected.
    ///
    /// # Errors
    /// If the steps cannot be drawn, or the action does not follow them or the classification (a skip).
    pub fn slope(
        &mut self,
        label: &str,
        scene: &Scene,
        how: &How,
        steps: &[f64],
        expected: Expected,
    ) -> Result<(), Stop> {
        self.steps_are_free()?;
        let truth = self.truth(label, scene, Lattice::Exact, &Change::default())?;
        let mut errors = Vec::new();
        for &step in steps {
            let frame = self.draw(scene, &how.clone().with("sample_distance", step))?;
            let error = rms_error(&wide(&frame), &truth.color);
            errors.push([step, error]);
            if frame.method.sample_distance == 0.0 {
                // No lattice: the error is rounding at any step.
                let wanted = 1e-6;
                let message = format!("without a lattice the error is {error:.1e}, wanted {wanted:e}");
                self.holds(label, error <= wanted, &message);
                return Ok(());
            }
            classified(&frame, how)?;
        }
        self.order(label, Study::of("step", errors), expected, "slope against the certified integral", scene);
        Ok(())
    }

    /// Whether cases may choose the step.
    ///
    /// # Errors
    /// If they may not (a skip).
    pub fn steps_are_free(&self) -> Result<(), Stop> {
        if self.subject.has("sample_distance") && !self.subject.options.contains_key("sample_distance") {
            return Ok(());
        }
        Err(Stop::Skip("the step cannot be set: no option \"sample_distance\", or set by the user".into()))
    }

    /// Errors that a case measured fall as expected.
    pub fn order(&mut self, label: &str, study: Study, expected: Expected, truth: &str, scene: &Scene) {
        let listed: Vec<_> = study.points.iter().map(|[h, e]| format!("{e:.2e} at {h}")).collect();
        let slope = study.slope.unwrap_or(f64::NAN);
        let message = format!("order {slope:.2}, wanted {}: {}", expected.words(), listed.join(", "));
        self.claim(label, truth, study.is(&expected), &message, Some(scene));
        if let Some(check) = self.checks.last_mut() {
            check.study = Some(study);
        }
    }
}

/// Whether a frame was classified as wished; one that was not has another order.
fn classified(frame: &Frame, how: &How) -> Result<(), Stop> {
    let wish = how.wishes().iter().find(|(name, _)| name == "classification").map(|(_, value)| value);
    let Some(ParameterValue::Choice(wish)) = wish else { return Ok(()) };
    let segments = match Lattice::of(&frame.method) {
        Ok(Lattice::Rays { segments, .. } | Lattice::Planes { segments, .. }) => segments,
        _ => return Ok(()),
    };
    if segments == (wish == "pre-integrated") {
        return Ok(());
    }
    let found = &frame.method.classification;
    Err(Stop::Skip(format!(
        "the frame is classified {found:?}, wanted {wish}: no option \"classification\", or set by the user"
    )))
}
