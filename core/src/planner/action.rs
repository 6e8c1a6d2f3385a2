//! The `planned` action.

use std::{
    fmt,
    time::{Duration, Instant},
};

use super::{
    Actor, Bound, Considered, Goals, Plan, Rates,
    errors::Tail,
    knobs,
    search::{Candidate, Density, Fitted, Look, Search, considered, sparse},
    steps::{self, Steady},
};
use crate::{
    Aabb, ActionError, Caps, Context, Declaration, Frame, FrameDesc, Options, ParameterDecl, ParameterType,
    ParameterValue, Ray, RenderAction, Shape, Warning, WarningCode,
    frame::FrameError,
    lifecycle::Lifecycle,
    parameter::{Kind, ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
    shape::smallest_voxel,
};

/// Frames after which changed shapes have all candidates looked at again.
const FRAMES: u32 = 16;

/// The part of the drawing's time that looks may take while nothing but the view changes.
const SHARE: f64 = 0.02;

/// Frames between two looks at most.
const PAUSE: f64 = 60.0;

/// How far the view turns, or by which part of the scene's size the eye moves, before a look is due.
const TURN: f64 = 0.1;

/// What `planned` says of itself. It passes other options on to the actions that it plans for.
pub fn declaration() -> Declaration {
    let text = "picks the cheapest settings of other actions that keep an error or a time";
    let number = |name, text| ParameterDecl::new(name, ParameterType::Float, text).bounds(f64::MIN_POSITIVE, f64::MAX);
    Declaration::new(Kind::Action, "planned", env!("CARGO_PKG_VERSION"), text)
        .with(
            ParameterDecl::new("of", ParameterType::Choice, "the actions to choose from, with blanks between them")
                .default("cpu"),
        )
        .with(number(
            "max_error",
            "the largest error of any channel of any pixel; half an 8-bit step where nothing is asked",
        ))
        .with(number("rmse", "the root of the mean square of errors over all channels"))
        .with(
            number("milliseconds", "the time of a frame; with an error, of the first one while nothing changes")
                .unit("ms"),
        )
}

impl Goals {
    /// What is asked for where nothing is: half an 8-bit step.
    pub const BOUND: Bound = Bound::MaxError(0.5 / 255.0);

    /// Reads options of `planned`; half an 8-bit step where none says anything.
    ///
    /// # Errors
    /// If both kinds of error are bounded.
    pub fn read(options: &Options) -> Result<Self, ParameterProblem> {
        let number = |name: &str| options.get(name).and_then(ParameterValue::as_float);
        let bound = match (number("max_error"), number("rmse")) {
            (Some(_), Some(_)) => {
                let kind =
                    ProblemKind::Mistyped { found: "set, and max_error too".into(), wanted: "one of the two".into() };
                return Err(ParameterProblem { name: "rmse".into(), kind });
            }
            (Some(e), None) => Some(Bound::MaxError(e)),
            (None, Some(e)) => Some(Bound::Rmse(e)),
            (None, None) => None,
        };
        let time = number("milliseconds").map(|t| Duration::from_secs_f64((t * 1e-3).min(1e6)));
        let bound = bound.or_else(|| time.is_none().then_some(Self::BOUND));
        Ok(Self { bound, time })
    }

    /// Options of `planned` with these goals in place of theirs.
    pub fn above(&self, options: &Options) -> Options {
        let mut all = options.clone();
        all.retain(|name, _| !["max_error", "rmse", "milliseconds"].contains(&name.as_str()));
        all.extend(self.options());
        all
    }

    /// The options that say the same.
    pub fn options(&self) -> Options {
        let bound = self.bound.map(|bound| match bound {
            Bound::MaxError(e) => ("max_error", e),
            Bound::Rmse(e) => ("rmse", e),
        });
        let time = self.time.map(|t| ("milliseconds", t.as_secs_f64() * 1e3));
        bound.into_iter().chain(time).map(|(name, value)| (name.to_owned(), value.into())).collect()
    }
}

/// Plans for other actions and draws with them.
pub struct PlannedAction {
    declaration: Declaration,
    /// Options of its own that were given.
    given: Options,
    lifecycle: Lifecycle,
    goals: Goals,
    rates: Rates,
    actors: Vec<Actor>,
    truth: Option<Actor>,
    candidates: Vec<Candidate>,
    /// Shapes drawn in the open frame, in order.
    drawn: Vec<Shape>,
    tail: Tail,
    kept: Option<Kept>,
    frames: usize,
}

/// What is kept from one frame to the next.
struct Kept {
    /// What was drawn.
    shapes: Vec<ResolvedShape>,
    desc: FrameDesc,
    candidate: usize,
    steady: Steady,
    order: f64,
    /// The step that keeps the bound, where time took a coarser one.
    wanted: i32,
    /// Time taken over the time that was expected.
    slower: f64,
    /// Frames since all candidates were looked at.
    age: u32,
    /// What the last look showed, and of which view.
    look: Look,
    seen: Ray,
    /// Frames until the next look, unless the view turns.
    pause: u32,
    /// Seconds of looks, and of frames.
    spent: [f64; 2],
    frame: Option<Frame>,
}

impl fmt::Debug for PlannedAction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PlannedAction").field("goals", &self.goals).finish_non_exhaustive()
    }
}

