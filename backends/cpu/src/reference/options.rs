//! What the reference can be asked for.

use volact_core::{
    Declaration, Options, ParameterDecl, ParameterType, ParameterValue,
    parameter::{Kind, ParameterProblem, ProblemKind},
};

/// The name under which the action is registered.
pub const NAME: &str = "reference";

/// How the picture is integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Cell by cell, with an enclosure.
    #[default]
    Exact,
    /// On a lattice counted along the ray.
    Rays,
    /// On a lattice of planes, counted along the view axis.
    Planes,
}

/// How a lattice's samples are classified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Classification {
    /// The value in the middle of each segment.
    #[default]
    Post,
    /// Linear between the ends of each segment, integrated exactly.
    PreIntegrated,
}

/// What the reference can be asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// How the picture is integrated.
    pub method: Method,
    /// How a lattice's samples are classified; without meaning for [`Method::Exact`].
    pub classification: Classification,
    /// World distance between the lattice's samples; without meaning for [`Method::Exact`].
    pub sample_distance: f64,
    /// The width of a pixel's enclosure, in any channel, up to which it counts as certified.
    pub tolerance: f64,
    /// Whether shaders that come with Volact are drawn with a certificate, as sources, too; else they
    /// are evaluated from their sources.
    pub recognise: bool,
    /// Threads; 0 for as many as there are processors. The picture does not depend on it.
    pub threads: usize,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self {
            method: Method::Exact,
            classification: Classification::Post,
            sample_distance: 0.0,
            tolerance: 1e-9,
            recognise: true,
            threads: 0,
        }
    }
}

/// What the action says of itself.
pub fn declaration() -> Declaration {
    let text = "f64, cell by cell, with an enclosure for each pixel; or any lattice in f64";
    Declaration::new(Kind::Action, NAME, env!("CARGO_PKG_VERSION"), text)
        .with(
            ParameterDecl::new("method", ParameterType::Choice, "the certified integral, or a lattice in f64")
                .choices(&["exact", "rays", "planes"])
                .default("exact"),
        )
        .with(
            ParameterDecl::new(
                "classification",
                ParameterType::Choice,
                "for a lattice: the value in each segment's middle, or linear between its ends",
            )
            .choices(&["post", "pre-integrated"])
            .default("post"),
        )
        .with(
            ParameterDecl::new("sample_distance", ParameterType::Float, "for a lattice, and needed there: its step")
                .bounds(f64::MIN_POSITIVE, f64::MAX)
                .unit("world units"),
        )
        .with(
            ParameterDecl::new("tolerance", ParameterType::Float, "width of an enclosure that counts as certified")
                .bounds(0.0, 1.0)
                .default(1e-9),
        )
        .with(
            ParameterDecl::new(
                "recognise",
                ParameterType::Bool,
                "draw sources that are built-in shaders as those, with a certificate; else evaluate every source",
            )
            .default(true),
        )
        .with(
            ParameterDecl::new("threads", ParameterType::Int, "threads; 0 for all processors")
                .bounds(0.0, 4096.0)
                .default(0i64),
        )
}

impl ReferenceOptions {
    /// Reads options that the declaration has checked.
    ///
    /// # Errors
    /// If a lattice is asked for without its step.
    pub fn from_options(options: &Options) -> Result<Self, Vec<ParameterProblem>> {
        let word = |name: &str| match options.get(name) {
            Some(ParameterValue::Choice(word)) => word.as_str(),
            _ => "",
        };
        let number = |name: &str| options.get(name).and_then(ParameterValue::as_float);
        let method = match word("method") {
            "rays" => Method::Rays,
            "planes" => Method::Planes,
            _ => Method::Exact,
        };
        let step = number("sample_distance");
        if method != Method::Exact && step.is_none() {
            let wanted = "a float, since the method is a lattice".into();
            return Err(vec![ParameterProblem {
                name: "sample_distance".into(),
                kind: ProblemKind::Missing { wanted },
            }]);
        }
        let default = Self::default();
        Ok(Self {
            method,
            classification: match word("classification") {
                "pre-integrated" => Classification::PreIntegrated,
                _ => Classification::Post,
            },
            sample_distance: step.unwrap_or(0.0),
            tolerance: number("tolerance").unwrap_or(default.tolerance),
            recognise: options.get("recognise") != Some(&ParameterValue::Bool(false)),
            threads: number("threads").map_or(0, |n| n as usize),
        })
    }
}
