//! The life of shapes and actions: what is redone when, who is refused what, and whose memory it is.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use volact_conformance::{
    metrics::identical,
    rig::{Setup, draw, draw_managed, registry},
    scene::{ball, cell, constant, greys, lut, volume},
};
use volact_core::{
    ActionError, Appearance, Block, Buffer, Caps, Context, Declaration, Frame, FrameDesc, Options, ParameterValue,
    RenderAction, ScalarType, Shape, View, Volume, VolumeDesc,
    checked::CheckedAction,
    glam::{DAffine3, DVec3},
    null::NullAction,
};

fn table(top: f64) -> volact_core::LookupTable {
    greys(&[(50.0, 0.1, 0.0), (200.0, 0.9, top)])
}

fn shape() -> Shape {
    lut(&ball([20, 20, 20], ScalarType::U8), table(0.5), 1.0)
}

fn view(shape: &Shape, view: View) -> FrameDesc {
    FrameDesc::fit(shape, view, 12, 12)
}

fn rebuilt(frame: &Frame) -> Vec<&str> {
    frame.statistics.rebuilt.iter().map(|r| r.what.as_str()).collect()
}

#[test]
fn only_what_depends_on_a_change_is_redone() {
    for classification in ["post", "pre-integrated"] {
        let mut action = Setup::cpu().with("classification", classification).action();
        let shape = shape();
        let shapes = [shape.clone()];
        let mut frame = |view: FrameDesc| draw_managed(&mut *action, &shapes, &view);
        assert!(matches!(frame(view(&shape, View::Front)), Err(ActionError::NotManaged { .. })));
        action.end_draw().unwrap();
        action.manage(&shape).unwrap();
        let mut frame = |shape: &Shape, v| draw_managed(&mut *action, &shapes, &view(shape, v)).unwrap();
        let first = frame(&shape, View::Front);
        assert!(rebuilt(&first).contains(&"value bounds"), "{:?}", rebuilt(&first));
        assert_eq!(rebuilt(&frame(&shape, View::Iso)), [""; 0], "another camera");
        assert_eq!(rebuilt(&frame(&shape, View::Iso)), [""; 0], "nothing");
        shape.set_parameter("lookup_table", table(0.7));
        let changed = frame(&shape, View::Iso);
        assert!(rebuilt(&changed).contains(&"classification") && !rebuilt(&changed).contains(&"value bounds"));
        shape.set_parameter("lookup_table", table(0.5));
        assert!(identical(&frame(&shape, View::Front), &first), "back again");
        // Switching the shader moves no data.
        for shader in ["mip", "average", "xray", "minip", "lut"] {
            shape.set_shader(shader);
            let frame = frame(&shape, View::Front);
            assert!(!rebuilt(&frame).contains(&"value bounds"), "{shader}: {:?}", rebuilt(&frame));
        }
        assert!(identical(&frame(&shape, View::Front), &first), "switched back");
        shape.state().volume().unwrap().volume().touch();
        assert!(rebuilt(&frame(&shape, View::Front)).contains(&"value bounds"), "touched");
    }
}

/// The same data in several shapes is prepared once.
#[test]
fn data_of_several_shapes_is_prepared_once() {
    let data = ball([20, 20, 20], ScalarType::U8);
    let shapes = [lut(&data, table(0.5), 1.0), lut(&data, table(0.9), 1.0)];
    let frame = Setup::cpu().draw(&shapes, &view(&shapes[0], View::Iso));
    assert_eq!(rebuilt(&frame).iter().filter(|w| **w == "value bounds").count(), 1);
}

/// The application's own memory, changed in place and announced.
struct Shared(Vec<std::sync::atomic::AtomicU8>);

impl volact_core::Bulk for Shared {
    #[expect(unsafe_code, reason = "atomic bytes seen as bytes")]
    fn bytes(&self) -> &[u8] {
        // SAFETY: AtomicU8 has the layout of u8, and the test writes only while nobody reads.
        unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len()) }
    }
}

