//! A scene of a chart: its settings, its truth, and what was measured of it.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use anyhow::{Context as _, bail};
use volact::{
    Options, Registry,
    core::{Declaration, parameter::Kind, resolve::ResolvedShape, select::can_draw},
};
use volact_conformance::{
    chart::{
        SceneChart,
        axes::{self, Setting as Drawn},
        machine,
        measure::{self, Effort, Job},
        rows::{Row, Rows},
        truth::{self, Truth},
    },
    rig::Scene,
    tolerance::Sizes,
    truth::chain,
};

use super::{
    super::{progress::Line, settings, source::Opened},
    Args,
};

/// A scene that is measured.
pub struct Subject {
    name: String,
    scene: Scene,
    truth: Truth,
    settings: Vec<Drawn>,
    left_out: Vec<[String; 3]>,
}

impl Subject {
    /// Reads the scene, finds what is to be measured, and has its true picture drawn.
    ///
    /// # Errors
    /// If it cannot be read, no action draws it, or the reference does not.
    pub fn open(args: &Args, input: &Path, name: String, registry: &Registry) -> anyhow::Result<Self> {
        let mut opened = args.source(input).open(registry)?;
        let frame = &mut opened.scene.frame;
        if args.size.is_none() && frame.viewport.is_none() && frame.opaque.is_none() {
            let longer = frame.width.max(frame.height);
            let fit = |side: usize| if longer > 256 { (side * 256).div_ceil(longer) } else { side };
            (frame.width, frame.height) = (fit(frame.width), fit(frame.height));
        }
        let scene = Scene::new(opened.scene.shapes.iter().cloned(), opened.scene.frame.clone());
        let voxel = Sizes::of(&scene.shapes).voxel;
        let steps: Vec<f64> = args.steps.iter().map(|h| h * voxel).collect();
        let (settings, left_out) = settings(args, &opened, &scene, &steps, registry)?;
        if settings.is_empty() {
            let why: Vec<_> = left_out.iter().map(|[action, _, why]| format!("{action}: {why}")).collect();
            bail!("{}: no action draws it: {}", input.display(), why.join("; "));
        }
        let _line = Line::new(format!("{name}: the reference"));
        let folder = args.cache.clone().or_else(|| Some(settings::cache()?.join("truth")));
        let truth = truth::truth(registry, &scene.shapes, &scene.desc, folder.as_deref());
        let truth = truth.map_err(anyhow::Error::msg).with_context(|| format!("{}: has no truth", input.display()))?;
        log::info!("{name}: the true picture {}", if truth.kept { "was kept" } else { "was made" });
        Ok(Self { name, scene, truth, settings, left_out })
    }

    /// Measures what no row is about yet. Returns also whether there was time for all.
    ///
    /// # Errors
    /// If a row cannot be written.
    pub fn measure(
        self,
        args: &Args,
        registry: &Registry,
        rows: &mut Rows,
        deadline: Option<Instant>,
    ) -> anyhow::Result<(SceneChart, bool)> {
        let effort = Effort {
            frames: args.frames as usize,
            warm_up: args.warm_up as usize,
            together: 6,
            each: Duration::from_secs_f64(args.each),
            deadline,
        };
        let machine = args.machine.clone().unwrap_or_else(machine::name);
        let job = Job { registry, scene: &self.scene, truth: &self.truth, machine: &machine, effort: &effort };
        let line = Line::new(format!("{}: measuring", self.name));
        let done = measure::measure(job, &self.settings, rows, |i, setting| {
            let what = format!("{}: {}", self.name, setting.label());
            log::info!("{what}");
            line.count(&what, i as u64, self.settings.len() as u64);
        })?;
        let mut chart = SceneChart {
            name: self.name,
            key: self.truth.key.clone(),
            width: self.scene.desc.width,
            height: self.scene.desc.height,
            truth: self.truth.note.clone(),
            points: Vec::new(),
            left_out: self.left_out,
        };
        for setting in &self.settings {
            let key = measure::key(job, setting);
            match rows.rows.iter().find(|row| row.key() == key) {
                Some(Row::Point(point)) => chart.points.push((**point).clone()),
                Some(Row::LeftOut { what, .. }) => chart.left_out.push(what.clone()),
                None => chart.left_out.push([setting.action.clone(), setting.label(), "the budget ended".into()]),
            }
        }
        Ok((chart, done))
    }
}

/// Settings of all actions, in turns: the first of each, then the second; and actions that cannot draw.
fn settings(
    args: &Args,
    opened: &Opened,
    scene: &Scene,
    steps: &[f64],
    registry: &Registry,
) -> anyhow::Result<(Vec<Drawn>, Vec<[String; 3]>)> {
    let declared: Vec<&Declaration> = registry.declarations().into_iter().filter(|d| d.kind == Kind::Action).collect();
    let names: Vec<String> = match args.actions.as_slice() {
        [] => declared.iter().map(|d| d.name.clone()).collect(),
        named => named.to_vec(),
    };
    for option in opened.options.keys() {
        if !declared.iter().any(|d| names.contains(&d.name) && d.parameter(option).is_some()) {
            bail!("no action that is measured has an option {option:?}");
        }
    }
    let (mut each, mut left_out) = (Vec::new(), Vec::new());
    for name in &names {
        let Some(declaration) = declared.iter().find(|d| d.name == *name) else {
            registry.action(name, &Options::new()).with_context(|| format!("action {name:?} cannot be measured"))?;
            continue;
        };
        let given = opened.options.iter().filter(|(option, _)| declaration.parameter(option).is_some());
        let given = given.map(|(option, value)| (option.clone(), value.clone())).collect();
        let given = opened.config.options_of(name, &given);
        match cannot(declaration, &given, args, scene, registry) {
            None => each.push(axes::settings(declaration, &given, steps).into_iter()),
            Some(why) if args.actions.is_empty() => left_out.push([name.clone(), String::new(), why]),
            Some(why) => bail!("action {name:?} cannot be measured: {why}"),
        }
    }
    let mut all = Vec::new();
    while !each.is_empty() {
        each.retain_mut(|settings| settings.next().map(|setting| all.push(setting)).is_some());
    }
    Ok((all, left_out))
}

/// Why an action is not measured.
fn cannot(
    declaration: &Declaration,
    given: &Options,
    args: &Args,
    scene: &Scene,
    registry: &Registry,
) -> Option<String> {
    let unasked = args.actions.is_empty();
    if unasked && declaration.name == volact_cpu::reference::declaration().name {
        return Some("it is the truth; --action reference measures its lattices".into());
    }
    if unasked && declaration.parameter("of").is_some() {
        return Some("it wraps another action".into());
    }
    let mut action = match registry.action(&declaration.name, given) {
        Ok(action) => action,
        Err(error) => return Some(chain(&error)),
    };
    let resolved =
        scene.shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders())).collect::<Result<Vec<_>, _>>();
    let able = resolved.map_err(|e| chain(&e)).and_then(|shapes| can_draw(&action.caps(), &shapes));
    let able = able.and_then(|()| scene.shapes.iter().try_for_each(|s| action.manage(s)).map_err(|e| chain(&e)));
    able.err()
}
