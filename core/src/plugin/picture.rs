//! Pictures on their way back: the host collects, an action in Rust fills.

use std::{ffi::c_void, time::Duration};

use super::{
    abi::{self, ArrayView, FrameSink, Text, WarningSink},
    arena::{Arena, flag},
    array::{Passing, Received, lend, receive},
    services::{answer, words},
    status::{Code, Fault, caught, result_of},
};
use crate::{Frame, FrameDesc, Pixels, Severity, Warning, WarningCode, frame::Rebuild};

/// The codes of warnings that cross by their names.
const WARNINGS: [WarningCode; 9] = [
    WarningCode::UnitDistanceDefaulted,
    WarningCode::UnusedParameter,
    WarningCode::CoarseSampling,
    WarningCode::NothingVisible,
    WarningCode::SettingAdjusted,
    WarningCode::FileContent,
    WarningCode::NotCertified,
    WarningCode::LabelWithoutEntry,
    WarningCode::Plugin,
];

/// The host's side of a sink of warnings.
pub(super) fn warning_sink(warnings: &mut Vec<Warning>) -> WarningSink {
    WarningSink { user: std::ptr::from_mut(warnings).cast(), warn: Some(push_warning) }
}

/// The most warnings of one call.
const MOST_WARNINGS: usize = 1000;

unsafe extern "C" fn push_warning(user: *mut c_void, note: u32, code: Text, subject: Text, message: Text) {
    told(|| {
        // SAFETY: `user` is the list of the call that is still running; nobody else has it meanwhile.
        let warnings = unsafe { &mut *user.cast::<Vec<Warning>>() };
        // SAFETY: the texts are valid during the call.
        unsafe { push(warnings, note, [code, subject, message]) }
    });
}

unsafe extern "C" fn push_to_frame(user: *mut c_void, note: u32, code: Text, subject: Text, message: Text) {
    told(|| {
        // SAFETY: `user` is what `sink` made.
        let warnings = unsafe { &mut collector(user).frame.warnings };
        // SAFETY: the texts are valid during the call.
        unsafe { push(warnings, note, [code, subject, message]) }
    });
}

fn told(run: impl FnOnce() -> Result<(), Fault>) {
    if let Err(fault) = caught(run) {
        log::warn!("a plugin's warning cannot be read: {fault}");
    }
}

/// # Safety
/// The texts are valid.
unsafe fn push(warnings: &mut Vec<Warning>, note: u32, texts: [Text; 3]) -> Result<(), Fault> {
    let [code, subject, message] = texts;
    // SAFETY: as promised by the caller.
    let (code, subject, message) =
        unsafe { (words(code, "code")?, words(subject, "subject")?, words(message, "message")?) };
    if warnings.len() < MOST_WARNINGS {
        let code = WARNINGS.into_iter().find(|c| c.as_str() == code).unwrap_or(WarningCode::Plugin);
        let severity = if flag(note, "note")? { Severity::Note } else { Severity::Warning };
        warnings.push(Warning { severity, code, subject, message });
    }
    Ok(())
}

fn text(text: &str) -> Text {
    Text { data: text.as_ptr(), length: text.len() as u64 }
}

/// Tells warnings to a sink of the host.
///
/// # Safety
/// The sink is valid.
pub(super) unsafe fn tell_warnings(sink: &WarningSink, warnings: &[Warning]) {
    let Some(warn) = sink.warn else { return };
    for w in warnings {
        let note = u32::from(w.severity == Severity::Note);
        // SAFETY: as promised by the caller; the texts live through the call.
        unsafe { warn(sink.user, note, text(w.code.as_str()), text(&w.subject), text(&w.message)) };
    }
}

/// Collects a picture for the host.
pub(super) struct Collector {
    frame: Frame,
    size: [usize; 2],
    drawn: bool,
}

impl Collector {
    pub fn new(desc: &FrameDesc) -> Self {
        let mut frame = Frame::empty(&FrameDesc { width: 0, height: 0, ..desc.clone() });
        (frame.width, frame.height) = (desc.width, desc.height);
        Self { frame, size: [desc.width, desc.height], drawn: false }
    }