impl PlannedAction {
    /// Plans for actions, to options of its own. `truth` draws what errors are taken from: an exact action that is
    /// none of them.
    ///
    /// # Errors
    /// If both kinds of error are bounded.
    pub fn new(
        context: &Context,
        (actors, truth): (Vec<Actor>, Option<Actor>),
        given: Options,
        rates: Rates,
    ) -> Result<Self, ActionError> {
        let wrong = |problem| ActionError::Options { action: "planned".into(), problems: vec![problem] };
        let mut made = Self {
            declaration: declaration(),
            goals: Goals::read(&given).map_err(wrong)?,
            given,
            lifecycle: Lifecycle::new(context.clone()),
            rates,
            actors,
            truth,
            candidates: Vec::new(),
            drawn: Vec::new(),
            tail: Tail::default(),
            kept: None,
            frames: 0,
        };
        made.find_candidates();
        Ok(made)
    }

    fn find_candidates(&mut self) {
        let of = |(actor, a): (usize, &Actor)| {
            let words = |choices: &Options| knobs::words(&a.name, choices);
            let all = knobs::candidates(&a.declaration, &a.given).into_iter();
            all.map(|choices| Candidate { actor, setting: words(&choices), choices }).collect::<Vec<_>>()
        };
        self.candidates = self.actors.iter().enumerate().flat_map(of).collect();
        self.kept = None;
    }

    /// What would be chosen for a frame of managed shapes, and the sparse picture drawn so; nothing else is drawn.
    ///
    /// # Errors
    /// If a frame is open, a shape is not managed, or no candidate can draw.
    pub fn plan(&mut self, desc: &FrameDesc, shapes: &[Shape]) -> Result<(Plan, Frame), ActionError> {
        self.begin_draw(desc)?;
        let noted = shapes.iter().try_for_each(|shape| self.draw(shape));
        let open = self.lifecycle.end()?;
        noted?;
        let shapes = std::mem::take(&mut self.drawn);
        let resolved: Vec<ResolvedShape> = open.drawn_shapes().cloned().collect();
        self.kept = None;
        let plan = self.decide(desc, &shapes, &resolved)?;
        let Some(kept) = &self.kept else { return Err(ActionError::NotDrawing { call: "plan" }) };
        let few = sparse(desc, self.frames, Density::first(self.goals.bound));
        let candidate = &self.candidates[kept.candidate];
        let actor = &mut self.actors[candidate.actor];
        actor.apply(&candidate.choices, plan.step)?;
        let sparse = actor.draw(&few, &shapes)?;
        Ok((plan, sparse))
    }

