//! Holds the planner to its word: over a corpus of scenes of real volumes, each turned a little from frame to
//! frame, how often is the error kept that was asked for, and how much longer does a frame take than with the
//! best setting that an exhaustive search finds?
//!
//! ```text
//! VOLACT_DATA=… cargo run --release -p volact --example planner_corpus -- corpus.md
//! ```
//!
//! Further arguments: frames a scene (25), every how many-th frame all settings are tried (12), the first and the
//! last scene, and a seed of views, colours, bounds and sizes (1). The planner's margins were set with the seed 0.

use std::{
    error::Error,
    fmt::Write as _,
    path::{Path, PathBuf},
    time::Instant,
};

use volact::{
    core::planner::{Bound, errors::Errors, knobs},
    prelude::*,
    transfer,
};

/// The file of each volume.
const VOLUMES: [&str; 10] = [
    "tooth_ct/tooth.nhdr",
    "headsq_ct/quarter.nhdr",
    "engine_ct/engine.nii.gz",
    "bonsai_ct/bonsai.nii.gz",
    "heptane_sim/heptane.nii.gz",
    "fuel_sim/fuel.nii.gz",
    "iron_protein/ironProt.vtk",
    "head_mr/HeadMRVolume.mhd",
    "nuclei_microscopy/nuclei.tif",
    "stroke_mri",
];

/// Looks of each volume.
const LOOKS: [&str; 4] = ["automatic", "peaks", "fog", "lit"];

/// What is asked for, in turns.
const BOUNDS: [Bound; 4] =
    [Bound::MaxError(0.5 / 255.0), Bound::Rmse(0.25 / 255.0), Bound::MaxError(2.0 / 255.0), Bound::Rmse(0.05 / 255.0)];

/// Sizes of pictures, in turns.
const SIZES: [[usize; 2]; 5] = [[256, 256], [320, 200], [192, 256], [400, 300], [256, 128]];

/// Steps of the exhaustive search, in smallest voxels.
const STEPS: [f64; 8] = [8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625];

/// The step that errors are taken from, in smallest voxels.
const TRUTH: f64 = 1.0 / 128.0;

type Failed = Box<dyn Error>;

/// Numbers that look like chance and are the same each time: SplitMix64 (G. Steele, D. Lea, C. Flood, 2014).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// A scene of the corpus.
struct Scene {
    name: String,
    shape: Shape,
    bound: Bound,
    size: [usize; 2],
    voxel: f64,
    /// Azimuth and elevation of the first frame, their changes, distance or height in radii, field of view.
    view: [f64; 6],
    perspective: bool,
}

impl Scene {
    fn new(registry: &Registry, data: &Path, (number, seed): (usize, usize)) -> Result<Self, Failed> {
        let (file, look) = (VOLUMES[number / LOOKS.len()], LOOKS[number % LOOKS.len()]);
        let path = data.join(file);
        let path = if path.is_dir() { first_file(&path)? } else { path };
        let volume = registry.load(&path)?;
        let mut chance = Chance((number + 1000 * seed) as u64);
        let shape = shape(&volume, look, &mut chance)?;
        let texture = shape.state().volume().cloned().ok_or("no volume")?;
        let voxel = volact::core::shape::smallest_voxel(&texture, &shape.state().transform);
        let mut between = |low, high| chance.between(low, high);
        let view = [
            between(0.0, 360.0),
            between(-60.0, 60.0),
            between(1.0, 5.0),
            between(-1.0, 1.0),
            between(0.7, 1.6),
            between(20.0, 60.0),
        ];
        let stem = file.split('/').next().unwrap_or(file);
        let (bound, size) = (BOUNDS[(number + number / 4 + seed) % BOUNDS.len()], SIZES[(number + seed) % SIZES.len()]);
        Ok(Self {
            name: format!("{stem} {look}"),
            shape,
            bound,
            size,
            voxel,
            view,
            perspective: !number.is_multiple_of(3),
        })
    }

