//! Draws settings in turns: their times, and their true errors in f32 before any rounding to bytes.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::{Duration, Instant},
};

use sha2::{Digest, Sha256};
use volact_core::{ActionError, Frame, Registry, RenderAction};

use super::{
    Point,
    axes::{self, Setting},
    rows::{Row, Rows, RowsError},
    truth::Truth,
};
use crate::{
    metrics::{max_error, percentile_error, rms_error, wide},
    report,
    rig::{Scene, draw, draw_managed},
    truth::chain,
};

/// How much is drawn.
#[derive(Clone, Debug)]
pub struct Effort {
    /// Frames that count, of each setting.
    pub frames: usize,
    /// Frames before those, besides the first.
    pub warm_up: usize,
    /// Settings that are drawn in turns.
    pub together: usize,
    /// Time of one setting's frames after which no more are drawn of it; one counts at least.
    pub each: Duration,
    /// When to begin nothing more.
    pub deadline: Option<Instant>,
}

impl Effort {
    fn over(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

/// A scene that is measured on a machine.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// The actions.
    pub registry: &'a Registry,
    /// The scene.
    pub scene: &'a Scene,
    /// Its true picture.
    pub truth: &'a Truth,
    /// The machine's name.
    pub machine: &'a str,
    /// How much is drawn.
    pub effort: &'a Effort,
}

/// Measures settings that no row is about yet. `told` hears of each before it is drawn, by its place
/// in the list. Returns whether all are measured; not where the time was over.
///
/// # Errors
/// If a row cannot be written.
pub fn measure(
    job: Job<'_>,
    settings: &[Setting],
    rows: &mut Rows,
    mut told: impl FnMut(usize, &Setting),
) -> Result<bool, RowsError> {
    let keyed: Vec<_> = settings.iter().enumerate().map(|(i, s)| (i, s, key(job, s))).collect();
    let open: Vec<_> = keyed.into_iter().filter(|(.., key)| !rows.has(key)).collect();
    let mut seen = Seen::of(rows);
    for batch in open.chunks(job.effort.together.max(1)) {
        let mut runs = Vec::new();
        for (i, setting, key) in batch {
            if job.effort.over() {
                return finish(job, runs, rows).map(|_| false);
            }
            told(*i, setting);
            match start(job, setting, key, &mut seen) {
                Ok(run) => runs.push(run),
                Err(why) => rows.add(left_out(key, setting, why))?,
            }
        }
        if !finish(job, runs, rows)? {
            return Ok(false);
        }
    }
    Ok(true)
}

fn left_out(key: &str, setting: &Setting, why: String) -> Row {
    Row::LeftOut { key: key.into(), what: [setting.action.clone(), setting.label(), why] }
}

/// A setting on its way.
struct Run<'a> {
    key: &'a str,
    setting: &'a Setting,
    action: Box<dyn RenderAction>,
    first: Duration,
    times: Vec<Duration>,
    frame: Frame,
}

/// A frame that was drawn: one more of it is no news.
struct Seen {
    action: String,
    label: String,
    content: String,
}

impl Seen {
    /// Those of an earlier run.
    fn of(rows: &Rows) -> Vec<Self> {
        let seen = |row: &Row| match row {
            Row::Point(p) => {
                let (action, content) = (p.action.clone(), p.content.clone());
                Some(Self { action, label: axes::label(&p.series, p.step), content })
            }
            Row::LeftOut { .. } => None,
        };
        rows.rows.iter().filter_map(seen).collect()
    }
}

/// Scene, method and bits of a frame.
fn content(job: Job<'_>, frame: &Frame) -> String {
    let mut hash = Sha256::new();
    hash.update(format!("{} {}", job.truth.key, report::method(&frame.method)));
    frame.color.iter().flatten().for_each(|v| hash.update(v.to_bits().to_le_bytes()));
    hex(&hash.finalize())
}

fn hex(digest: &[u8]) -> String {
    digest.iter().take(16).map(|b| format!("{b:02x}")).collect()
}

/// The first frame, and those that warm up; why there is none.
fn start<'a>(job: Job<'_>, setting: &'a Setting, key: &'a str, seen: &mut Vec<Seen>) -> Result<Run<'a>, String> {
    let made = || job.registry.action(&setting.action, &setting.options);
    let mut action = caught(made)?;
    let began = Instant::now();
    let frame = caught(|| draw(&mut *action, &job.scene.shapes, &job.scene.desc))?;
    let first = began.elapsed();
    let content = content(job, &frame);
    if let Some(known) = seen.iter().find(|s| s.action == setting.action && s.content == content) {
        return Err(format!("the same method and the same bits as {}", known.label));
    }
    seen.push(Seen { action: setting.action.clone(), label: setting.label(), content });
    let mut run = Run { key, setting, action, first, times: Vec::new(), frame };
    for _ in 0..job.effort.warm_up {
        if run.first > job.effort.each {
            break;
        }
        run.draw(job)?;
    }
    run.times.clear();
    Ok(run)
}

impl Run<'_> {
    fn draw(&mut self, job: Job<'_>) -> Result<(), String> {
        let began = Instant::now();
        let action = &mut *self.action;
        self.frame = caught(|| draw_managed(action, &job.scene.shapes, &job.scene.desc))?;
        self.times.push(began.elapsed());
        Ok(())
    }

    /// Whether another frame is wanted.
    fn goes_on(&self, effort: &Effort) -> bool {
        self.times.is_empty()
            || self.times.len() < effort.frames && self.times.iter().sum::<Duration>() < effort.each && !effort.over()
    }
}

