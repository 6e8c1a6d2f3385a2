//! The options of the action `wgpu`.

use volact_core::{Declaration, Options, ParameterDecl, ParameterType, ParameterValue, parameter::Kind};
use volact_shaders::gpu::voxels::Wanted;

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

/// Options, read.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
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
    /// Which adapter.
    pub adapter: Adapter,
}

/// What `wgpu` says of itself.
pub fn declaration() -> Declaration {
    let text = "f32 on a GPU through Vulkan, Metal or Direct3D 12";
    let choice = |name, words: &[&str], text| {
        ParameterDecl::new(name, ParameterType::Choice, text).choices(words).default(words[0])
    };
    Declaration::new(Kind::Action, "wgpu", env!("CARGO_PKG_VERSION"), text)
        .with(choice("method", &["auto", "rays"], "how the picture is sampled: rays is casting in a compute stage"))
        .with(
            ParameterDecl::new(
                "sample_distance",
                ParameterType::Float,
                "distance between samples; half of the smallest voxel unless given",
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
            sample_distance: number("sample_distance"),
            termination: number("termination").unwrap_or(TERMINATION),
            format: Wanted::named(word("format")),
            hardware: word("filter") == "hardware",
            skipping: options.get("skipping") != Some(&ParameterValue::Bool(false)),
            adapter: Adapter { name: word("adapter").into(), low_power: word("power") == "low" },
        }
    }
}
