//! The options of the action `cpu`.

use volact_core::{Declaration, Options, ParameterDecl, ParameterType, ParameterValue, parameter::Kind};

use super::simd::Unit;

/// A thousandth of an 8-bit step.
pub const TERMINATION: f64 = 1.0 / 255_000.0;

/// How `over` shapes are classified.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Classification {
    /// Pre-integrated where the table is too sharp for the step and the data.
    Auto,
    /// At the middle of each segment.
    Post,
    /// By the values at both ends of each segment.
    PreIntegrated,
}

/// Options, read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// World distance between samples; `None` for half of the smallest voxel.
    pub sample_distance: Option<f64>,
    /// How `over` shapes are classified.
    pub classification: Classification,
    /// What is left to see when a ray ends.
    pub termination: f64,
    /// Threads, at least one.
    pub threads: usize,
    /// Whether transparent space is skipped.
    pub skipping: bool,
    /// Whether sources that do what a built-in shader does are drawn by its kernel.
    pub recognise: bool,
    /// The vector unit.
    pub unit: Unit,
}

/// What `cpu` says of itself.
pub fn declaration() -> Declaration {
    let text = "f32 on all cores with the widest vector unit; skips what cannot be seen";
    let number = |name, text| ParameterDecl::new(name, ParameterType::Float, text);
    Declaration::new(Kind::Action, "cpu", env!("CARGO_PKG_VERSION"), text)
        .with(
            number("sample_distance", "distance between samples; half of the smallest voxel unless given")
                .bounds(f64::MIN_POSITIVE, f64::MAX)
                .unit("world units"),
        )
        .with(
            ParameterDecl::new(
                "classification",
                ParameterType::Choice,
                "where the table is applied; auto pre-integrates where it is too sharp for step and data",
            )
            .default("auto")
            .choices(&["auto", "post", "pre-integrated"]),
        )
        .with(
            number("termination", "rays end where less than this part is left to see; 0 for never")
                .default(TERMINATION)
                .bounds(0.0, 1.0),
        )
        .with(
            ParameterDecl::new("threads", ParameterType::Int, "threads; 0 for one a core")
                .default(0i64)
                .bounds(0.0, 1024.0),
        )
        .with(
            ParameterDecl::new("skipping", ParameterType::Bool, "skip transparent space; the picture is the same")
                .default(true),
        )
        .with(
            ParameterDecl::new(
                "recognise",
                ParameterType::Bool,
                "draw sources that do what a built-in shader does by its kernel; else evaluate also those of built-ins",
            )
            .default(true),
        )
        .with(
            ParameterDecl::new(
                "unit",
                ParameterType::Choice,
                "vector unit; the picture is the same to the last bit but for plain x86-64, which rounds more often",
            )
            .default("auto")
            .choices(&["auto", "avx512", "avx2", "plain"]),
        )
}

impl Settings {
    /// Reads options that are checked and complete. A vector unit that this machine lacks is the
    /// error, by name.
    pub fn read(options: &Options) -> Result<Self, &'static str> {
        let word = |name: &str| match options.get(name) {
            Some(ParameterValue::Choice(word)) => word.clone(),
            _ => "auto".into(),
        };
        let number = |name: &str| options.get(name).and_then(ParameterValue::as_float);
        let (unit, name) = match word("unit").as_str() {
            "avx512" => (Unit::Avx512, "avx512"),
            "avx2" => (Unit::Avx2, "avx2"),
            "plain" => (Unit::Plain, "plain"),
            _ => (Unit::detect(), "auto"),
        };
        if !unit.available() {
            return Err(name);
        }
        let all = || std::thread::available_parallelism().map_or(1, usize::from);
        Ok(Self {
            sample_distance: number("sample_distance"),
            classification: match word("classification").as_str() {
                "post" => Classification::Post,
                "pre-integrated" => Classification::PreIntegrated,
                _ => Classification::Auto,
            },
            termination: number("termination").unwrap_or(TERMINATION),
            threads: number("threads").filter(|&n| n >= 1.0).map_or_else(all, |n| n as usize),
            skipping: options.get("skipping") != Some(&ParameterValue::Bool(false)),
            recognise: options.get("recognise") != Some(&ParameterValue::Bool(false)),
            unit,
        })
    }
}
