//! Comparisons: a frame with the lattice, with a closed form, with another frame; errors by their kind.

use std::sync::Arc;

use volact_core::{ActionError, Frame};
use volact_cpu::reference::ReferencePicture;

use super::{How, Rig, Scene, line};
use crate::{
    case::Stop,
    method::Lattice,
    metrics::{identical, rms_error, wide},
    outcome::{Check, Figures, Sheet},
    report::VARIANT,
    reproduce,
    tolerance::{Pair, Sizes, Tolerance},
    truth::{Change, chain},
    voxels::{self, Noise},
};

/// A pixel's closed form; `None` where there is none.
pub type Wanted<'a> = &'a dyn Fn(usize, usize) -> Option<[f64; 4]>;

/// The result of a call that should have failed.
pub type Found<T> = Result<T, ActionError>;

impl Rig<'_> {
    /// Draws and compares with the reference on the lattice that the frame says it was drawn on.
    ///
    /// # Errors
    /// If the frame cannot be drawn, or says nothing that the reference could repeat (a skip).
    pub fn lattice(&mut self, label: &str, scene: &Scene, how: &How) -> Result<Frame, Stop> {
        let frame = self.draw(scene, how)?;
        self.on_lattice(label, scene, &frame)?;
        Ok(frame)
    }

    /// Compares a frame that is drawn already with the reference on its lattice.
    ///
    /// # Errors
    /// If the frame says nothing that the reference could repeat (a skip).
    pub fn on_lattice(&mut self, label: &str, scene: &Scene, frame: &Frame) -> Result<(), Stop> {
        let lattice = Lattice::of(&frame.method).map_err(Stop::Skip)?;
        let pair = self.pair(label, scene, lattice)?;
        let coarse = self.coarse(label, scene, frame, lattice)?;
        let tolerance = self.tolerance(&pair, scene, frame, lattice).and("format of voxels", coarse);
        let seen = pair[0].color.iter().any(|c| c[3] > 1e-3);
        self.compare(label, &lattice.name(), scene, frame, &pair[0].color, &tolerance);
        if !seen && let Some(check) = self.checks.last_mut() {
            check.passed = false;
            check.message = "the true picture is empty: the case looks at nothing".into();
        }
        Ok(())
    }

    /// Draws and compares with a closed form.
    ///
    /// # Errors
    /// If the frame cannot be drawn.
    pub fn closed(&mut self, label: &str, scene: &Scene, how: &How, wanted: Wanted<'_>) -> Result<Frame, Stop> {
        let frame = self.draw(scene, how)?;
        self.is(label, scene, &frame, wanted)?;
        Ok(frame)
    }

    /// Compares a frame that is drawn already with a closed form.
    ///
    /// # Errors
    /// If the reference cannot draw the scene, to derive the tolerance.
    pub fn is(&mut self, label: &str, scene: &Scene, frame: &Frame, wanted: Wanted<'_>) -> Result<(), Stop> {
        let lattice = Lattice::of(&frame.method).unwrap_or(Lattice::Exact);
        let pair = self.pair(label, scene, lattice)?;
        let tolerance = self.tolerance(&pair, scene, frame, lattice);
        let at = |i: usize| wanted(i % frame.width, i / frame.width);
        let found = wide(frame);
        // Pixels without a closed form are what they are.
        let wanted: Vec<_> = (0..found.len()).map(|i| at(i).unwrap_or(found[i])).collect();
        self.compare(label, "closed form", scene, frame, &wanted, &tolerance);
        Ok(())
    }

    /// Draws one pixel and compares it with a closed form.
    ///
    /// # Errors
    /// If the frame cannot be drawn.
    pub fn pixel(&mut self, label: &str, scene: &Scene, how: &How, wanted: [f64; 4]) -> Result<Frame, Stop> {
        self.closed(label, scene, how, &|_, _| Some(wanted))
    }

    /// Two frames must agree bit by bit, depth included.
    pub fn same(&mut self, label: &str, scene: &Scene, found: &Frame, wanted: &Frame) {
        let passed = identical(found, wanted);
        let pixels = found.color.len().min(wanted.color.len());
        let differ = (0..pixels).filter(|&i| found.color[i] != wanted.color[i]).count();
        let message = if passed {
            "the same bits".to_owned()
        } else {
            format!("{differ} of {pixels} pixels differ, or depths do")
        };
        let sheet = (found.color.len() == wanted.color.len()).then(|| Sheet {
            width: found.width,
            height: found.height,
            expected: wanted.color.to_vec(),
            actual: found.color.to_vec(),
            tolerance: vec![0.0; pixels],
        });
        self.note(Check {
            label: label.into(),
            truth: "bit for bit".into(),
            passed,
            message,
            figures: None,
            sheet,
            study: None,
            method: Some(line(&found.method)),
            scene: Some(reproduce::scene(&scene.shapes, &scene.desc)),
            files: reproduce::files(&scene.shapes),
        });
    }

    /// Two frames of scenes that mean the same must agree within what rounding allows both.
    ///
    /// # Errors
    /// If the reference cannot draw the scene, to derive the tolerance.
    pub fn alike(&mut self, label: &str, scene: &Scene, found: &Frame, wanted: &Frame) -> Result<(), Stop> {
        let lattice = Lattice::of(&found.method).unwrap_or(Lattice::Exact);
        let pair = self.pair(label, scene, lattice)?;
        let mut tolerance = self.tolerance(&pair, scene, found, lattice);
        tolerance.pixels.iter_mut().for_each(|t| *t *= 2.0);
        tolerance.parts.push(("twice, since both round".into(), 2.0));
        self.compare(label, VARIANT, scene, found, &wide(wanted), &tolerance);
        Ok(())
    }

    /// Depths agree with what is wanted to f32 of the distance and what the medium's rounding moves.
    pub fn depths(&mut self, label: &str, scene: &Scene, frame: &Frame, wanted: &[f64], tolerance: f64) {
        let error = |(found, wanted): (&f32, &f64)| match (found.is_infinite(), wanted.is_infinite()) {
            (true, true) => 0.0,
            (false, false) => (f64::from(*found) - wanted).abs(),
            _ => f64::INFINITY,
        };
        let worst =
            frame.depth.iter().zip(wanted).map(error).fold(0.0, |m: f64, e| if e.is_nan() { e } else { m.max(e) });
        let passed = frame.depth.len() == wanted.len() && worst <= tolerance;
        let message = format!("depth is off by {worst:.2e}, tolerance {tolerance:.2e}");
        self.claim(label, "closed form", passed, &message, Some(scene));
    }

    /// A number is what is wanted.
    pub fn figure(&mut self, label: &str, found: f64, wanted: f64, tolerance: f64) {
        let off = (found - wanted).abs();
        let message = format!("found {found}, wanted {wanted} within {tolerance:.1e}");
        self.claim(label, "closed form", off <= tolerance, &message, None);
    }

    /// Something is so.
    pub fn holds(&mut self, label: &str, so: bool, message: &str) {
        self.claim(label, "the contract", so, message, None);
    }

    /// A call fails in the way and with the words that the contract states.
    pub fn refused<T>(&mut self, label: &str, found: Found<T>, kind: impl Fn(&ActionError) -> bool, words: &[&str]) {
        let (passed, message) = match found {
            Ok(_) => (false, "accepted, wanted an error".to_owned()),
            Err(error) => {
                let text = chain(&error);
                let missing: Vec<_> = words.iter().filter(|w| !text.contains(**w)).collect();
                (kind(&error) && missing.is_empty(), format!("{text:?}, wanted the words {words:?}"))
            }
        };
        self.claim(label, "the error of the contract", passed, &message, None);
    }

    pub(super) fn claim(&mut self, label: &str, truth: &str, passed: bool, message: &str, scene: Option<&Scene>) {
        self.note(Check {
            label: label.into(),
            truth: truth.into(),
            passed,
            message: message.into(),
            figures: None,
            sheet: None,
            study: None,
            method: None,
            scene: scene.map(|s| reproduce::scene(&s.shapes, &s.desc)),
            files: scene.map(|s| reproduce::files(&s.shapes)).unwrap_or_default(),
        });
    }

    /// The true picture of a scene on a lattice.
    ///
    /// # Errors
    /// If the reference does not draw it.
    pub fn truth(
        &self,
        label: &str,
        scene: &Scene,
        lattice: Lattice,
        change: &Change,
    ) -> Result<Arc<ReferencePicture>, Stop> {
        let key = format!("{}/{label}", self.case);
        let truth = self.truths.get(&key, &self.registry, (&scene.shapes, &scene.desc), lattice, change);
        truth.map_err(|why| Stop::Fail(format!("no truth: {why}")))
    }

    fn pair(&self, label: &str, scene: &Scene, lattice: Lattice) -> Result<[Arc<ReferencePicture>; 2], Stop> {
        let moved = Change { shift: Sizes::of(&scene.shapes).shift(), noise: None };
        Ok([self.truth(label, scene, lattice, &Change::default())?, self.truth(label, scene, lattice, &moved)?])
    }

    /// Twice the most that voxels in formats of fewer digits change any pixel: see [`voxels`](crate::voxels).
    fn coarse(&self, label: &str, scene: &Scene, frame: &Frame, lattice: Lattice) -> Result<f64, Stop> {
        let mut most = 0f64;
        for noise in (0..voxels::DRAWN).map_while(|seed| Noise::of(&frame.method, &scene.shapes, seed)) {
            let change = Change { noise: Some(noise), ..Change::default() };
            let truth = self.truth(label, scene, lattice, &Change::default())?;
            let noisy = self.truth(label, scene, lattice, &change)?;
            let pairs = truth.color.iter().flatten().zip(noisy.color.iter().flatten());
            most = pairs.fold(most, |most, (a, b)| most.max((a - b).abs()));
        }
        Ok(2.0 * most)
    }

    fn tolerance(
        &self,
        pair: &[Arc<ReferencePicture>; 2],
        scene: &Scene,
        frame: &Frame,
        lattice: Lattice,
    ) -> Tolerance {
        let pair = Pair { truth: &pair[0], moved: &pair[1] };
        let tolerance = Tolerance::derive(pair, &scene.shapes, &frame.method, lattice);
        match &self.extra {
            Some((what, value)) => tolerance.and(what, *value),
            None => tolerance,
        }
    }

    /// Compares pixel by pixel.
    fn compare(
        &mut self,
        label: &str,
        truth: &str,
        scene: &Scene,
        frame: &Frame,
        wanted: &[[f64; 4]],
        tolerance: &Tolerance,
    ) {
        let found = wide(frame);
        let sized = found.len() == wanted.len() && found.len() == tolerance.pixels.len();
        let figures = sized.then(|| figures(&found, wanted, tolerance, self.reason.clone()));
        let passed = figures.as_ref().is_some_and(|f| f.room >= 1.0 && f.rmse <= f.rmse_tolerance);
        let message = figures.as_ref().map_or_else(
            || format!("{} pixels, wanted {}", found.len(), wanted.len()),
            |f| {
                format!("max {:.2e} of {:.2e}, rmse {:.2e} of {:.2e}", f.max, f.max_tolerance, f.rmse, f.rmse_tolerance)
            },
        );
        let sheet = sized.then(|| Sheet {
            width: frame.width,
            height: frame.height,
            expected: wanted.iter().map(|c| c.map(|v| v as f32)).collect(),
            actual: frame.color.to_vec(),
            tolerance: tolerance.pixels.iter().map(|t| *t as f32).collect(),
        });
        self.note(Check {
            label: label.into(),
            truth: truth.into(),
            passed,
            message,
            figures,
            sheet,
            study: None,
            method: Some(line(&frame.method)),
            scene: Some(reproduce::scene(&scene.shapes, &scene.desc)),
            files: reproduce::files(&scene.shapes),
        });
    }
}