    /// Chooses for a frame: follows the last one, or looks at all candidates.
    fn decide(&mut self, desc: &FrameDesc, shapes: &[Shape], resolved: &[ResolvedShape]) -> Result<Plan, ActionError> {
        let started = Instant::now();
        self.frames += 1;
        let kept = self.kept.take();
        let anew = kept.as_ref().is_none_or(|kept| {
            let others =
                kept.shapes.len() != resolved.len() || kept.shapes.iter().zip(resolved).any(|(a, b)| a.id != b.id);
            let changed = || kept.shapes.iter().zip(resolved).any(|(a, b)| !same_look(a, b));
            others || (kept.age >= FRAMES && changed())
        });
        let (mut kept, look, considered) = match kept.filter(|_| !anew) {
            Some(kept) => self.follow(kept, desc, shapes, resolved)?,
            None => self.choose(desc, shapes, resolved)?,
        };
        kept.shapes = resolved.to_vec();
        kept.desc = desc.clone();
        let planning = started.elapsed();
        let mut plan = self.told(&kept, &look, voxel(resolved), considered);
        plan.planning = planning;
        self.kept = Some(kept);
        Ok(plan)
    }

    /// Looks at all candidates.
    fn choose(
        &mut self,
        desc: &FrameDesc,
        shapes: &[Shape],
        resolved: &[ResolvedShape],
    ) -> Result<(Kept, Look, Vec<Considered>), ActionError> {
        let goals = (self.goals.bound, self.goals.time.map(|t| t.as_secs_f64()));
        let voxel = voxel(resolved);
        self.tail = Tail::default();
        let truth = self.truth.as_mut().filter(|t| t.refusal(shapes).is_none());
        let mut search = Search::new(
            (&mut self.actors, truth),
            shapes,
            (desc, self.frames, Density::first(self.goals.bound)),
            voxel,
            &mut self.tail,
        );
        let (mut all, mut fitted, mut refusal) = (Vec::new(), Vec::new(), None);
        for (number, candidate) in self.candidates.iter().enumerate() {
            if let Some(why) = search.actors[candidate.actor].refusal(shapes) {
                all.push(Considered::refused(&candidate.setting, why));
                continue;
            }
            let found = search.fit((number, candidate), goals, (&self.rates, fastest(&fitted)));
            all.push(considered(candidate, voxel, &found, self.goals.bound));
            match found {
                Ok(found) => fitted.push(found),
                Err(e) => refusal = refusal.or(Some(e)),
            }
        }
        let Some(best) = best(fitted, self.goals.bound) else {
            return Err(refusal.unwrap_or_else(|| nobody(shapes, &all)));
        };
        let kept = Kept {
            shapes: Vec::new(),
            desc: desc.clone(),
            candidate: best.candidate,
            steady: Steady::new(best.k),
            order: best.order,
            wanted: best.k,
            slower: 1.0,
            age: 0,
            look: best.look,
            seen: seen(desc)?,
            pause: 0,
            spent: [0.0; 2],
            frame: None,
        };
        let mut kept = kept;
        self.limit(&mut kept, &best.look);
        let look = self.at(kept.steady.k, &best.look, best.order);
        Ok((kept, look, all))
    }

    /// Goes on with what the last frame took.
    fn follow(
        &mut self,
        mut kept: Kept,
        desc: &FrameDesc,
        shapes: &[Shape],
        resolved: &[ResolvedShape],
    ) -> Result<(Kept, Look, Vec<Considered>), ActionError> {
        kept.age += 1;
        let now = seen(desc)?;
        kept.pause = kept.pause.saturating_sub(1);
        if kept.pause > 0 && !has_turned(&kept.seen, &now, size(resolved)) {
            let look = self.at(kept.steady.k, &kept.look, kept.order);
            return Ok((kept, look, Vec::new()));
        }
        let started = Instant::now();
        let candidate = self.candidates[kept.candidate].clone();
        let truth = self.truth.as_mut().filter(|t| t.refusal(shapes).is_none());
        let of = (desc, self.frames, Density::Few);
        let mut search = Search::new((&mut self.actors, truth), shapes, of, voxel(resolved), &mut self.tail);
        let look = search.look(&candidate, kept.wanted, kept.order)?;
        let look = look.after(&self.at(look.k, &kept.look, kept.order));
        kept.steady.k = kept.wanted;
        if let Some(bound) = self.goals.bound {
            kept.steady.follow(look.error(self.goals.bound), kept.order, bound.value());
        } else if let Some(time) = self.goals.time {
            let seconds = self.rate(&candidate, &look).seconds(look.samples) * kept.slower;
            kept.steady.follow_time(seconds, time.as_secs_f64());
        }
        kept.wanted = kept.steady.k;
        self.limit(&mut kept, &look);
        (kept.look, kept.seen) = (look, now);
        kept.spent[0] = lasting(kept.spent[0], started.elapsed().as_secs_f64());
        let pause = kept.spent[0] / (SHARE * kept.spent[1]);
        kept.pause = if pause.is_finite() { pause.ceil().min(PAUSE) as u32 } else { 0 };
        let look = self.at(kept.steady.k, &look, kept.order);
        Ok((kept, look, Vec::new()))
    }