    /// The sink to hand to a plugin. It is valid as long as nobody uses the collector otherwise.
    pub fn sink(&mut self) -> FrameSink {
        let user = std::ptr::from_mut(self).cast();
        FrameSink {
            size: size_of::<FrameSink>() as u32,
            reserved: 0,
            user,
            target: Some(target),
            share: Some(share),
            warnings: WarningSink { user, warn: Some(push_to_frame) },
            say: Some(say),
            count: Some(count),
            rebuilt: Some(rebuilt),
        }
    }

    /// The picture.
    ///
    /// # Errors
    /// If the plugin never drew one.
    pub fn finish(self) -> Result<Frame, Fault> {
        if self.drawn {
            return Ok(self.frame);
        }
        let message = "end_draw gave no picture: neither target nor share of the sink was called";
        Err(Fault::new(Code::BadValue, message))
    }
}

/// # Safety
/// `user` is the collector of the call that is still running.
unsafe fn collector<'a>(user: *mut c_void) -> &'a mut Collector {
    // SAFETY: as promised by the caller; the host does not touch it meanwhile.
    unsafe { &mut *user.cast() }
}

unsafe extern "C" fn target(user: *mut c_void, color: *mut *mut f32, depth: *mut *mut f32) -> i32 {
    answer(|| {
        if color.is_null() || depth.is_null() {
            return Err(Fault::bad("color or depth", "a null pointer", "two places for addresses"));
        }
        // SAFETY: `user` is what `sink` made.
        let collector = unsafe { collector(user) };
        let pixels = collector.size[0] * collector.size[1];
        if !collector.drawn {
            collector.frame.color = vec![[0.0; 4]; pixels].into();
            collector.frame.depth = vec![f32::INFINITY; pixels].into();
            collector.drawn = true;
        }
        // SAFETY: neither is null, and the plugin gave them for this.
        unsafe {
            *color = collector.frame.color.as_mut_ptr().cast();
            *depth = collector.frame.depth.as_mut_ptr();
        }
        Ok(())
    })
}

unsafe extern "C" fn share(user: *mut c_void, color: *const ArrayView, depth: *const ArrayView) -> i32 {
    answer(|| {
        // SAFETY: `user` is what `sink` made, and the views are valid during the call.
        let (collector, color, depth) = unsafe { (collector(user), color.as_ref(), depth.as_ref()) };
        let (Some(color), Some(depth)) = (color, depth) else {
            return Err(Fault::bad("color or depth", "a null pointer", "two views"));
        };
        let [width, height] = collector.size.map(|n| n as u64);
        // SAFETY: the plugin answers for what the views say.
        let color = unsafe { receive(color, "colours", Passing::Lent) }?;
        // SAFETY: as above.
        let depth = unsafe { receive(depth, "depths", Passing::Lent) }?;
        let wrong = |got: &Received, what: &str, wanted: &[u64]| {
            let right = got.scalar == abi::SCALAR_F32 && got.shape == wanted;
            let found = format!("{:?} of scalar type {}", got.shape, got.scalar);
            if right { Ok(()) } else { Err(Fault::bad(what, found, format!("{wanted:?} of f32"))) }
        };
        wrong(&color, "shape of the colours", &[4, width, height])?;
        wrong(&depth, "shape of the depths", &[width, height])?;
        let odd = || Fault::bad("address of the picture", "odd", "an aligned one");
        collector.frame.color = Pixels::shared(color.buffer).ok_or_else(odd)?;
        collector.frame.depth = Pixels::shared(depth.buffer).ok_or_else(odd)?;
        collector.drawn = true;
        Ok(())
    })
}

unsafe extern "C" fn say(user: *mut c_void, name: Text, value: Text) -> i32 {
    answer(|| {
        // SAFETY: the texts are valid during the call.
        let (name, value) = unsafe { (words(name, "name")?, words(value, "value")?) };
        // SAFETY: `user` is what `sink` made.
        let frame = unsafe { &mut collector(user).frame };
        let method = &mut frame.method;
        match name.as_str() {
            "sampling" => method.sampling = value,
            "classification" => method.classification = value,
            "texture_format" => method.texture_format = value,
            "filter" => method.filter = value,
            "blend" => method.blend = value,
            "device" => method.device = value,
            _ => frame.statistics.details.push((name, value)),
        }
        Ok(())
    })
}

