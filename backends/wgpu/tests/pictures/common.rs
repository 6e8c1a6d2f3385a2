//! Pictures of `wgpu` and the truth about them.

use volact_conformance::{
    metrics::wide,
    rig::{self, Setup},
};
use volact_core::{Frame, FrameDesc, Registry, Shape, resolve::ResolvedShape};
use volact_cpu::reference::{Method, ReferenceOptions, ReferencePicture, integrate};

/// A registry that knows `wgpu`, the actions of the CPU, and the sources of built-in shaders.
pub fn registry() -> Registry {
    let mut registry = rig::registry();
    volact_wgpu::register(&mut registry).unwrap();
    for entry in volact_shaders::builtin().unwrap() {
        let text = entry.source.as_ref().unwrap().text.clone();
        if registry.shaders().get(&entry.declaration.name).is_none() {
            registry.add_shader_source(entry, text).unwrap();
        }
    }
    registry
}

/// `wgpu` with this step and rays that are never cut short.
pub fn rays(step: f64) -> Setup {
    Setup::new("wgpu").with("method", "rays").step(step).with("termination", 0.0)
}

/// The same by slices.
pub fn slices(step: f64) -> Setup {
    Setup::new("wgpu").with("method", "slices").step(step).with("termination", 0.0)
}

/// A picture of shapes by a fresh action of a registry.
pub fn draw_in(registry: &Registry, setup: &Setup, shapes: &[Shape], desc: &FrameDesc) -> Frame {
    rig::draw(&mut *setup.action_in(registry), shapes, desc).unwrap_or_else(|error| panic!("{error:?}"))
}

/// A picture of shapes by a fresh action.
pub fn draw(setup: &Setup, shapes: &[Shape], desc: &FrameDesc) -> Frame {
    draw_in(&registry(), setup, shapes, desc)
}

/// The reference on a lattice, in a registry.
pub fn truth_in(
    registry: &Registry,
    shapes: &[Shape],
    desc: &FrameDesc,
    (method, step): (Method, f64),
) -> ReferencePicture {
    let options = ReferenceOptions { method, sample_distance: step, threads: 2, ..ReferenceOptions::default() };
    let resolve = |s: &Shape| ResolvedShape::new(s, registry.shaders()).unwrap();
    integrate(&shapes.iter().map(resolve).collect::<Vec<_>>(), desc, &options).unwrap()
}

/// How far a picture is from the reference on its own lattice, in any channel, and how far its depths
/// are where both have one.
pub fn errors(
    registry: &Registry,
    setup: &Setup,
    shapes: &[Shape],
    desc: &FrameDesc,
    lattice: (Method, f64),
) -> [f64; 2] {
    let truth = truth_in(registry, shapes, desc, lattice);
    let found = draw_in(registry, setup, shapes, desc);
    let color = volact_conformance::metrics::outside(&wide(&found), &truth);
    let depths = found.depth.iter().zip(&truth.depth);
    let miss = depths.map(|(a, b)| if a.is_finite() && b.is_finite() { (f64::from(*a) - b).abs() } else { 0.0 });
    [color, miss.fold(0.0, f64::max)]
}

/// The errors of rays, and those of slices.
pub fn all_errors(shapes: &[Shape], desc: &FrameDesc, step: f64) -> [(&'static str, [f64; 2]); 2] {
    let registry = registry();
    let both = [("rays", rays(step), Method::Rays), ("slices", slices(step), Method::Planes)];
    both.map(|(name, setup, method)| (name, errors(&registry, &setup, shapes, desc, (method, step))))
}