    /// With both goals, takes a coarser step where the one that keeps the error would take too long.
    fn limit(&self, kept: &mut Kept, look: &Look) {
        let (Some(_), Some(time)) = (self.goals.bound, self.goals.time) else { return };
        let rate = self.rate(&self.candidates[kept.candidate], look);
        let seconds = |k: i32| rate.seconds(look.samples * (0.25 * f64::from(k - look.k)).exp2()) * kept.slower;
        while kept.steady.k > steps::COARSEST && seconds(kept.steady.k) > time.as_secs_f64() {
            kept.steady.k -= 1;
        }
    }

    fn rate(&self, candidate: &Candidate, look: &Look) -> super::Rate {
        let seen = super::Rate { overhead: 0.0, sample: look.sparse.0 / look.sparse.1.max(1.0) };
        self.rates.of(&candidate.setting).unwrap_or(seen)
    }

    /// What a look would show at another step.
    fn at(&self, k: i32, look: &Look, order: f64) -> Look {
        let octaves = 0.25 * f64::from(k - look.k);
        let (error, samples) = ((-order * octaves).exp2(), octaves.exp2());
        Look { k, max: look.max * error, rmse: look.rmse * error, samples: look.samples * samples, ..*look }
    }

    fn told(&self, kept: &Kept, look: &Look, voxel: f64, considered: Vec<Considered>) -> Plan {
        let candidate = &self.candidates[kept.candidate];
        let actor = &self.actors[candidate.actor];
        let step = knobs::has_step(&actor.declaration, &actor.given).then(|| steps::distance(voxel, kept.steady.k));
        let mut options = actor.given.clone();
        options.extend(candidate.choices.clone());
        let mut setting = candidate.setting.clone();
        if let Some(step) = step {
            options.insert(knobs::STEP.into(), step.into());
            setting = format!("{setting} {}={step:.6}", knobs::STEP);
        }
        let seconds = self.rate(candidate, look).seconds(look.samples) * kept.slower;
        let in_time = self.goals.bound.is_some() || self.goals.time.is_none_or(|t| seconds <= t.as_secs_f64());
        let exact = self.goals.bound.is_none_or(|b| look.error(self.goals.bound) <= b.value());
        Plan {
            action: actor.name.clone(),
            options,
            setting,
            step,
            max_error: look.max,
            rmse: look.rmse,
            seconds,
            kept: in_time && exact,
            refining: kept.steady.k < kept.wanted,
            sparse: look.pixels,
            considered,
            ..Plan::default()
        }
    }

    /// Draws as planned.
    fn execute(&mut self, plan: Plan, desc: &FrameDesc, shapes: &[Shape]) -> Result<Frame, ActionError> {
        let Some(kept) = &mut self.kept else { return Err(ActionError::NotDrawing { call: "end_draw" }) };
        let candidate = &self.candidates[kept.candidate];
        let actor = &mut self.actors[candidate.actor];
        actor.apply(&candidate.choices, plan.step)?;
        let started = Instant::now();
        let mut frame = actor.draw(desc, shapes)?;
        // What was slower than expected once is not at once taken for the rule.
        let seconds = started.elapsed().as_secs_f64();
        kept.spent[1] = lasting(kept.spent[1], seconds);
        let ratio = (seconds / plan.seconds.max(1e-9)).clamp(0.05, 20.0);
        kept.slower *= if kept.age == 0 { ratio } else { ratio.powf(0.3) };
        if !plan.kept
            && let Some(bound) = self.goals.bound.filter(|_| kept.steady.k >= kept.wanted)
        {
            let message = format!(
                "{bound} is not expected to be kept: the best that was found is {} with an error of {:.1e} (max) and {:.1e} (rmse)",
                plan.setting, plan.max_error, plan.rmse
            );
            frame.warnings.push(Warning::new(WarningCode::SettingAdjusted, "planned", message));
        }
        frame.statistics.total += plan.planning;
        frame.statistics.prepare += plan.planning;
        frame.statistics.details.push(("planning".into(), format!("{:.3} ms", plan.planning.as_secs_f64() * 1e3)));
        frame.plan = Some(plan);
        kept.frame = Some(frame.clone());
        Ok(frame)
    }

