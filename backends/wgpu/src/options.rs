//! The options of the action `wgpu`.

use volact_core::{
    Declaration, Options, ParameterDecl, ParameterType, ParameterValue,
    parameter::Kind,
    slicing::{Rate, Sampling},
};
use volact_shaders::gpu::voxels::Wanted;

use crate::bands::MOST_SAMPLES;

/// A thousandth of an 8-bit step.
pub const TERMINATION: f64 = 1.0 / 255_000.0;

/// Which adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Adapter {
    /// A part of its name, in any case; any where it is empty.
    pub name: String,
    /// Whether one that saves power is preferred.
    pub low_power: bool,
}

/// How a picture is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Means {
    /// As is fastest.
    #[default]
    Auto,
    /// By casting rays in a compute stage.
    Rays,
    /// By slices, in a fragment stage.
    Slices,
}

impl Means {
    const WORDS: [&'static str; 3] = ["auto", "rays", "slices"];

    fn named(word: &str) -> Self {
        match word {
            "rays" => Self::Rays,
            "slices" => Self::Slices,
            _ => Self::Auto,
        }
    }
}

/// Options, read.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How the picture is made.
    pub means: Means,
    /// World distance between samples; `None` for half of the smallest voxel.
    pub sample_distance: Option<f64>,
    /// What is left to see when a ray ends.
    pub termination: f64,
    /// The format of voxels.
    pub format: Wanted,
    /// Whether the device's sampler interpolates.
    pub hardware: bool,
    /// Whether transparent space is skipped.
    pub skipping: bool,
    /// Samples that one submission takes at most.
    pub submission: f64,
    /// Which adapter.
    pub adapter: Adapter,
}

impl Settings {
    /// How finely slices lie.
    pub fn sampling(&self) -> Sampling {
        Sampling { rate: self.sample_distance.map_or_else(Rate::default, Rate::Distance), ..Sampling::default() }
    }
}

/// What `wgpu` says of itself.
pub fn declaration() -> Declaration {
    let text = "f32 on a GPU through Vulkan, Metal or Direct3D 12";
    let choice = |name, words: &[&str], text| {
        ParameterDecl::new(name, ParameterType::Choice, text).choices(words).default(words[0])
    };
    Declaration::new(Kind::Action, "wgpu", env!("CARGO_PKG_VERSION"), text)
        .with(choice(
            "method",
            &Means::WORDS,
            "how the picture is made: by casting rays in a compute stage, or by slices in a fragment stage; auto is rays",
        ))
        .with(
            ParameterDecl::new(
                "sample_distance",
                ParameterType::Float,
                "distance between samples; half of the smallest voxel unless given, for slices half a voxel along the view axis",
            )
            .bounds(f64::MIN_POSITIVE, f64::MAX)
            .unit("world units"),
        )
        .with(
            ParameterDecl::new(
                "termination",
                ParameterType::Float,
                "rays end where less than this part is left to see; 0 for never",
            )
            .default(TERMINATION)
            .bounds(0.0, 1.0),
        )
        .with(choice(
            "format",
            &Wanted::WORDS,
            "how voxels lie in textures; auto takes the smallest that holds them to the bit, or r32f",
        ))
        .with(choice(
            "filter",
            &["auto", "exact", "hardware"],
            "who interpolates: exact, as auto, is the shader in f32; the device's sampler has coarse weights",
        ))
        .with(
            ParameterDecl::new("skipping", ParameterType::Bool, "skip transparent space; the picture is the same")
                .default(true),
        )
        .with(ParameterDecl::new(
            "adapter",
            ParameterType::Choice,
            "a part of the adapter's name; the first by power unless given",
        ))
        .with(
            ParameterDecl::new(
                "submission",
                ParameterType::Float,
                "samples that one submission takes at most, lest the driver end it; the picture is the same",
            )
            .default(MOST_SAMPLES)
            .bounds(1.0, f64::MAX),
        )
        .with(choice("power", &["high", "low"], "which adapter is preferred where there are several"))
}

impl Settings {
    /// Reads options that are checked and complete.
    pub fn read(options: &Options) -> Self {
        let word = |name: &str| match options.get(name) {
            Some(ParameterValue::Choice(word)) => word.as_str(),
            _ => "",
        };
        let number = |name: &str| options.get(name).and_then(ParameterValue::as_float);
        Self {
            means: Means::named(word("method")),
            submission: number("submission").unwrap_or(MOST_SAMPLES),
            sample_distance: number("sample_distance"),
            termination: number("termination").unwrap_or(TERMINATION),
            format: Wanted::named(word("format")),
            hardware: word("filter") == "hardware",
            skipping: options.get("skipping") != Some(&ParameterValue::Bool(false)),
            adapter: Adapter { name: word("adapter").into(), low_power: word("power") == "low" },
        }
    }
}
