//! What calls through the plugin boundary cost: `cargo bench -p volact-cpu-plugin`.
//!
//! - A frame of 512² pixels by `cpu`, called directly, linked through the entry and loaded as a library, in turns:
//!   the ratio of each round, its median and quartiles. Only ratios of the same round are compared, so that a
//!   machine that is busy now and then does not decide.
//! - The same with a picture of 8² pixels: little more than the calls themselves, in microseconds.
//! - Loading the library, each time in a process of its own, since a library stays loaded; and what `volact
//!   describe` asks for.

use std::{
    env,
    hint::black_box,
    process::Command,
    time::{Duration, Instant},
};

use volact_core::{
    Appearance, FrameDesc, LookupTable, Options, Registry, RenderAction, ScalarType, Shape, View, Volume, VolumeDesc,
    plugin::host::{self, Search, Wanted},
};

const ROUNDS: usize = 101;

/// The library that was built with this program lies beside it.
#[expect(unsafe_code, reason = "loading a library runs its code")]
fn loaded() -> Registry {
    let program = env::current_exe().unwrap();
    let wanted = vec![Wanted { name: "volact-cpu-plugin".into(), sha256: None }];
    let search = Search { folders: vec![program.parent().unwrap().to_owned()], wanted, ..Search::default() };
    let mut registry = Registry::with_core();
    // SAFETY: the library is this package.
    unsafe { host::load(&search, &mut registry) }.remove(0).result.unwrap();
    registry
}

#[expect(unsafe_code, reason = "links a plugin through its entry")]
fn linked() -> Registry {
    let mut registry = Registry::with_core();
    // SAFETY: the entry is made by the macro.
    unsafe { host::link(volact_cpu_plugin::volact_plugin, &mut registry) }.unwrap();
    registry
}

fn direct() -> Registry {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry).unwrap();
    registry
}

/// A ball of fog, 128 samples an edge.
fn shape() -> Shape {
    let value = |i: usize| {
        let at = [i % 128, i / 128 % 128, i / 16384].map(|n| n as f64 / 63.5 - 1.0);
        (255.0 * (1.0 - at.iter().map(|x| x * x).sum::<f64>()).max(0.0)) as u8
    };
    let voxels: Vec<u8> = (0..128 * 128 * 128).map(value).collect();
    let volume = Volume::new(VolumeDesc::new([128; 3], ScalarType::U8, 1), voxels).unwrap();
    let table = LookupTable::window_level(200.0, 140.0, 0.05).unwrap();
    Shape::around(&volume, Appearance::new("lut").with("lookup_table", table))
}

/// Seconds of `draw` and `end_draw`, and of the whole frame.
fn frame(action: &mut dyn RenderAction, shape: &Shape, desc: &FrameDesc) -> [f64; 2] {
    let start = Instant::now();
    action.begin_draw(desc).unwrap();
    let begun = Instant::now();
    action.draw(shape).unwrap();
    let frame = action.end_draw().unwrap();
    let end = Instant::now();
    black_box(frame);
    [(end - begun).as_secs_f64(), (end - start).as_secs_f64()]
}

/// First quartile, median and third quartile.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|q| values[(values.len() - 1) * q / 4])
}

/// Times of `direct`, `linked` and `loaded` in each round.
fn rounds(threads: i64, size: usize) -> Vec<[[f64; 2]; 3]> {
    let (shape, registries) = (shape(), [direct(), linked(), loaded()]);
    let options = Options::from([("threads".to_owned(), threads.into())]);
    let mut actions = registries.each_ref().map(|registry| registry.action("cpu", &options).unwrap());
    actions.iter_mut().for_each(|action| action.manage(&shape).unwrap());
    let desc = FrameDesc::fit(&shape, View::Iso, size, size);
    let mut rounds = Vec::new();
    for round in 0..ROUNDS + 3 {
        let mut times = [[0.0; 2]; 3];
        // Whoever comes first is another one each round.
        for turn in 0..3 {
            let who = (turn + round) % 3;
            times[who] = frame(&mut *actions[who], &shape, &desc);
        }
        // The first rounds prepare resources.
        if round >= 3 {
            rounds.push(times);
        }
    }
    rounds
}

fn frames(threads: i64) {
    let rounds = rounds(threads, 512);
    for (part, what) in [(0, "draw + end_draw"), (1, "whole frame")] {
        let [_, median, _] = quartiles(rounds.iter().map(|r| r[0][part]).collect());
        println!("{threads} threads, {what}: direct {:.3} ms (median of {ROUNDS})", median * 1e3);
        for (who, name) in [(1, "linked"), (2, "loaded")] {
            let [low, middle, high] = quartiles(rounds.iter().map(|r| r[who][part] / r[0][part]).collect());
            println!("  {name} / direct: {middle:.4} (quartiles {low:.4} to {high:.4})");
        }
    }
}

/// Frames of a few pixels.
fn calls() {
    let rounds = rounds(1, 8);
    for (who, name) in ["direct", "linked", "loaded"].iter().enumerate() {
        let [low, middle, high] = quartiles(rounds.iter().map(|r| r[who][1] * 1e6).collect());
        println!("8² pixels, {name}: {middle:.0} µs a frame (quartiles {low:.0} to {high:.0})");
    }
}

/// What `volact describe` asks of an action.
fn describe(registry: &Registry) -> Duration {
    let start = Instant::now();
    black_box(format!("{:?}", registry.declarations()));
    let action = registry.action("cpu", &Options::new()).unwrap();
    black_box(format!("{:?} {:?}", action.declaration(), action.caps()));
    start.elapsed()
}

fn main() {
    if env::args().any(|a| a == "--load-once") {
        let start = Instant::now();
        let registry = loaded();
        let load = start.elapsed();
        println!("{} {}", load.as_secs_f64(), describe(&registry).as_secs_f64());
        return;
    }
    let once = |_| {
        let output = Command::new(env::current_exe().unwrap()).arg("--load-once").output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        text.split_whitespace().map(|word| word.parse::<f64>().unwrap()).collect::<Vec<_>>()
    };
    let all: Vec<_> = (0..21).map(once).collect();
    for (at, what) in ["load", "describe"].iter().enumerate() {
        let [low, middle, high] = quartiles(all.iter().map(|times| times[at] * 1e3).collect());
        println!("{what}: {middle:.2} ms (median of 21 processes, quartiles {low:.2} to {high:.2})");
    }
    calls();
    [1, 2].into_iter().for_each(frames);
}
