//! The options of the action `vulkan`.

use std::path::PathBuf;

use volact_core::{
    Declaration, Options, ParameterDecl, ParameterType, ParameterValue,
    parameter::Kind,
    slicing::{Rate, Sampling},
};
use volact_shaders::gpu::voxels::Wanted;

use crate::check::NAME;

/// A thousandth of an 8-bit step.
pub const TERMINATION: f64 = 1.0 / 255_000.0;

/// Options, read.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How far apart planes are, and how many there may be.
    pub sampling: Sampling,
    /// What is left to see when a ray ends.
    pub termination: f64,
    /// The format of voxels.
    pub format: Wanted,
    /// Whether the device's sampler interpolates.
    pub hardware: bool,
    /// A part of the adapter's name; any where it is empty.
    pub adapter: String,
    /// Whether the validation layers listen.
    pub validation: bool,
    /// Where compiled pipelines are kept.
    pub cache: Option<PathBuf>,
}

/// What `vulkan` says of itself.
pub fn declaration() -> Declaration {
    let choice = |name, words: &[&str], text| {
        ParameterDecl::new(name, ParameterType::Choice, text).choices(words).default(words[0])
    };
    Declaration::new(Kind::Action, NAME, env!("CARGO_PKG_VERSION"), "f32 on a GPU through Vulkan 1.3, by slicing")
        .with(
            ParameterDecl::new(
                "sample_distance",
                ParameterType::Float,
                "distance between planes; half a voxel along the view axis unless given",
            )
            .bounds(f64::MIN_POSITIVE, f64::MAX)
            .unit("world units"),
        )
        .with(
            ParameterDecl::new(
                "max_planes",
                ParameterType::Int,
                "the most planes: where more are wanted they are farther apart; no bound unless given",
            )
            .bounds(2.0, 1e6),
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
            &["exact", "hardware"],
            "who interpolates: the shader in f32, or the device's sampler, whose weights are coarse",
        ))
        .with(ParameterDecl::new("adapter", ParameterType::Choice, "a part of the adapter's name; any unless given"))
        .with(
            ParameterDecl::new(
                "validation",
                ParameterType::Bool,
                "have the validation layers listen, synchronisation included; what they say is an error",
            )
            .default(false),
        )
        .with(ParameterDecl::new(
            "pipeline_cache",
            ParameterType::Choice,
            "the folder in which compiled pipelines are kept; nowhere unless given",
        ))
}

impl Settings {
    /// Reads options that are checked and complete.
    pub fn read(options: &Options) -> Self {
        let word = |name: &str| match options.get(name) {
            Some(ParameterValue::Choice(word)) => word.as_str(),
            _ => "",
        };
        let number = |name: &str| options.get(name).and_then(ParameterValue::as_float);
        let rate = number("sample_distance").map_or_else(Rate::default, Rate::Distance);
        let most_planes = number("max_planes").map(|n| n as usize);
        Self {
            sampling: Sampling { rate, most_planes, ..Sampling::default() },
            termination: number("termination").unwrap_or(TERMINATION),
            format: Wanted::named(word("format")),
            hardware: word("filter") == "hardware",
            adapter: word("adapter").into(),
            validation: options.get("validation") == Some(&ParameterValue::Bool(true)),
            cache: Some(word("pipeline_cache")).filter(|w| !w.is_empty()).map(PathBuf::from),
        }
    }
}
