//! `volact render --watch`: draws anew whenever a file changes that the picture depends on.
//!
//! `events` says that something may have changed, `files` says what did, and `session` draws and
//! redoes only what depends on it. An edit that cannot be drawn shows its error and leaves the last
//! picture as it is. Files are looked at before they are read, so that no change is missed.

mod events;
mod files;
mod session;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use anyhow::bail;
use volact::{Frame, FrameExt as _, Registry};

use super::{
    print_error,
    render::Args,
    report::{self, Report, time},
};
use events::Events;
use files::Snapshot;
use session::Session;

/// How long a file may be away while an editor replaces it, before that is an error.
const AWAY: Duration = Duration::from_millis(500);

/// Draws until the user ends it.
///
/// # Errors
/// If what the command line says can never be drawn.
pub fn run(args: &Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let output = args.output()?;
    let png = args.png(&output)?;
    if !args.source.input.exists() {
        bail!("{}: is not there, wanted a scene or data to watch", args.source.input.display());
    }
    let mut session = Session::new(args, registry);
    let mut events = Events::new();
    let mut roots = session.roots();
    let mut seen = Snapshot::default();
    let mut refining = false;
    loop {
        let start = Instant::now();
        let changed = Snapshot::take(&roots, &output) != seen;
        let looking = start.elapsed();
        if changed {
            wait_for_the_lost(&roots, &output, &seen);
            roots = session.roots();
            let now = Snapshot::take(&roots, &output);
            if now.holds(&output) {
                bail!("{}: is what is drawn from; give the picture another name with -o", output.display());
            }
            // From here on, what changes is noticed, and drawn after this.
            events.watch(now.folders());
            let changed = now.changes(&seen);
            let start = Instant::now();
            match session.draw(|path| now.same(&seen, path)).and_then(|frame| {
                frame.save_with(&output, png)?;
                Ok(frame)
            }) {
                Ok(frame) => {
                    tell(&session, &frame, &output, (&changed, start.elapsed(), first(&seen)))?;
                    refining = is_refining(&frame);
                }
                Err(error) => {
                    complain(&error, session.drawn());
                    refining = false;
                }
            }
            if first(&seen) {
                say(&format!("watching {}; Ctrl-C ends", now.summary()));
            }
            seen = now;
        } else if refining {
            refining = refine(&mut session, |frame| Ok(frame.save_with(&output, png)?))?;
        }
        if refining {
            continue;
        }
        // Where the system tells of nothing (network folders), looking from time to time does.
        events.wait(Duration::from_secs(1).max(20 * looking));
    }
}

/// Whether a finer picture follows if nothing changes.
fn is_refining(frame: &Frame) -> bool {
    frame.plan.as_ref().is_some_and(|plan| plan.refining)
}

/// Draws and keeps the next finer picture; whether another one follows.
fn refine(session: &mut Session, save: impl Fn(&Frame) -> anyhow::Result<()>) -> anyhow::Result<bool> {
    let drawn = session.refine().and_then(|frame| frame.as_ref().map(&save).transpose().map(|_| frame));
    match drawn {
        Ok(Some(frame)) => {
            if !is_refining(&frame) {
                frame.plan.iter().for_each(|plan| say(&format!("refined: {}", report::plan(plan))));
            }
            Ok(is_refining(&frame))
        }
        Ok(None) => Ok(false),
        Err(error) => {
            complain(&error, session.drawn());
            Ok(false)
        }
    }
}

fn first(seen: &Snapshot) -> bool {
    *seen == Snapshot::default()
}

/// Editors that replace a file may have it away for a moment.
fn wait_for_the_lost(roots: &BTreeSet<files::Root>, output: &Path, seen: &Snapshot) {
    let start = Instant::now();
    while Snapshot::take(roots, output).lost(seen) && start.elapsed() < AWAY {
        thread::sleep(Duration::from_millis(20));
    }
}

/// Says that there is a new picture.
fn tell(
    session: &Session,
    frame: &Frame,
    output: &Path,
    (changed, took, first): (&[PathBuf], Duration, bool),
) -> anyhow::Result<()> {
    let Some(source) = session.source() else { return Ok(()) };
    let report = Report { source, frame, output };
    report.warn();
    if session.args().json {
        return super::print(&format!("{}\n", report.to_json()));
    }
    if first && !super::quiet() {
        return super::print(&report.to_text());
    }
    let mut anew: Vec<_> = frame.statistics.rebuilt.iter().map(|r| r.what.as_str()).collect();
    anew.dedup();
    let anew = if anew.is_empty() { "nothing".into() } else { anew.join(", ") };
    say(&format!("drawn in {} after {}; made anew: {anew}", time(took), names(changed)));
    Ok(())
}

fn complain(error: &anyhow::Error, drawn: bool) {
    print_error(error);
    say(if drawn { "the last picture stays; waiting for the next change" } else { "waiting for a change" });
}

/// The names of files, or how many.
fn names(changed: &[PathBuf]) -> String {
    let name = |path: &PathBuf| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    match changed {
        [] => "a change of the files in use".into(),
        few if few.len() <= 3 => few.iter().map(name).collect::<Vec<_>>().join(", ") + " changed",
        many => format!("{} files changed", many.len()),
    }
}

fn say(text: &str) {
    if !super::quiet() {
        eprintln!("{text}");
    }
}