    fn frame(&self, number: usize) -> FrameDesc {
        let [azimuth, elevation, turn, rise, reach, fov] = self.view;
        let bounds = self.shape.state().world_bounds();
        let (middle, radius) = (0.5 * (bounds.min + bounds.max), 0.5 * (bounds.max - bounds.min).length());
        let (a, e) = ((azimuth + turn * number as f64).to_radians(), (elevation + rise * number as f64).to_radians());
        let direction = DVec3::new(a.cos() * e.cos(), a.sin() * e.cos(), e.sin());
        let camera = if self.perspective {
            let away = radius * reach / (0.5 * fov).to_radians().sin();
            Camera::perspective(middle + direction * away, middle, DVec3::Z, fov)
        } else {
            Camera::orthographic(middle + direction * 3.0 * radius, middle, DVec3::Z, 2.0 * radius * reach)
        };
        FrameDesc::new(camera, self.size[0], self.size[1])
    }
}

fn first_file(folder: &Path) -> Result<PathBuf, Failed> {
    let mut files: Vec<_> = std::fs::read_dir(folder)?.filter_map(|f| Some(f.ok()?.path())).collect();
    files.retain(|p| p.to_string_lossy().ends_with(".nii.gz"));
    files.sort();
    files.into_iter().next().ok_or_else(|| format!("{}: no volume", folder.display()).into())
}

fn shape(volume: &Volume, look: &str, chance: &mut Chance) -> Result<Shape, Failed> {
    let automatic = transfer::automatic(volume);
    if look == "automatic" {
        return Ok(automatic.shape(volume));
    }
    let texture = VolumeTexture::new(volume);
    let points = automatic.table.as_ref().map(|t| t.points(texture.range())).unwrap_or_default();
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Err("no table".into()) };
    let (low, high) = (first.value, last.value);
    let unit = volact::core::shape::smallest_voxel(&texture, &DAffine3::IDENTITY);
    let mut color = || [chance.next(), chance.next(), chance.next()];
    let clear = |value: f64, color| ControlPoint { value, color, opacity: 0.0 };
    let mut table = Vec::new();
    match look {
        "peaks" => {
            for i in 0..3 {
                let (middle, width, color) =
                    (low + (high - low) * (0.25 * f64::from(i) + 0.3), 0.03 * (high - low), color());
                table.extend([
                    clear(middle - width, color),
                    ControlPoint { value: middle, color, opacity: 0.4 },
                    clear(middle + width, color),
                ]);
            }
        }
        "fog" => table.extend([clear(low, color()), ControlPoint { value: high, color: color(), opacity: 0.05 }]),
        _ => {
            let start = low + 0.3 * (high - low);
            table.extend([
                clear(start, color()),
                ControlPoint { value: start + 0.2 * (high - low), color: color(), opacity: 0.3 },
                ControlPoint { value: high, color: color(), opacity: 0.6 },
            ]);
        }
    }
    let shader = if look == "lit" { "gradient" } else { "lut" };
    let appearance = Appearance::new(shader)
        .with("volume", texture.clone())
        .with("lookup_table", LookupTable::from_points(table)?)
        .with("unit_distance", unit);
    Ok(Shape::around_texture(&texture, appearance))
}

/// What a bound is about, of a picture against the truth.
fn error(bound: Bound, errors: &Errors) -> f64 {
    match bound {
        Bound::MaxError(_) => errors.worst.first().copied().unwrap_or(0.0),
        Bound::Rmse(_) => errors.rmse,
    }
}

fn draw(action: &mut dyn RenderAction, shape: &Shape, desc: &FrameDesc) -> Result<(Frame, f64), Failed> {
    let started = Instant::now();
    action.begin_draw(desc)?;
    action.draw(shape)?;
    let frame = action.end_draw()?;
    Ok((frame, started.elapsed().as_secs_f64()))
}