unsafe extern "C" fn count(user: *mut c_void, name: Text, value: f64) -> i32 {
    answer(|| {
        // SAFETY: the text is valid during the call.
        let name = unsafe { words(name, "name")? };
        // SAFETY: `user` is what `sink` made.
        let frame = unsafe { &mut collector(user).frame };
        let (method, statistics) = (&mut frame.method, &mut frame.statistics);
        let time = Duration::try_from_secs_f64(value).unwrap_or_default();
        match name.as_str() {
            "sample_distance" => method.sample_distance = value,
            "table_width" => method.table_width = value as usize,
            "termination" => method.termination = value,
            "total" => statistics.total = time,
            "prepare" => statistics.prepare = time,
            "render" => statistics.render = time,
            "rays" => statistics.rays = value as u64,
            "samples" => statistics.samples = value as u64,
            "skipped" => statistics.skipped = value as u64,
            "resident_bytes" => statistics.resident_bytes = value as usize,
            "uploaded_bytes" => statistics.uploaded_bytes = value as usize,
            "threads" => statistics.threads = value as usize,
            _ => return Err(Fault::new(Code::BadName, format!("no figure is called {name:?}"))),
        }
        Ok(())
    })
}

unsafe extern "C" fn rebuilt(user: *mut c_void, shape: Text, what: Text, bytes: u64) -> i32 {
    answer(|| {
        // SAFETY: the texts are valid during the call.
        let (shape, what) = unsafe { (words(shape, "shape")?, words(what, "what")?) };
        // SAFETY: `user` is what `sink` made.
        let statistics = unsafe { &mut collector(user).frame.statistics };
        statistics.rebuilt.push(Rebuild { shape, what, bytes: usize::try_from(bytes).unwrap_or(usize::MAX) });
        Ok(())
    })
}

/// Hands an action's frame to the host, without a copy.
///
/// # Safety
/// The sink is valid.
pub(super) unsafe fn show(frame: Frame, sink: &FrameSink) -> Result<(), Fault> {
    let Frame { width, height, color, depth, background: _, warnings, method, statistics, plan: _ } = frame;
    let (width, height) = (width as u64, height as u64);
    let missing = || Fault::new(Code::BadVersion, "the frame's sink lacks a function");
    let mut arena = Arena::default();
    let color = lend(abi::KIND_ARRAY, abi::SCALAR_F32, &[4, width, height], &color.into(), &mut arena);
    let depth = lend(abi::KIND_ARRAY, abi::SCALAR_F32, &[width, height], &depth.into(), &mut arena);
    let share = sink.share.ok_or_else(missing)?;
    // SAFETY: as promised by the caller; the host retains both.
    result_of(unsafe { share(sink.user, &raw const color, &raw const depth) })?;
    // SAFETY: as promised by the caller.
    unsafe { tell_warnings(&sink.warnings, &warnings) };
    let (say, count, rebuilt) =
        (sink.say.ok_or_else(missing)?, sink.count.ok_or_else(missing)?, sink.rebuilt.ok_or_else(missing)?);
    let words = [
        ("sampling", &method.sampling),
        ("classification", &method.classification),
        ("texture_format", &method.texture_format),
        ("filter", &method.filter),
        ("blend", &method.blend),
        ("device", &method.device),
    ];
    let details = statistics.details.iter().map(|(name, value)| (name.as_str(), value));
    for (name, value) in words.into_iter().chain(details) {
        // SAFETY: as promised by the caller; the texts live through the call.
        result_of(unsafe { say(sink.user, text(name), text(value)) })?;
    }
    let numbers = [
        ("sample_distance", method.sample_distance),
        ("table_width", method.table_width as f64),
        ("termination", method.termination),
        ("total", statistics.total.as_secs_f64()),
        ("prepare", statistics.prepare.as_secs_f64()),
        ("render", statistics.render.as_secs_f64()),
        ("rays", statistics.rays as f64),
        ("samples", statistics.samples as f64),
        ("skipped", statistics.skipped as f64),
        ("resident_bytes", statistics.resident_bytes as f64),
        ("uploaded_bytes", statistics.uploaded_bytes as f64),
        ("threads", statistics.threads as f64),
    ];
    for (name, value) in numbers {
        // SAFETY: as above.
        result_of(unsafe { count(sink.user, text(name), value) })?;
    }
    for r in &statistics.rebuilt {
        // SAFETY: as above.
        result_of(unsafe { rebuilt(sink.user, text(&r.shape), text(&r.what), r.bytes as u64) })?;
    }
    Ok(())
}
