//! The study of orders must be able to fail: a stranger's action, written here against `core` alone, that
//! keeps the contract or makes one of three faults; and `cpu` with faults of its own, with the feature
//! `mutations`: `cargo test -p volact-conformance --features mutations --test orders`.

use std::{collections::BTreeSet, sync::Arc};

use volact_conformance::{
    outcome::{Run, Status},
    rig::registry,
    runner::{Filter, Suite},
};
use volact_core::{
    Aabb, ActionError, Caps, Compositing, Context, Declaration, Frame, FrameDesc, LookupTable, Options, ParameterDecl,
    ParameterType, ParameterValue, Registry, RenderAction, Shape,
    camera::Ray,
    frame::FrameError,
    lattice::{Lattice, Segment},
    lifecycle::Lifecycle,
    parameter::Kind,
    resolve::ResolvedShape,
    table::ResolvedTable,
};

/// Casts rays through one block at a time, in f64, by the rule that its options say.
struct Marcher {
    declaration: Declaration,
    lifecycle: Lifecycle,
    options: Options,
}

fn declaration() -> Declaration {
    let choice = |name: &str, choices: &[&str]| {
        ParameterDecl::new(name, ParameterType::Choice, "for the test").choices(choices).default(choices[0])
    };
    Declaration::new(Kind::Action, "marcher", "0.0.0", "a ray caster with faults on request")
        .with(ParameterDecl::new("sample_distance", ParameterType::Float, "step").default(0.5))
        .with(choice("classification", &["post", "pre-integrated"]))
        .with(choice("fault", &["none", "linear", "unattenuated", "coarse"]))
}

impl Marcher {
    fn word(&self, name: &str) -> &str {
        match self.options.get(name) {
            Some(ParameterValue::Choice(word)) => word,
            _ => "",
        }
    }

    fn step(&self) -> f64 {
        self.options.get("sample_distance").and_then(ParameterValue::as_float).unwrap_or(0.5)
    }

    /// The table; in 256 entries over its own values where it is to be coarse.
    fn table(&self, shape: &ResolvedShape) -> Option<ResolvedTable> {
        let (table, range) = (shape.table("lookup_table")?, shape.volume("volume")?.range());
        let resolved = table.resolve(range);
        if self.word("fault") != "coarse" {
            return Some(resolved);
        }
        let ends = [resolved.points().first()?.value, resolved.points().last()?.value];
        let value = |i: usize| ends[0] + (ends[1] - ends[0]) * i as f64 / 255.0;
        let entries: Vec<[f32; 4]> =
            (0..256).map(|i| resolved.classify(value(i).min(ends[1] * (1.0 - 1e-12))).map(|v| v as f32)).collect();
        let bytes: Vec<u8> = entries.as_flattened().iter().flat_map(|v| v.to_ne_bytes()).collect();
        Some(LookupTable::from_entries(bytes, Some(ends)).ok()?.resolve(range))
    }

    fn pixel(&self, shape: &ResolvedShape, table: &ResolvedTable, ray: &Ray) -> Option<[f64; 4]> {
        let texture = shape.volume("volume")?;
        let block: Aabb = shape.block()?;
        let unit = shape.parameters.get("unit_distance")?.as_float()?;
        let (origin, direction) =
            (shape.to_object.transform_point3(ray.origin), shape.to_object.transform_vector3(ray.direction));
        let [t0, t1] = block.clip_line(origin, direction)?;
        let index = texture.object_to_index();
        let value = |t: f64| texture.sample(index.transform_point3(origin + direction * t), 0);
        let mut out = [0.0; 4];
        for segment in (Lattice { step: self.step() }).segments(t0.max(ray.near), t1.min(ray.far)) {
            let added = self.segment(&segment, &value, table, unit);
            out = std::array::from_fn(|c| out[c] + (1.0 - out[3]) * added[c]);
        }
        Some(out)
    }

    /// Light and opacity of one segment.
    fn segment(&self, s: &Segment, value: &dyn Fn(f64) -> f64, table: &ResolvedTable, unit: f64) -> [f64; 4] {
        let segments = self.word("classification") == "pre-integrated";
        let ends = if segments { [value(s.start), value(s.end)] } else { [value(s.middle()); 2] };
        let (mut out, mut depth) = ([0.0; 4], 0.0f64);
        for [from, to] in pieces(table, ends, if segments { PARTS } else { 1 }) {
            let [r, g, b, a] = table.classify(ends[0] + 0.5 * (from + to) * (ends[1] - ends[0]));
            let tau = -(-a).ln_1p() * (to - from) * s.length() / unit;
            let share = match self.word("fault") {
                "linear" => tau.min(1.0),
                "unattenuated" if segments => tau,
                _ => (-depth).exp() * -(-tau).exp_m1(),
            };
            depth += tau;
            out = std::array::from_fn(|c| out[c] + share * [r, g, b, 0.0][c]);
            out[3] = if self.word("fault") == "linear" { depth.min(1.0) } else { -(-depth).exp_m1() };
        }
        out
    }
}

/// Parts of a piece between two control points.
const PARTS: usize = 8;

