//! The life of the action.

use std::time::Instant;

use volact_core::{
    ActionError, Caps, Compositing, Context, Declaration, Frame, FrameDesc, Options, ParameterValue, RenderAction,
    Shape, Statistics, Warning, WarningCode, lifecycle::Lifecycle, parameter::ParameterProblem, resolve::ResolvedShape,
};
use volact_shaders::without_entry;

use super::{
    options::{Classification, Method, NAME, ReferenceOptions, declaration},
    picture::{ReferencePicture, integrate},
    prepare::check_with,
};

/// The certified reference.
#[derive(Debug)]
pub struct ReferenceAction {
    declaration: Declaration,
    lifecycle: Lifecycle,
    given: Options,
    options: ReferenceOptions,
    started: Option<Instant>,
}

fn refused(problems: Vec<ParameterProblem>) -> ActionError {
    ActionError::Options { action: NAME.into(), problems }
}

impl ReferenceAction {
    /// Makes one from options that its declaration has checked.
    ///
    /// # Errors
    /// If a lattice is asked for without its step.
    pub fn new(context: &Context, options: &Options) -> Result<Self, ActionError> {
        let read = ReferenceOptions::from_options(options).map_err(refused)?;
        let lifecycle = Lifecycle::new(context.clone());
        Ok(Self { declaration: declaration(), lifecycle, given: options.clone(), options: read, started: None })
    }

    fn frame(&self, desc: &FrameDesc, shapes: &[ResolvedShape], picture: &ReferencePicture) -> Frame {
        let mut frame = Frame::empty(desc);
        frame.color = picture.color.iter().map(|c| c.map(|v| v as f32)).collect();
        frame.depth = picture.depth.iter().map(|d| *d as f32).collect();
        frame.warnings = shapes.iter().flat_map(|s| s.warnings.clone()).collect();
        frame.warnings.extend(without_entry(&shapes.iter().collect::<Vec<_>>()));
        frame.method = self.method(!picture.estimated.is_empty());
        if self.options.method == Method::Exact {
            let report = certificate(picture, &self.options);
            log::info!("{NAME}: {report}");
            frame.statistics.details.push(("certificate".into(), report));
            let figures = [
                ("pixels certified", (picture.width * picture.height - picture.not_certified).to_string()),
                ("pixels not certified", picture.not_certified.to_string()),
                ("widest enclosure", format!("{:e}", picture.widest)),
                ("widest certified enclosure", format!("{:e}", picture.widest_certified)),
                ("tolerance", format!("{:e}", self.options.tolerance)),
            ];
            frame.statistics.details.extend(figures.map(|(name, figure)| (name.to_owned(), figure)));
            frame.warnings.extend(not_certified(picture, &self.options));
            if !picture.estimated.is_empty() {
                frame.statistics.details.push(("estimated, not certified".into(), picture.estimated.join(", ")));
                frame.warnings.extend(picture.estimated.iter().map(|name| estimated(name)));
            }
        }
        frame
    }

    fn method(&self, estimated: bool) -> volact_core::Method {
        let exact = self.options.method == Method::Exact;
        volact_core::Method {
            sampling: match self.options.method {
                Method::Exact if estimated => "cell by cell; sources by adaptive quadrature",
                Method::Exact => "cell by cell",
                Method::Rays => "ray casting",
                Method::Planes => "planes along the view axis",
            }
            .into(),
            sample_distance: if exact { 0.0 } else { self.options.sample_distance },
            classification: match self.options.classification {
                _ if exact && estimated => "exact; of sources to an estimate",
                _ if exact => "exact",
                Classification::Post => "post-interpolated",
                Classification::PreIntegrated => "pre-integrated",
            }
            .into(),
            texture_format: "as stored".into(),
            filter: "f64, exact".into(),
            blend: "f64".into(),
            termination: if exact { 1e-12 } else { 0.0 },
            device: "scalar f64".into(),
            ..Default::default()
        }
    }
}

/// What a picture certifies, in words.
fn certificate(picture: &ReferencePicture, options: &ReferenceOptions) -> String {
    let all = picture.width * picture.height;
    format!(
        "{} of {all} pixels enclosed to {:e} (widest of these {:.1e}); {} wider, up to {:.1e}",
        all - picture.not_certified,
        options.tolerance,
        picture.widest_certified,
        picture.not_certified,
        picture.widest,
    )
}

/// That a shape's part of the enclosures is no bound.
fn estimated(shape: &str) -> Warning {
    let message = "its shader is evaluated from its source: what it adds to the widths of enclosures is an estimate";
    Warning::new(WarningCode::NotCertified, shape, message)
}

fn not_certified(picture: &ReferencePicture, options: &ReferenceOptions) -> Option<Warning> {
    let message = format!(
        "{} pixels have an enclosure wider than {:e}, the widest {:.1e}",
        picture.not_certified, options.tolerance, picture.widest
    );
    (picture.not_certified > 0).then(|| Warning::new(WarningCode::NotCertified, NAME, message))
}

impl RenderAction for ReferenceAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        let names = |names: &[&str]| Some(names.iter().map(|n| (*n).to_owned()).collect());
        let values = [Compositing::Maximum, Compositing::Minimum, Compositing::Average, Compositing::Add];
        Caps {
            shaders: names(&["simple", "lut", "mip", "minip", "average", "xray", "attribute", "surface"]),
            sources: true,
            geometries: None,
            compositing: [Compositing::Over, Compositing::First].into_iter().chain(values).collect(),
            overlap: true,
            depth: true,
            device: "scalar f64".into(),
        }
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.manage(shape, |s| check_with(s, self.options.recognise)).map(|_| ())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        let started = Instant::now();
        self.lifecycle.begin(frame, |s| check_with(s, self.options.recognise))?;
        self.started = Some(started);
        Ok(())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let shapes: Vec<_> = open.drawn_shapes().cloned().collect();
        let drawing = Instant::now();
        let picture = integrate(&shapes, &open.desc, &self.options)?;
        let mut frame = self.frame(&open.desc, &shapes, &picture);
        let all = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let total = self.started.take().map_or(drawing.elapsed(), |s| s.elapsed());
        frame.statistics = Statistics {
            total,
            render: drawing.elapsed(),
            rays: picture.rays,
            samples: picture.samples,
            threads: if self.options.threads == 0 { all } else { self.options.threads },
            ..frame.statistics
        };
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.lifecycle.outside("set_option")?;
        let mut given = self.given.clone();
        given.insert(name.to_owned(), value);
        let resolved = self.declaration.resolve(&given, |_| false).map_err(refused)?;
        self.options = ReferenceOptions::from_options(&resolved).map_err(refused)?;
        self.given = resolved;
        Ok(())
    }
}