fn managing(registry: &Registry, name: &str, options: Options, shape: &Shape) -> Result<Box<dyn RenderAction>, Failed> {
    let mut action = registry.action(name, &options)?;
    action.manage(shape)?;
    Ok(action)
}

/// What came of a scene.
#[derive(Default)]
struct Outcome {
    frames: usize,
    kept: usize,
    /// Bounds that were said not to be kept.
    told: usize,
    misses: Vec<String>,
    /// Error over bound, of frames, and over what was expected.
    used: Vec<f64>,
    expected: Vec<f64>,
    drawing: f64,
    planning: f64,
    first: f64,
    /// Seconds of drawing and planning without the first frame.
    later: [f64; 2],
    changes: usize,
    /// Time over that of the best setting of all: of the drawing alone, and with the planning.
    ratios: Vec<[f64; 2]>,
}

/// The fastest of three frames of each setting, with the least time of those that keep the bound.
fn exhaustive(
    action: &mut dyn RenderAction,
    scene: &Scene,
    desc: &FrameDesc,
    (truth, chosen): (&Frame, &Options),
) -> Result<Option<[f64; 2]>, Failed> {
    let choices = knobs::candidates(action.declaration(), &Options::new());
    let mut settings = vec![chosen.clone()];
    for choice in &choices {
        for (step, termination) in STEPS.iter().flat_map(|s| [(s, None), (s, Some(0.05))]) {
            let mut options = choice.clone();
            options.insert(knobs::STEP.into(), (step * scene.voxel).into());
            options.extend(termination.map(|t: f64| ("termination".to_owned(), t.into())));
            settings.push(options);
        }
    }
    let (mut best, mut own) = (f64::INFINITY, f64::INFINITY);
    for (number, options) in settings.iter().enumerate() {
        action.set_option("termination", (1.0 / 255_000.0).into())?;
        options.iter().try_for_each(|(name, value)| action.set_option(name, value.clone()))?;
        let (frame, _) = draw(action, &scene.shape, desc)?;
        let keeps = error(scene.bound, &Errors::between(&frame.color, &truth.color)) <= scene.bound.value();
        if number > 0 && !keeps {
            continue;
        }
        let mut least = f64::INFINITY;
        for _ in 0..3 {
            least = least.min(draw(action, &scene.shape, desc)?.1);
        }
        if number == 0 { own = least } else { best = best.min(least) }
    }
    Ok(best.is_finite().then_some([own, best]))
}

fn run(registry: &Registry, scene: &Scene, frames: usize, every: usize) -> Result<Outcome, Failed> {
    let goal = match scene.bound {
        Bound::MaxError(e) => ("max_error".to_owned(), e.into()),
        Bound::Rmse(e) => ("rmse".to_owned(), e.into()),
    };
    let mut planned = managing(registry, "planned", Options::from([goal]), &scene.shape)?;
    let fine = Options::from([
        (knobs::STEP.to_owned(), (TRUTH * scene.voxel).into()),
        ("termination".to_owned(), 0.0.into()),
        ("classification".to_owned(), ParameterValue::from("post")),
    ]);
    let mut truth = managing(registry, "cpu", fine, &scene.shape)?;
    let mut search = managing(registry, "cpu", Options::new(), &scene.shape)?;
    let mut found = Outcome::default();
    let mut before = None;
    for number in 0..frames {
        let desc = scene.frame(number);
        let (frame, seconds) = draw(planned.as_mut(), &scene.shape, &desc)?;
        let (true_frame, _) = draw(truth.as_mut(), &scene.shape, &desc)?;
        let plan = frame.plan.clone().ok_or("no plan")?;
        let errors = Errors::between(&frame.color, &true_frame.color);
        let error = error(scene.bound, &errors);
        let planning = plan.planning.as_secs_f64();
        found.frames += 1;
        found.used.push(error / scene.bound.value());
        found.expected.push(
            error
                / match scene.bound {
                    Bound::MaxError(_) => plan.max_error,
                    Bound::Rmse(_) => plan.rmse,
                },
        );
        if error <= scene.bound.value() {
            found.kept += 1;
        } else if !plan.kept {
            found.told += 1;
        } else {
            found.misses.push(format!(
                "{} frame {number}: {:.1e} of {}, {}",
                scene.name,
                error,
                asked(scene.bound),
                plan.setting
            ));
        }
        if number == 0 {
            found.first = planning / (seconds - planning);
        } else {
            found.later = [found.later[0] + seconds - planning, found.later[1] + planning];
        }
        found.drawing += seconds - planning;
        found.planning += planning;
        found.changes += usize::from(before.as_ref().is_some_and(|b| *b != plan.options));
        if number % every == every / 2
            && let Some([own, best]) = exhaustive(search.as_mut(), scene, &desc, (&true_frame, &plan.options))?
        {
            found.ratios.push([own / best, (own + planning) / best]);
        }
        before = Some(plan.options);
    }
    Ok(found)
}