    /// The next finer picture of what has not changed; `None` where it has. Where the bound is kept already, that
    /// is the last picture.
    fn refined(
        &mut self,
        desc: &FrameDesc,
        shapes: &[Shape],
        resolved: &[ResolvedShape],
    ) -> Result<Option<Frame>, ActionError> {
        let Some(kept) = &mut self.kept else { return Ok(None) };
        let same = |(a, b): (&ResolvedShape, &ResolvedShape)| a.id == b.id && a.same_content(b);
        let still =
            kept.desc == *desc && kept.shapes.len() == resolved.len() && kept.shapes.iter().zip(resolved).all(same);
        let Some(frame) = kept.frame.as_ref().filter(|_| still) else { return Ok(None) };
        if kept.steady.k >= kept.wanted {
            return Ok(Some(frame.clone()));
        }
        // Half the distance, twice the time.
        let before = kept.steady.k;
        kept.steady.k = (before + 4).min(kept.wanted);
        let plan = frame.plan.clone().unwrap_or_default();
        let look = Look {
            k: before,
            max: plan.max_error,
            rmse: plan.rmse,
            samples: frame.statistics.samples as f64,
            sparse: (0.0, 1.0),
            pixels: plan.sparse,
        };
        let Some(kept) = self.kept.take() else { return Ok(None) };
        let look = self.at(kept.steady.k, &look, kept.order);
        let mut next = self.told(&kept, &look, voxel(resolved), Vec::new());
        next.seconds = plan.seconds * (0.25 * f64::from(kept.steady.k - before)).exp2();
        self.kept = Some(kept);
        self.execute(next, desc, shapes).map(Some)
    }
}

/// A time that lasts, by the latest of it.
fn lasting(before: f64, now: f64) -> f64 {
    if before > 0.0 { 0.7 * before + 0.3 * now } else { now }
}

/// The ray in the middle of a view.
fn seen(desc: &FrameDesc) -> Result<Ray, ActionError> {
    let viewport = desc.viewport();
    let grid = desc.camera.rays(&viewport).map_err(FrameError::from)?;
    Ok(grid.ray(0.5 * viewport.width as f64, 0.5 * viewport.height as f64))
}

/// Whether a view has become another one, of a scene of some size.
fn has_turned(before: &Ray, now: &Ray, size: f64) -> bool {
    let turn = before.direction.normalize_or_zero().distance(now.direction.normalize_or_zero());
    let moved = before.origin.distance(now.origin) / size;
    !(turn < TURN && moved < TURN)
}

/// The size of all shapes together.
fn size(shapes: &[ResolvedShape]) -> f64 {
    shapes.iter().fold(Aabb::EMPTY, |all, s| all.union(&s.state.world_bounds())).size().length()
}

/// Whether two resolutions of a shape differ in nothing but place.
fn same_look(a: &ResolvedShape, b: &ResolvedShape) -> bool {
    let mut moved = b.clone();
    moved.state.transform = a.state.transform;
    moved.state.clip = a.state.clip.clone();
    a.same_content(&moved)
}

/// The smallest voxel of all shapes in world units; a 256th of a mesh's diagonal.
fn voxel(shapes: &[ResolvedShape]) -> f64 {
    let of = |s: &ResolvedShape| match s.first_volume() {
        Some(texture) => smallest_voxel(texture, &s.state.transform),
        None => s.state.world_bounds().size().length() / 256.0,
    };
    let least = shapes.iter().map(of).filter(|v| *v > 0.0 && v.is_finite()).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 1.0 }
}