#[test]
fn touched_data_is_drawn_as_it_now_is() {
    let dims = [12usize, 12, 12];
    let memory = Arc::new(Shared((0..1728).map(|_| 0u8.into()).collect()));
    let data = Volume::new(VolumeDesc::new(dims, ScalarType::U8, 1), Buffer::shared(memory.clone())).unwrap();
    let shape = lut(&data, table(0.5), 1.0);
    let desc = view(&shape, View::Iso);
    let mut action = Setup::cpu().action();
    let empty = draw(&mut *action, std::slice::from_ref(&shape), &desc).unwrap();
    assert!(empty.color.iter().all(|c| *c == [0.0; 4]));
    memory.0.iter().enumerate().for_each(|(i, v)| v.store((i % 211) as u8, Ordering::Relaxed));
    data.touch();
    let now = draw_managed(&mut *action, std::slice::from_ref(&shape), &desc).unwrap();
    let copy: Vec<u8> = (0..1728).map(|i| (i % 211) as u8).collect();
    let fresh = Volume::new(VolumeDesc::new(dims, ScalarType::U8, 1), copy).unwrap();
    let wanted = Setup::cpu().draw(&[lut(&fresh, table(0.5), 1.0)], &desc);
    assert!(identical(&now, &wanted));
}

#[test]
fn calls_out_of_order_are_refused_by_name_and_cure() {
    for name in ["cpu", "reference", "null"] {
        let mut action = Setup::new(name).action();
        let (shape, other) = (shape().named("head"), shape().named("late"));
        let desc = view(&shape, View::Front);
        let text = |e: ActionError| e.to_string();
        assert!(matches!(action.end_draw(), Err(ActionError::NotDrawing { call: "end_draw" })));
        let error = action.draw(&shape).unwrap_err();
        assert!(matches!(error, ActionError::NotDrawing { call: "draw" }));
        assert!(text(error).contains("call begin_draw first"));
        assert!(matches!(action.unmanage(&shape), Err(ActionError::NotManaged { .. })));
        action.manage(&shape).unwrap();
        action.manage(&shape).unwrap();
        action.begin_draw(&desc).unwrap();
        assert!(matches!(action.begin_draw(&desc), Err(ActionError::Drawing { call: "begin_draw" })));
        assert!(matches!(action.unmanage(&shape), Err(ActionError::Drawing { call: "unmanage" })));
        assert!(matches!(action.set_option("threads", 1i64.into()), Err(ActionError::Drawing { .. })));
        let error = text(action.draw(&other).unwrap_err());
        assert!(error.contains("\"late\" is not managed; call manage before begin_draw"), "{error}");
        action.manage(&other).unwrap();
        let error = action.draw(&other).unwrap_err();
        assert!(matches!(error, ActionError::ManagedLate { .. }), "{error}");
        assert!(text(error).contains("manage it before, or draw it in the next frame"));
        action.draw(&shape).unwrap();
        let error = action.draw(&shape).unwrap_err();
        assert!(matches!(error, ActionError::DrawnTwice { .. }) && text(error).contains("\"head\""));
        action.end_draw().unwrap();
        // Changed late, in each of the ways.
        let changes: [&dyn Fn(); 5] = [
            &|| shape.set_transform(DAffine3::from_translation(DVec3::X)),
            &|| shape.set_parameter("lookup_table", table(0.1)),
            &|| shape.set_shader("mip"),
            &|| shape.set_geometry(Block::new(DVec3::ZERO, DVec3::ONE).unwrap()),
            &|| shape.state().volume().unwrap().volume().touch(),
        ];
        for change in changes {
            action.begin_draw(&desc).unwrap();
            change();
            let error = action.draw(&shape).unwrap_err();
            assert!(matches!(error, ActionError::ChangedLate { .. }), "{name}: {error}");
            action.end_draw().unwrap();
        }
        // After all that it is usable.
        action.begin_draw(&desc).unwrap();
        action.draw(&shape).unwrap();
        action.draw(&other).unwrap();
        action.end_draw().unwrap();
        action.unmanage(&shape).unwrap();
        assert!(matches!(action.unmanage(&shape), Err(ActionError::NotManaged { .. })));
    }
}