fn figures(found: &[[f64; 4]], wanted: &[[f64; 4]], tolerance: &Tolerance, reason: Option<String>) -> Figures {
    let error = |i: usize| {
        let off = (0..4).map(|c| (found[i][c] - wanted[i][c]).abs());
        off.fold(0.0, |m: f64, d| if d.is_nan() { f64::INFINITY } else { m.max(d) })
    };
    let (mut max, mut room, mut allowed) = (0.0f64, f64::INFINITY, 0.0f64);
    for i in 0..found.len() {
        let (off, may) = (error(i), tolerance.pixels[i]);
        max = max.max(off);
        let own = if off == 0.0 { f64::INFINITY } else { may / off };
        if own < room {
            (room, allowed) = (own, may);
        }
    }
    if room == f64::INFINITY {
        allowed = tolerance.pixels.iter().copied().fold(0.0, f64::max);
    }
    Figures {
        max,
        rmse: rms_error(found, wanted),
        max_tolerance: allowed,
        rmse_tolerance: tolerance.rmse(),
        // JSON has no infinity.
        room: room.min(1e9),
        parts: tolerance.parts.clone(),
        reason: reason.or_else(|| stated(tolerance)),
    }
}

/// The reason for more room where a bound for the worst place is most of the tolerance.
fn stated(tolerance: &Tolerance) -> Option<String> {
    let part = |name: &str| tolerance.parts.iter().filter(|(n, _)| n == name).map(|(_, v)| *v).sum::<f64>();
    let all: f64 = ["frame", "sums", "positions", "tables", "cells"].into_iter().map(part).sum();
    let mostly = |name: &str| part(name) > 0.5 * all;
    if mostly("tables") {
        Some("most of it bounds the worst interval of the table, in which few samples fall".into())
    } else if mostly("cells") {
        Some("most of it bounds the worst cell, of the strongest colours and the deepest".into())
    } else {
        None
    }
}