/// The time of the fastest that keeps the goals.
fn fastest(fitted: &[Fitted]) -> Option<f64> {
    fitted.iter().filter(|f| f.kept).map(|f| f.seconds).min_by(f64::total_cmp)
}

/// The error where each action refuses one of the shapes.
fn nobody(shapes: &[Shape], all: &[Considered]) -> ActionError {
    let why = |c: &Considered| format!("{}: {}", c.setting, c.refused.clone().unwrap_or_default());
    ActionError::Unsupported {
        action: "planned".into(),
        shape: shapes.first().map(|s| s.name().to_owned()).unwrap_or_default(),
        what: format!("these shapes together ({})", all.iter().map(why).collect::<Vec<_>>().join("; ")),
        cure: "name an action in the option of that draws them all".into(),
    }
}

/// The fastest that keeps the goals; where none does, the one with the least error.
fn best(fitted: Vec<Fitted>, bound: Option<Bound>) -> Option<Fitted> {
    let error = |f: &Fitted| f.look.error(bound);
    let by_time = |a: &&Fitted, b: &&Fitted| a.seconds.total_cmp(&b.seconds);
    let by_error = |a: &&Fitted, b: &&Fitted| error(a).total_cmp(&error(b));
    let kept = fitted.iter().filter(|f| f.kept);
    let fastest = if bound.is_some() { kept.min_by(by_time) } else { kept.min_by(by_error) };
    fastest.or_else(|| fitted.iter().min_by(by_error)).cloned()
}

impl RenderAction for PlannedAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    /// What the first of the actions can.
    fn caps(&self) -> Caps {
        self.actors.first().map(|a| a.action.caps()).unwrap_or_default()
    }

    /// Manages a shape with every action that takes it; the others are not chosen for it.
    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.manage(shape, |_| Ok(()))?;
        let taken: Vec<_> = self.actors.iter_mut().map(|actor| actor.manage(shape)).collect();
        if taken.iter().all(Result::is_err) {
            let refused = taken.into_iter().find_map(Result::err);
            self.unmanage(shape)?;
            return refused.map_or(Ok(()), Err);
        }
        // Whoever draws the truth may refuse: then candidates are compared with themselves.
        _ = self.truth.as_mut().map(|truth| truth.manage(shape));
        Ok(())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)?;
        self.actors.iter_mut().chain(&mut self.truth).try_for_each(|actor| actor.unmanage(shape))
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        self.lifecycle.begin(frame, |_| Ok(()))?;
        self.drawn.clear();
        Ok(())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)?;
        self.drawn.push(shape.clone());
        Ok(())
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let shapes = std::mem::take(&mut self.drawn);
        let resolved: Vec<ResolvedShape> = open.drawn_shapes().cloned().collect();
        if self.goals.bound.is_some()
            && self.goals.time.is_some()
            && let Some(frame) = self.refined(&open.desc, &shapes, &resolved)?
        {
            return Ok(frame);
        }
        let plan = self.decide(&open.desc, &shapes, &resolved)?;
        self.execute(plan, &open.desc, &shapes)
    }

    /// Sets a goal, which the next frame is planned for anew, or an option of the actions, which no plan changes
    /// from then on.
    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.lifecycle.outside("set_option")?;
        let wrong = |problems| ActionError::Options { action: "planned".into(), problems };
        if self.declaration.parameter(name).is_some() {
            let mut given = self.given.clone();
            given.insert(name.into(), value);
            let resolved = self.declaration.resolve(&given, |_| false).map_err(wrong)?;
            let goals = Goals::read(&resolved).map_err(|problem| wrong(vec![problem]))?;
            (self.given, self.goals, self.kept) = (given, goals, None);
            return Ok(());
        }
        let mut declared = false;
        for actor in &mut self.actors {
            declared |= actor.give(name, &value)?;
        }
        self.find_candidates();
        // Somebody else's option is told as any unknown one.
        let unknown = || self.declaration.resolve(&Options::from([(name.to_owned(), value.clone())]), |_| false);
        if declared { Ok(()) } else { unknown().map(|_| ()).map_err(wrong) }
    }
}
