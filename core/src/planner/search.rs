//! Looks at settings by a sparse picture of the view.

use std::time::Instant;

use super::{
    Actor, Bound, Considered, Rate, Rates,
    errors::{Errors, Tail},
    knobs, steps,
};
use crate::{ActionError, FrameDesc, Opaque, OpaqueDepth, Options, Pixels, Shape, Viewport};

/// Which of the pixels are in a sparse picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Density {
    /// One of 400, from 256 to 4096: with those of earlier frames, errors show in them.
    Few,
    /// One of 100, from 1024 to 16,384: errors show in them alone.
    Many,
}

impl Density {
    /// For the first look at a scene.
    pub fn first(bound: Option<Bound>) -> Self {
        if bound.is_some() { Self::Many } else { Self::Few }
    }

    /// One of so many pixels, at least and at most so many.
    fn pixels(self) -> (usize, [usize; 2]) {
        match self {
            Self::Few => (400, [256, 4096]),
            Self::Many => (100, [1024, 16_384]),
        }
    }
}

/// The picture that errors are taken from is this many numbers of the lattice finer: a quarter of the distance.
const FINER: i32 = 8;

/// Looks that are taken at a candidate at most.
const LOOKS: usize = 4;

/// What an estimate of a bound is multiplied by: for the largest error, and the mean square.
const SAFETY: [f64; 2] = [2.0, 1.2];

/// One way to draw.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The number of the actor.
    pub actor: usize,
    /// Its choices, without the distance of samples.
    pub choices: Options,
    /// In words.
    pub setting: String,
}

/// What a look at a candidate showed, for the whole picture.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// The number of the lattice of steps.
    pub k: i32,
    /// The largest error.
    pub max: f64,
    /// The root of the mean square.
    pub rmse: f64,
    /// Samples.
    pub samples: f64,
    /// Seconds of the sparse picture itself, and its samples.
    pub sparse: (f64, f64),
    /// Its pixels.
    pub pixels: usize,
}

impl Look {
    /// This look with what was known before, of the same step: more at once, less little by little. Where errors are
    /// those of few pixels, a sparse picture may miss them all.
    pub fn after(self, before: &Self) -> Self {
        let mean = |old: f64, new: f64| (0.7 * old * old + 0.3 * new * new).sqrt().max(new);
        Self { max: mean(before.max, self.max), rmse: mean(before.rmse, self.rmse), ..self }
    }

    /// The error of the kind that is bounded, with a margin.
    pub fn error(&self, bound: Option<Bound>) -> f64 {
        match bound {
            Some(Bound::Rmse(_)) => self.rmse * SAFETY[1],
            _ => self.max * SAFETY[0],
        }
    }
}

/// A candidate at the step that suits the goals.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The number of the candidate.
    pub candidate: usize,
    /// The step.
    pub k: i32,
    /// The order of the error.
    pub order: f64,
    /// The look at that step.
    pub look: Look,
    /// Seconds.
    pub seconds: f64,
    /// Whether the goals are kept.
    pub kept: bool,
}

/// Everything that looks need.
pub struct Search<'a> {
    /// Who draws.
    pub actors: &'a mut [Actor],
    /// Who draws what errors are taken from; else who is looked at does.
    pub truth: Option<&'a mut Actor>,
    /// What is drawn.
    pub shapes: &'a [Shape],
    /// The sparse view.
    pub sparse: FrameDesc,
    /// Pixels of the whole picture.
    pub pixels: usize,
    /// The smallest voxel, to which steps are counted.
    pub voxel: f64,
    /// How errors of earlier sparse pictures were distributed.
    pub tail: &'a mut Tail,
    /// Samples of the whole picture at a step of one voxel.
    samples: Option<f64>,
    /// The finest picture drawn, by its step.
    finest: Option<(i32, Pixels<[f32; 4]>)>,
}

impl<'a> Search<'a> {
    /// Looks at a view.
    pub fn new(
        (actors, truth): (&'a mut [Actor], Option<&'a mut Actor>),
        shapes: &'a [Shape],
        (desc, turn, density): (&FrameDesc, usize, Density),
        voxel: f64,
        tail: &'a mut Tail,
    ) -> Self {
        let viewport = desc.viewport();
        let pixels = viewport.width * viewport.height;
        Self {
            actors,
            truth,
            shapes,
            sparse: sparse(desc, turn, density),
            pixels,
            voxel,
            tail,
            samples: None,
            finest: None,
        }
    }