/// Frames in turns, then a row of each. Returns whether there was time for all.
fn finish(job: Job<'_>, mut runs: Vec<Run<'_>>, rows: &mut Rows) -> Result<bool, RowsError> {
    let mut failed = Vec::new();
    while runs.iter().any(|run| run.goes_on(job.effort)) {
        for i in (0..runs.len()).rev() {
            if runs[i].goes_on(job.effort)
                && let Err(why) = runs[i].draw(job)
            {
                let run = runs.remove(i);
                failed.push(left_out(run.key, run.setting, why));
            }
        }
    }
    for row in failed {
        rows.add(row)?;
    }
    for run in runs {
        rows.add(Row::Point(Box::new(point(job, &run))))?;
    }
    Ok(!job.effort.over())
}

fn point(job: Job<'_>, run: &Run<'_>) -> Point {
    let mut seconds: Vec<f64> = run.times.iter().map(Duration::as_secs_f64).collect();
    seconds.sort_by(f64::total_cmp);
    let (frame, found) = (&run.frame, wide(&run.frame));
    let off = |error: f64| Some(if error.is_finite() { error } else { f64::MAX });
    let truth = &job.truth.color;
    Point {
        key: run.key.into(),
        content: content(job, frame),
        machine: job.machine.into(),
        action: run.setting.action.clone(),
        series: run.setting.series.clone(),
        settings: run.setting.words(),
        step: run.setting.step,
        median_s: quantile(&seconds, 0.5),
        quartiles_s: [0.25, 0.75].map(|q| quantile(&seconds, q)),
        least_s: seconds[0],
        first_s: run.first.as_secs_f64(),
        frames: seconds.len(),
        max: off(max_error(&found, truth)),
        rmse: off(rms_error(&found, truth)),
        p99: off(percentile_error(&found, truth, 0.99)),
        samples: frame.statistics.samples,
        resident_bytes: frame.statistics.resident_bytes,
        method: report::method(&frame.method),
        device: frame.method.device.clone(),
        picture: report::over_black(frame.width, frame.height, &frame.color).ok(),
        difference: report::decades(frame.width, frame.height, &found, truth).ok(),
    }
}

/// Linear between the two nearest of some rising numbers, of which there is one at least.
pub fn quantile(rising: &[f64], q: f64) -> f64 {
    let at = q * (rising.len() - 1) as f64;
    let below = at as usize;
    let above = (below + 1).min(rising.len() - 1);
    rising[below] + (rising[above] - rising[below]) * at.fract()
}

/// What an action answers; a panic is an answer, too.
fn caught<T>(call: impl FnOnce() -> Result<T, ActionError>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(answer) => answer.map_err(|e| chain(&e)),
        Err(_) => Err("the action panicked".into()),
    }
}

/// What a row is about: scene, machine, setting and effort.
pub fn key(job: Job<'_>, setting: &Setting) -> String {
    let words =
        format!("{} {} {} {:?} {}", job.truth.key, job.machine, setting.action, setting.words(), job.effort.frames);
    hex(&Sha256::digest(words))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        cases::stock::{around, usual, warm},
        chart::{axes::settings, truth::truth},
        rig::registry,
        scene::lut,
    };
    use volact_core::{Options, ParameterValue};

    #[test]
    fn finer_steps_err_less_and_an_interrupted_run_goes_on() {
        let registry = registry();
        let scene = around([lut(&usual(), warm(), 1.0)]);
        let truth = truth(&registry, &scene.shapes, &scene.desc, None).unwrap();
        let path = std::env::temp_dir().join(format!("volact-measure-{}.jsonl", std::process::id()));
        let mut effort =
            Effort { frames: 3, warm_up: 1, together: 2, each: Duration::from_secs(9), deadline: Some(Instant::now()) };
        let declared = registry.declarations().into_iter().find(|d| d.name == "cpu").unwrap().clone();
        let given = Options::from([("classification".to_owned(), ParameterValue::Choice("post".into()))]);
        let all = settings(&declared, &given, &[1.0, 0.25]);
        let mut rows = Rows::open(&path).unwrap();
        let run = |rows: &mut Rows, effort: &Effort| {
            let job = Job { registry: &registry, scene: &scene, truth: &truth, machine: "m", effort };
            let mut drawn = Vec::new();
            (measure(job, &all, rows, |i, _| drawn.push(i)).unwrap(), drawn)
        };
        assert_eq!(run(&mut rows, &effort), (false, vec![]), "no time is no work");
        effort.deadline = None;
        assert_eq!(run(&mut rows, &effort).1.len(), all.len());
        drop(rows);
        let mut rows = Rows::open(&path).unwrap();
        assert_eq!(run(&mut rows, &effort), (true, vec![]), "all is there");
        let points: Vec<_> =
            rows.rows.iter().filter_map(|r| if let Row::Point(p) = r { Some(p) } else { None }).collect();
        assert_eq!((points[0].series.as_str(), points[0].step, points[0].frames), ("cpu", Some(1.0), 3));
        let [coarse, fine] = [points[0], points[1]].map(|p| p.rmse.unwrap());
        assert!(fine < coarse / 8.0 && fine > 0.0, "{coarse} {fine}");
        for p in points {
            assert!(p.rmse <= p.max && p.p99 <= p.max && p.picture.is_some() && p.difference.is_some());
            assert!(p.least_s <= p.quartiles_s[0] && p.quartiles_s[0] <= p.median_s && p.median_s <= p.quartiles_s[1]);
        }
        rows.finish();
    }
}