/// A bound in words.
fn asked(bound: Bound) -> String {
    match bound {
        Bound::MaxError(e) => format!("max {e:.1e}"),
        Bound::Rmse(e) => format!("rmse {e:.1e}"),
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}

fn row(name: &str, bound: &str, o: &Outcome) -> String {
    let ratio = |i: usize| median(o.ratios.iter().map(|r| r[i]));
    let most = o.used.iter().fold(0.0, |m: f64, v| m.max(*v));
    format!(
        "| {name} | {bound} | {} of {} | {} | {:.2} | {most:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} % | {:.0} % | {:.1} % | {} |\n",
        o.kept,
        o.frames,
        o.told,
        median(o.used.iter().copied()),
        median(o.expected.iter().copied()),
        o.expected.iter().fold(0.0, |m: f64, v| m.max(*v)),
        ratio(0),
        ratio(1),
        100.0 * o.planning / o.drawing,
        100.0 * o.first,
        100.0 * o.later[1] / o.later[0],
        o.changes
    )
}

fn main() -> Result<(), Failed> {
    let data = PathBuf::from(std::env::var("VOLACT_DATA").map_err(|_| "set VOLACT_DATA to the folder of the data")?);
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let output = arguments.first().ok_or("name a file for the table")?;
    let number = |i: usize, or: usize| arguments.get(i).map_or(Ok(or), |text| text.parse::<usize>());
    let (frames, every) = (number(1, 25)?, number(2, 12)?.max(1));
    let (first, last) = (number(3, 0)?, number(4, VOLUMES.len() * LOOKS.len() - 1)?);
    let seed = number(5, 1)?;
    let registry = Registry::with_builtins();
    let mut text = String::from(
        "| scene | asked for | kept | told not | error / bound, median | most | error / expected, median | most | time / best | with planning | planning | at first | after it | changes |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut all = Outcome::default();
    for i in first..=last {
        let scene = Scene::new(&registry, &data, (i, seed))?;
        let found = run(&registry, &scene, frames, every)?;
        let line = row(&scene.name, &asked(scene.bound), &found);
        print!("{line}");
        text += &line;
        all.frames += found.frames;
        all.kept += found.kept;
        all.told += found.told;
        all.drawing += found.drawing;
        all.planning += found.planning;
        all.later = [0, 1].map(|i| all.later[i] + found.later[i]);
        all.first += found.first / (last + 1 - first) as f64;
        all.changes += found.changes;
        all.used.extend(found.used);
        all.expected.extend(found.expected);
        all.ratios.extend(found.ratios);
        all.misses.extend(found.misses);
    }
    let line = row("all", "", &all);
    print!("{line}");
    text += &line;
    if !all.misses.is_empty() {
        text += "\nMisses:\n\n";
        all.misses.iter().try_for_each(|miss| writeln!(text, "- {miss}"))?;
    }
    let temporary = format!("{output}.part");
    std::fs::write(&temporary, text)?;
    std::fs::rename(temporary, output)?;
    Ok(())
}