    /// Draws a candidate at a step, and compares it with what is much finer.
    pub fn look(&mut self, candidate: &Candidate, k: i32, order: f64) -> Result<Look, ActionError> {
        let step = steps::distance(self.voxel, k);
        let actor = &mut self.actors[candidate.actor];
        actor.apply(&candidate.choices, Some(step))?;
        let started = Instant::now();
        let frame = actor.draw(&self.sparse, self.shapes)?;
        let seconds = started.elapsed().as_secs_f64();
        let color = self.truth(candidate, k)?;
        // The finer picture has an error of its own, of the same sign where the error goes by a power.
        let own = 1.0 / (1.0 - (-0.25 * f64::from(FINER) * order.clamp(1.0, 4.0)).exp2());
        let mut errors = Errors::between(&frame.color, &color);
        errors.rmse *= own;
        errors.worst.iter_mut().for_each(|e| *e *= own);
        self.tail.add(&errors);
        let pixels = self.sparse.width * self.sparse.height;
        let samples = frame.statistics.samples as f64;
        Ok(Look {
            k,
            max: self.tail.largest(&errors, self.pixels),
            rmse: errors.rmse,
            samples: samples * self.pixels as f64 / pixels as f64,
            sparse: (seconds, samples),
            pixels,
        })
    }

    /// The sparse picture at a quarter of a step or less.
    fn truth(&mut self, candidate: &Candidate, k: i32) -> Result<Pixels<[f32; 4]>, ActionError> {
        let wanted = k + FINER;
        if let Some((_, color)) = self.finest.as_ref().filter(|(k, _)| *k >= wanted) {
            return Ok(color.clone());
        }
        let (actor, choices) = match self.truth.as_deref_mut() {
            Some(actor) => (actor, Options::new()),
            None => (&mut self.actors[candidate.actor], candidate.choices.clone()),
        };
        actor.apply(&choices, Some(steps::distance(self.voxel, wanted)))?;
        let color = actor.draw(&self.sparse, self.shapes)?.color;
        self.finest = Some((wanted, color.clone()));
        Ok(color)
    }

    /// Finds the step at which a candidate keeps the goals. Where another keeps a bound in `fastest` seconds, one look
    /// at the step that takes as long says whether this one is worth more.
    pub fn fit(
        &mut self,
        (number, candidate): (usize, &Candidate),
        (bound, seconds): (Option<Bound>, Option<f64>),
        (rates, fastest): (&Rates, Option<f64>),
    ) -> Result<Fitted, ActionError> {
        let actor = &self.actors[candidate.actor];
        let stepped = knobs::has_step(&actor.declaration, &actor.given);
        let mut order = 2.0;
        let first = match (rates.of(&candidate.setting), fastest, self.samples) {
            (Some(rate), Some(seconds), Some(one)) if stepped => affordable(&rate, one, seconds),
            _ => 0,
        };
        let first = first.clamp(steps::COARSEST, steps::FINEST);
        let mut looks: Vec<Look> = vec![self.look(candidate, first, order)?];
        self.samples = Some(looks[0].samples * (-0.25 * f64::from(looks[0].k)).exp2());
        let behind = |l: &Look| fastest.is_some() && bound.is_some_and(|b| l.error(Some(b)) > b.value());
        while stepped && looks.len() < LOOKS && !behind(&looks[0]) {
            let last = looks[looks.len() - 1];
            let known = rate(&candidate.setting, rates, &looks);
            let next = match (bound, seconds) {
                (Some(bound), _) => steps::reaching(last.k, last.error(Some(bound)), order, bound.value()),
                (None, Some(t)) => last.k + affordable(&known, last.samples, t),
                (None, None) => last.k,
            };
            let next = next.clamp(steps::COARSEST, steps::FINEST);
            if looks.iter().any(|l| l.k == next) {
                break;
            }
            let look = self.look(candidate, next, order)?;
            order = steps::order((last.k, last.error(bound)), (look.k, look.error(bound)));
            looks.push(look);
        }
        let known = rate(&candidate.setting, rates, &looks);
        let kept = |l: &Look| {
            bound.is_none_or(|b| l.error(bound) <= b.value())
                && (bound.is_some() || seconds.is_none_or(|t| known.seconds(l.samples) <= t))
        };
        looks.sort_by_key(|l| l.k);
        // The coarsest that keeps an error, the finest that keeps a time.
        let good = match bound {
            Some(_) => looks.iter().find(|l| kept(l)),
            None => looks.iter().rev().find(|l| kept(l)),
        };
        let best = if bound.is_some() { looks.last() } else { looks.first() };
        let look = *good.or(best).unwrap_or(&looks[0]);
        let seconds = known.seconds(look.samples);
        Ok(Fitted { candidate: number, k: look.k, order, look, seconds, kept: good.is_some() })
    }
}

/// How many numbers of the lattice finer a time allows, samples going as 1 over the distance.
fn affordable(rate: &Rate, samples: f64, seconds: f64) -> i32 {
    let more = ((seconds - rate.overhead) / (rate.sample * samples)).max(1e-9).log2() * 4.0;
    if more.is_finite() { (more + 1e-6).floor().clamp(-100.0, 100.0) as i32 } else { 0 }
}