/// Parts of a segment between whose ends values are linear: none reaches over a control point.
fn pieces(table: &ResolvedTable, [front, back]: [f64; 2], parts: usize) -> Vec<[f64; 2]> {
    let crossed = table.points().iter().map(|p| (p.value - front) / (back - front));
    let mut ends: Vec<f64> = crossed.filter(|t| *t > 0.0 && *t < 1.0).chain([0.0, 1.0]).collect();
    ends.sort_by(f64::total_cmp);
    let part = |e: &[f64], i: usize| e[0] + (e[1] - e[0]) * i as f64 / parts as f64;
    let of_piece = |e: &[f64]| (0..parts).map(|i| [part(e, i), part(e, i + 1)]).collect::<Vec<_>>();
    ends.windows(2).flat_map(of_piece).collect()
}

impl RenderAction for Marcher {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        Caps {
            shaders: Some(vec!["lut".into()]),
            geometries: Some(vec!["block".into()]),
            compositing: vec![Compositing::Over],
            device: "a test".into(),
            ..Caps::default()
        }
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.manage(shape, |_| Ok(())).map(|_| ())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        self.lifecycle.begin(frame, |_| Ok(())).map(|_| ())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let mut frame = Frame::empty(&open.desc);
        let grid = open.desc.camera.rays(&open.desc.viewport()).map_err(FrameError::from)?;
        for shape in open.drawn_shapes() {
            let Some(table) = self.table(shape) else { continue };
            for i in 0..frame.color.len() {
                let ray = grid.ray((i % frame.width) as f64 + 0.5, (i / frame.width) as f64 + 0.5);
                if let Some(color) = self.pixel(shape, &table, &ray) {
                    frame.color[i] = color.map(|v| v as f32);
                }
            }
        }
        frame.method.sampling = "ray casting".into();
        frame.method.sample_distance = self.step();
        frame.method.classification = self.word("classification").into();
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.options.insert(name.into(), value);
        Ok(())
    }
}

fn with_marcher() -> Registry {
    let mut registry = registry();
    let make = |context: &Context, options: &Options| {
        let declaration = declaration();
        let options = declaration
            .resolve(options, |_| false)
            .map_err(|problems| ActionError::Options { action: "marcher".into(), problems })?;
        let lifecycle = Lifecycle::new(context.clone());
        Ok(Box::new(Marcher { declaration, lifecycle, options }) as Box<dyn RenderAction>)
    };
    registry.add_action(declaration(), Arc::new(make)).expect("the name is free");
    registry
}

fn studied(suite: &Suite, action: &str, options: &Options) -> Run {
    let subject = suite.subject(action, options).expect("the action can be made");
    suite.run(&subject, &Filter { studies: true, ..Filter::default() }, |_| ())
}

fn failed(run: &Run) -> BTreeSet<&str> {
    let failed = |case: &&volact_conformance::outcome::CaseResult| matches!(case.status, Status::Failed(_));
    run.cases.iter().filter(failed).map(|case| case.name.as_str()).collect()
}

#[test]
fn a_strangers_action_is_studied_and_each_fault_is_caught() {
    let suite = Suite::new(&with_marcher()).expect("built-in shaders are well named");
    let run = |fault: &str| {
        let run = studied(&suite, "marcher", &Options::from([("fault".to_owned(), fault.into())]));
        run.cases.iter().for_each(|case| println!("{fault}: {} {:?}", case.name, case.status));
        run
    };
    let right = run("none");
    assert!(right.passed(), "{:?}", failed(&right));
    let skipped: Vec<_> = right.cases.iter().filter(|c| matches!(c.status, Status::Skipped(_))).collect();
    assert!(skipped.iter().all(|c| c.topic == "overlap"), "{skipped:?}");
    let (linear, unattenuated, coarse) = (run("linear"), run("unattenuated"), run("coarse"));
    assert!(failed(&linear).contains("midpoint_is_of_second_order"), "α ≈ τh: {:?}", failed(&linear));
    assert!(failed(&unattenuated).contains("pre_integration_is_of_second_order"), "{:?}", failed(&unattenuated));
    assert!(!failed(&unattenuated).contains("midpoint_is_of_second_order"), "{:?}", failed(&unattenuated));
    let (corners, smooth) = ("corners_in_tables_are_of_second_order", "midpoint_is_of_second_order");
    assert!(failed(&coarse).contains(corners), "256 entries: {:?}", failed(&coarse));
    assert!(!failed(&coarse).contains(smooth), "a linear table has no corners: {:?}", failed(&coarse));
}

/// Faults of the shipped action that have an order to be seen by.
#[cfg(feature = "mutations")]
#[test]
fn faults_in_cpu_are_caught() {
    use volact_core::mutation;
    let suite = Suite::new(&registry()).expect("built-in shaders are well named");
    let right = studied(&suite, "cpu", &Options::default());
    assert!(right.passed(), "{:?}", failed(&right));
    for (fault, study) in [
        ("linear_opacity", "midpoint_is_of_second_order"),
        ("opacity_exponent", "midpoint_is_of_second_order"),
        ("eight_bit_target", "corners_in_tables_are_of_second_order"),
        ("half_voxel", "refinement_is_of_second_order"),
    ] {
        mutation::set(Some(fault));
        let run = studied(&suite, "cpu", &Options::default());
        mutation::set(None);
        assert!(failed(&run).contains(study), "{fault}: {:?}", failed(&run));
    }
}