#[test]
fn wrong_parameters_name_shape_and_cure() {
    let data = cell();
    let around = |a: Appearance| Shape::around(&data, a).named("head");
    let good = || Appearance::new("lut").with("lookup_table", table(0.5)).with("unit_distance", 1.0);
    let cases: [(Shape, &[&str]); 6] = [
        (around(Appearance::new("lut")), &["head", "lookup_table", "missing", "lookup table"]),
        (around(good().with("lokup_table", table(0.5))), &["head", "lokup_table", "did you mean \"lookup_table\"?"]),
        (around(good().with("lookup_table", 3.0)), &["head", "lookup_table", "float", "wanted lookup table"]),
        (around(good().with("component", 9i64)), &["head", "component", "0 to 3"]),
        (around(Appearance { shader: "mipp".into(), ..good() }), &["head", "mipp", "did you mean", "lut"]),
        (
            Shape::new(Block::new(DVec3::ZERO, DVec3::ONE).unwrap(), good()).named("head"),
            &["head", "volume", "missing"],
        ),
    ];
    for (shape, words) in cases {
        for name in ["cpu", "reference", "null", "checked"] {
            let error = Setup::new(name).action().manage(&shape).unwrap_err().to_string();
            assert!(words.iter().all(|w| error.contains(w)), "{name}: {error}, wanted {words:?}");
        }
    }
    // A parameter that another shader declares is kept, with a warning.
    let shape = around(Appearance { shader: "simple".into(), ..good() });
    let frame = Setup::cpu().draw(std::slice::from_ref(&shape), &view(&shape, View::Front));
    assert!(frame.warnings.iter().any(|w| w.message.contains("lookup_table")), "{:?}", frame.warnings);
}

#[test]
fn wrong_options_and_names_are_refused() {
    let fails = |setup: Setup| setup.try_action().err().expect("an error").to_string();
    assert!(fails(Setup::new("cpu").with("sample_distnce", 1.0)).contains("did you mean \"sample_distance\"?"));
    assert!(fails(Setup::new("cpu").step(0.0)).contains("sample_distance"));
    assert!(fails(Setup::new("cpu").step(f64::NAN)).contains("sample_distance"));
    assert!(fails(Setup::new("cpu").with("classification", "best")).contains("post"));
    assert!(fails(Setup::new("cpu").with("termination", 1.5)).contains("termination"));
    assert!(fails(Setup::new("reference").with("method", "rays")).contains("sample_distance"));
    assert!(fails(Setup::new("gpu")).contains("known: checked, cpu, null, planned, reference"));
    let mut action = Setup::cpu().action();
    assert!(action.set_option("threads", "many".into()).is_err());
    assert!(action.set_option("sample_distance", 0.5.into()).is_ok());
}

/// A default stated is bit-identical to the option left out, for every option of `cpu`.
#[test]
fn defaults_stated_change_nothing() {
    let shape = shape();
    let desc = view(&shape, View::Iso);
    let plain = Setup::new("cpu").draw(std::slice::from_ref(&shape), &desc);
    let declaration = Setup::new("cpu").action().declaration().clone();
    let stated = |setup: Setup, p: &volact_core::ParameterDecl| match &p.default {
        Some(value) => setup.with(&p.name, value.clone()),
        None => setup,
    };
    let all = declaration.parameters.iter().fold(Setup::new("cpu"), stated);
    assert!(identical(&plain, &all.draw(&[shape], &desc)));
}

/// An action that breaks its promises, each in turn.
struct Faulty {
    inner: NullAction,
    desc: Option<FrameDesc>,
    fault: fn(&mut Frame),
}

impl RenderAction for Faulty {
    fn declaration(&self) -> &Declaration {
        self.inner.declaration()
    }
    fn caps(&self) -> Caps {
        self.inner.caps()
    }
    fn manage(&mut self, _: &Shape) -> Result<(), ActionError> {
        Ok(())
    }
    fn unmanage(&mut self, _: &Shape) -> Result<(), ActionError> {
        Ok(())
    }
    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        self.desc = Some(frame.clone());
        Ok(())
    }
    fn draw(&mut self, _: &Shape) -> Result<(), ActionError> {
        Ok(())
    }
    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let mut frame = Frame::empty(self.desc.as_ref().expect("checked by who wraps it"));
        (self.fault)(&mut frame);
        Ok(frame)
    }
    fn set_option(&mut self, _: &str, _: ParameterValue) -> Result<(), ActionError> {
        Ok(())
    }
}