/// The machine's rate of a setting, else what looks at it show.
fn rate(setting: &str, rates: &Rates, looks: &[Look]) -> Rate {
    let seen = || Rate::fit(&looks.iter().map(|l| (l.sparse.1, l.sparse.0)).collect::<Vec<_>>());
    let each = |l: &Look| Rate { overhead: 0.0, sample: l.sparse.0 / l.sparse.1.max(1.0) };
    rates.of(setting).or_else(seen).unwrap_or_else(|| each(&looks[0]))
}

/// A candidate in the words of a plan.
pub fn considered(
    candidate: &Candidate,
    voxel: f64,
    found: &Result<Fitted, ActionError>,
    bound: Option<Bound>,
) -> Considered {
    let setting = candidate.setting.clone();
    match found {
        Ok(f) => Considered {
            setting,
            step: Some(steps::distance(voxel, f.k)),
            error: f.look.error(bound),
            seconds: f.seconds,
            refused: None,
        },
        Err(e) => Considered::refused(&setting, &e.to_string()),
    }
}

/// The view with few pixels, one more or less from turn to turn, so that in time all places are seen.
pub fn sparse(desc: &FrameDesc, turn: usize, density: Density) -> FrameDesc {
    let (one_of, [fewest, most]) = density.pixels();
    let whole = desc.viewport();
    let pixels = whole.width * whole.height;
    let wanted = (pixels / one_of).clamp(fewest, most).min(pixels);
    let width = (wanted as f64 * whole.width as f64 / whole.height as f64).sqrt();
    let width = (width.round() as usize + [0, 1, 3, 2][turn % 4]).clamp(1, whole.width);
    let height = (width as f64 * whole.height as f64 / whole.width as f64).round() as usize;
    let height = height.clamp(1, whole.height);
    let opaque = desc.opaque.as_ref().map(|opaque| thinned(opaque, &whole, desc.width, [width, height]));
    FrameDesc { width, height, viewport: None, opaque, ..desc.clone() }
}

/// What was drawn already, at the pixels of a sparse picture.
fn thinned(opaque: &Opaque, whole: &Viewport, row: usize, [width, height]: [usize; 2]) -> Opaque {
    let at = |i: usize| {
        let (x, y) = (i % width, i / width);
        let place = |i: usize, few: usize, many: usize| (2 * i + 1) * many / (2 * few);
        (whole.y + place(y, height, whole.height)) * row + whole.x + place(x, width, whole.width)
    };
    let thin = |all: &[f32]| (0..width * height).map(|i| all[at(i)]).collect();
    Opaque {
        color: opaque.color.as_ref().map(|all| (0..width * height).map(|i| all[at(i)]).collect()),
        depth: match &opaque.depth {
            OpaqueDepth::Distance(values) => OpaqueDepth::Distance(thin(values)),
            OpaqueDepth::Buffer { values, range, world_to_clip } => {
                OpaqueDepth::Buffer { values: thin(values), range: *range, world_to_clip: *world_to_clip }
            }
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, Camera, View, glam::DVec3};
    use std::sync::Arc;

    #[test]
    fn sparse_pictures_have_the_shape_of_the_whole_and_few_pixels() {
        let camera = Camera::fit(&Aabb::new(DVec3::ZERO, DVec3::ONE), View::Front, 8, 8);
        for (width, height) in [(512, 512), (1920, 1080), (1, 8192), (8192, 1), (1, 1), (16, 9), (40, 3000)] {
            for turn in 0..4 {
                let few = sparse(&FrameDesc::new(camera, width, height), turn, Density::Few);
                assert!((1..=width).contains(&few.width) && (1..=height).contains(&few.height));
                let pixels = few.width * few.height;
                assert!(pixels <= 8192 && pixels >= (width * height / 400).clamp(1, 200), "{width} {height}: {pixels}");
            }
        }
    }

    #[test]
    fn what_was_drawn_already_is_seen_where_the_sparse_pixels_are() {
        let camera = Camera::fit(&Aabb::new(DVec3::ZERO, DVec3::ONE), View::Front, 8, 8);
        let depth: Arc<[f32]> = (0..100 * 60).map(|i| if i % 100 < 50 { 1.0 } else { f32::INFINITY }).collect();
        let opaque = Opaque { color: None, depth: OpaqueDepth::Distance(depth) };
        let few = sparse(&FrameDesc::new(camera, 100, 60).with_opaque(opaque), 0, Density::Few);
        let Some(Opaque { depth: OpaqueDepth::Distance(found), .. }) = few.opaque else { panic!() };
        assert_eq!(found.len(), few.width * few.height);
        for (i, d) in found.iter().enumerate() {
            let middle = 2 * (i % few.width) + 1;
            assert_eq!(d.is_finite(), middle < few.width, "{i}");
        }
    }
}