fn wrapped(fault: fn(&mut Frame)) -> CheckedAction {
    let context = Context { shaders: registry().shaders().clone(), ..Context::default() };
    CheckedAction::new(&context, Box::new(Faulty { inner: NullAction::new(&context), desc: None, fault }))
}

#[test]
fn checked_finds_a_faulty_action() {
    let shape = shape();
    let desc = view(&shape, View::Front);
    type Fault = fn(&mut Frame);
    let faults: [(Fault, &str); 7] = [
        (|f| f.color[13] = [f32::NAN; 4], "pixel (1, 1)"),
        (|f| f.color[0] = [0.0, -0.1, 0.0, 0.5], "pixel (0, 0)"),
        (|f| f.color[12] = [0.0, 0.0, 0.0, 1.1], "pixel (0, 1)"),
        (|f| f.color[1] = [f32::INFINITY, 0.0, 0.0, 1.0], "pixel (1, 0)"),
        (|f| f.depth[2] = f32::NAN, "depth of pixel (2, 0)"),
        (|f| f.width += 1, "wanted 12 × 12"),
        (|f| f.color = f.color[..5].to_vec().into(), "wanted 12 × 12"),
    ];
    for (fault, words) in faults {
        let error = draw(&mut wrapped(fault), std::slice::from_ref(&shape), &desc).unwrap_err();
        let source = std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default();
        assert!(source.contains(words), "{error}: {source}, wanted {words}");
    }
    assert!(draw(&mut wrapped(|_| ()), std::slice::from_ref(&shape), &desc).is_ok());
    // Order is checked around an action that accepts any.
    let mut action = wrapped(|_| ());
    assert!(matches!(action.draw(&shape), Err(ActionError::NotDrawing { .. })));
    action.begin_draw(&desc).unwrap();
    assert!(matches!(action.draw(&shape), Err(ActionError::NotManaged { .. })));
    action.end_draw().unwrap();
    assert!(matches!(action.end_draw(), Err(ActionError::NotDrawing { .. })));
    assert!(matches!(action.unmanage(&shape), Err(ActionError::NotManaged { .. })));
    assert!(action.manage(&lut(&cell(), table(0.5), -1.0)).is_err());
}

#[test]
fn checked_leaves_pictures_and_options_alone() {
    let shape = [shape()];
    let desc = view(&shape[0], View::Iso);
    for of in ["cpu", "reference", "null"] {
        let checked = Setup::new("checked").with("of", of).draw(&shape, &desc);
        assert!(identical(&checked, &Setup::new(of).draw(&shape, &desc)), "{of}");
    }
    let checked = Setup::new("checked").step(3.0).draw(&shape, &desc);
    assert_eq!(checked.method.sample_distance, 3.0);
    assert!(Setup::new("checked").with("of", "checked").try_action().is_err());
}

#[test]
fn null_draws_nothing() {
    let shape = [shape()];
    let frame = Setup::new("null").draw(&shape, &view(&shape[0], View::Iso));
    assert!(frame.color.iter().all(|c| *c == [0.0; 4]) && frame.depth.iter().all(|d| *d == f32::INFINITY));
}

/// Which of two traits a type has, decided when this is compiled: a type that is `Sync` has the
/// method of its own, any other takes the trait's.
macro_rules! is_sync {
    ($t:ty) => {{
        struct Probe<T: ?Sized>(std::marker::PhantomData<fn() -> T>);
        trait Otherwise {
            fn sync(&self) -> bool {
                false
            }
        }
        impl<T: ?Sized> Otherwise for Probe<T> {}
        #[expect(dead_code, reason = "not taken where the type is not Sync")]
        impl<T: ?Sized + Sync> Probe<T> {
            fn sync(&self) -> bool {
                true
            }
        }
        Probe::<$t>(std::marker::PhantomData).sync()
    }};
}

#[test]
fn actions_are_sent_but_not_shared_and_descriptions_are_both() {
    fn sent<T: Send + ?Sized>() {}
    fn both<T: Send + Sync>() {}
    sent::<dyn RenderAction>();
    sent::<Box<dyn RenderAction>>();
    both::<Shape>();
    both::<Volume>();
    both::<volact_core::LookupTable>();
    both::<Options>();
    both::<FrameDesc>();
    both::<volact_core::Registry>();
    assert!(!is_sync!(dyn RenderAction));
    // An action made here draws on another thread.
    let shape = shape();
    let desc = view(&shape, View::Front);
    let here = Setup::cpu().draw(std::slice::from_ref(&shape), &desc);
    let mut action = Setup::cpu().action();
    let there = std::thread::spawn(move || draw(&mut *action, &[shape], &desc).unwrap()).join().unwrap();
    assert!(identical(&here, &there));
}

#[test]
#[expect(unsafe_code, reason = "the application's own memory")]
fn application_memory_is_used_in_place_and_released_by_its_last_user() {
    static RELEASED: AtomicUsize = AtomicUsize::new(0);
    let released = || RELEASED.load(Ordering::SeqCst);
    let memory: &'static [u8] = Box::leak((0..1000).map(|i| (i % 200) as u8).collect());
    let release = || {
        RELEASED.fetch_add(1, Ordering::SeqCst);
    };
    // SAFETY: leaked memory lives for ever and is never written.
    let buffer = unsafe { Buffer::from_raw(memory.as_ptr(), memory.len(), release) };
    let data = Volume::new(VolumeDesc::new([10; 3], ScalarType::U8, 1), buffer).unwrap();
    assert_eq!(data.data().bytes().as_ptr(), memory.as_ptr(), "no copy");
    let shape = lut(&data, table(0.5), 1.0);
    assert_eq!(shape.state().volume().unwrap().volume().data().bytes().as_ptr(), memory.as_ptr(), "no copy");
    let mut action = Setup::cpu().action();
    let desc = view(&shape, View::Iso);
    let frame = draw(&mut *action, std::slice::from_ref(&shape), &desc).unwrap();
    assert!(frame.color.iter().any(|c| c[3] > 0.0));
    drop(data);
    assert_eq!(released(), 0, "the shape uses it");
    action.unmanage(&shape).unwrap();
    drop(shape);
    // Queued: at the latest the next frame lets it go.
    action.begin_draw(&desc).unwrap();
    action.end_draw().unwrap();
    assert_eq!(released(), 1, "unmanaged and dropped");
    drop(action);
    assert_eq!(released(), 1);
}

/// What is managed lives as long as it is managed.
#[test]
fn managed_shape_keeps_its_data() {
    let data = constant(100.0, [3, 3, 3]);
    let shape = lut(&data, table(0.5), 1.0);
    let desc = view(&shape, View::Front);
    let mut action = Setup::cpu().action();
    action.manage(&shape).unwrap();
    drop(data);
    assert!(draw_managed(&mut *action, &[shape], &desc).unwrap().color.iter().any(|c| c[3] > 0.0));
}

/// A failed `begin_draw` leaves no frame open, and says which shape is to blame.
#[test]
fn failed_frames_leave_the_action_usable() {
    let good = shape();
    let bad = lut(&volume([3, 3, 3], ScalarType::U8, |_| 1.0), table(0.5), 1.0).named("flat");
    for name in ["cpu", "reference"] {
        let mut action = Setup::new(name).action();
        action.manage(&good).unwrap();
        action.manage(&bad).unwrap();
        bad.set_transform(DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)));
        let error = action.begin_draw(&view(&good, View::Front)).unwrap_err();
        assert!(matches!(error, ActionError::Transform { .. }) && error.to_string().contains("flat"), "{error}");
        assert!(matches!(action.draw(&good), Err(ActionError::NotDrawing { .. })));
        bad.set_transform(DAffine3::IDENTITY);
        draw_managed(&mut *action, std::slice::from_ref(&good), &view(&good, View::Front)).unwrap();
    }
}
