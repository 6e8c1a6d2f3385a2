//! What was drawn, how, and how fast.

use std::{
    fmt::Write as _,
    path::Path,
    sync::{Mutex, PoisonError},
    time::Duration,
};

use serde_json::{Value, json};
use volact::{
    Frame, ParameterValue, Shape, VolumeTexture,
    core::{
        Method, Severity, Warning,
        planner::{Plan, knobs::word},
        select, warning,
    },
};

use super::source::Source;

static SAID: Mutex<Vec<Warning>> = Mutex::new(Vec::new());

/// Logs warnings as they arise, and remembers them, so that none is said twice.
pub fn listen() {
    let handler = |warning: &Warning| {
        SAID.lock().unwrap_or_else(PoisonError::into_inner).push(warning.clone());
        say(warning);
    };
    warning::set_handler(Some(Box::new(handler)));
}

fn say(warning: &Warning) {
    match warning.severity {
        Severity::Note => log::info!("{warning}"),
        Severity::Warning => log::warn!("{warning}"),
    }
}

/// A finished picture.
pub struct Report<'a> {
    /// What was drawn.
    pub source: &'a Source,
    /// What came of it.
    pub frame: &'a Frame,
    /// Where it went.
    pub output: &'a Path,
}

impl Report<'_> {
    /// Logs the frame's warnings that were not logged when they arose.
    pub fn warn(&self) {
        let said = SAID.lock().unwrap_or_else(PoisonError::into_inner);
        self.frame.warnings.iter().filter(|w| !said.contains(w)).for_each(say);
    }

    /// The summary for people.
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        let frame = self.frame;
        _ = writeln!(text, "{}: {} × {} pixels", self.output.display(), frame.width, frame.height);
        for shape in &self.source.shapes {
            _ = writeln!(text, "  drawn   {}", describe(shape));
        }
        for note in &self.source.notes {
            _ = writeln!(text, "  look    {note}");
        }
        _ = writeln!(text, "  how     {}: {}", self.source.choice.name, method(&frame.method));
        if let Some(chosen) = &frame.plan {
            _ = writeln!(text, "  plan    {}", plan(chosen));
        }
        // That a backend, or its device, is not there at all is no news, unless the user wants all of them.
        let told = |why: &str| !select::is_absent(why) || log::log_enabled!(log::Level::Info);
        for (name, why) in self.source.choice.refused.iter().filter(|(_, why)| told(why)) {
            _ = writeln!(text, "  not by  {name}: {why}");
        }
        _ = writeln!(text, "  speed   {}", self.speed());
        for (name, value) in &frame.statistics.details {
            _ = writeln!(text, "          {name}: {value}");
        }
        text
    }

    fn speed(&self) -> String {
        let s = &self.frame.statistics;
        let mut text = format!("{} ({} preparing, {} drawing)", time(s.total), time(s.prepare), time(s.render));
        if s.samples > 0 {
            let rate = s.samples as f64 / s.render.as_secs_f64().max(1e-9);
            _ = write!(text, "; {} samples, {}/s", count(s.samples as f64), count(rate));
        }
        if s.skipped > 0 {
            let part = 100.0 * s.skipped as f64 / (s.skipped + s.samples) as f64;
            _ = write!(text, ", {part:.0} % of space skipped");
        }
        text
    }

    /// The summary for programs.
    pub fn to_json(&self) -> Value {
        let (frame, choice) = (self.frame, &self.source.choice);
        let s = &frame.statistics;
        let warning = |w: &Warning| json!({"code": w.code.as_str(), "subject": w.subject, "message": w.message});
        json!({
            "output": self.output.display().to_string(),
            "width": frame.width,
            "height": frame.height,
            "shapes": self.source.shapes.iter().map(shape_json).collect::<Vec<_>>(),
            "look": self.source.notes,
            "action": choice.name,
            "refused": choice.refused.iter().map(|(n, why)| json!({"action": n, "why": why})).collect::<Vec<_>>(),
            "method": method_json(&frame.method),
            "plan": frame.plan.as_ref().map(plan_json),
            "statistics": {
                "total_ms": milliseconds(s.total), "prepare_ms": milliseconds(s.prepare),
                "render_ms": milliseconds(s.render), "rays": s.rays, "samples": s.samples, "skipped": s.skipped,
                "rebuilt": s.rebuilt.iter().map(|r| json!({"shape": r.shape, "what": r.what, "bytes": r.bytes})).collect::<Vec<_>>(),
                "resident_bytes": s.resident_bytes, "uploaded_bytes": s.uploaded_bytes, "threads": s.threads,
                "details": s.details.iter().map(|(k, v)| (k.clone(), json!(v))).collect::<serde_json::Map<_, _>>(),
            },
            "warnings": frame.warnings.iter().map(warning).collect::<Vec<_>>(),
        })
    }
}

/// How a frame is drawn, in words.
pub fn method(method: &Method) -> String {
    let mut parts: Vec<String> = Vec::new();
    let mut part = |text: String, there: bool| parts.extend(there.then_some(text));
    part(method.sampling.clone(), !method.sampling.is_empty());
    part(format!("every {:.4}", method.sample_distance), method.sample_distance > 0.0);
    part(method.classification.clone(), !method.classification.is_empty());
    part(format!("table of {}", method.table_width), method.table_width > 0);
    part(format!("voxels {}", method.texture_format), !method.texture_format.is_empty());
    part(format!("filter {}", method.filter), !method.filter.is_empty());
    part(format!("blend {}", method.blend), !method.blend.is_empty());
    part(method.device.clone(), !method.device.is_empty());
    if parts.is_empty() { "nothing to tell".into() } else { parts.join(", ") }
}

/// How a frame is drawn, for programs.
pub fn method_json(m: &Method) -> Value {
    json!({
        "sampling": m.sampling, "sample_distance": m.sample_distance, "classification": m.classification,
        "table_width": m.table_width, "texture_format": m.texture_format, "filter": m.filter,
        "blend": m.blend, "termination": m.termination, "device": m.device,
    })
}

/// What was chosen, in words.
pub fn plan(plan: &Plan) -> String {
    let of = |seconds| time(Duration::try_from_secs_f64(seconds).unwrap_or_default());
    let mut text = format!(
        "{}; expects errors of {:.1e} (max) and {:.1e} (rmse) in {}; planned in {} by {} pixels",
        plan.setting,
        plan.max_error,
        plan.rmse,
        of(plan.seconds),
        time(plan.planning),
        plan.sparse
    );
    if !plan.kept {
        text += "; what was asked for is NOT expected to be kept";
    }
    text
}

/// What was chosen, for programs.
pub fn plan_json(plan: &Plan) -> Value {
    json!({
        "action": plan.action, "setting": plan.setting, "step": plan.step,
        "options": plan.options.iter().map(|(k, v)| (k.clone(), json!(word(v)))).collect::<serde_json::Map<_, _>>(),
        "max_error": plan.max_error, "rmse": plan.rmse, "expected_ms": 1e3 * plan.seconds, "kept": plan.kept,
        "refining": plan.refining, "planning_ms": milliseconds(plan.planning), "sparse_pixels": plan.sparse,
    })
}

fn texture(shape: &Shape) -> Option<VolumeTexture> {
    shape.state().volume().cloned()
}

fn describe(shape: &Shape) -> String {
    let state = shape.state();
    let mut text = format!("{}: shader {}, geometry {}", shape.name(), state.shader, state.geometry.name());
    if let Some(texture) = texture(shape) {
        let (desc, [x, y, z]) = (texture.volume().desc(), texture.data_roi().dims());
        let several = if desc.components > 1 { format!("{} × ", desc.components) } else { String::new() };
        _ = write!(text, ", {x} × {y} × {z} samples of {several}{}", desc.scalar);
    }
    if let Some(vertices) = state.geometry.vertex_count() {
        _ = write!(text, " of {} vertices", count(vertices as f64));
    }
    if let Some(ParameterValue::Attribute(attribute)) = state.parameters.get("scalars") {
        _ = write!(text, ", attribute {:?} of {}", attribute.name, attribute.scalar);
    }
    if let Some(slices) = state.geometry.slices() {
        _ = write!(text, ", {} slice planes", slices.planes.len());
    }
    if let Some(unit) = state.parameters.get("unit_distance").and_then(ParameterValue::as_float) {
        _ = write!(text, ", unit distance {unit:.4}");
    }
    text
}

fn shape_json(shape: &Shape) -> Value {
    let state = shape.state();
    let volume = texture(shape).map(|t| {
        let desc = t.volume().desc();
        json!({"name": desc.name, "dims": t.data_roi().dims(), "scalar": desc.scalar.name(), "components": desc.components})
    });
    json!({
        "name": shape.name(), "shader": state.shader, "geometry": state.geometry.name(),
        "vertices": state.geometry.vertex_count(), "volume": volume,
    })
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// A time in the unit that suits it.
pub fn time(time: Duration) -> String {
    match time.as_secs_f64() {
        s if s >= 10.0 => format!("{s:.1} s"),
        s if s >= 0.1 => format!("{:.0} ms", s * 1e3),
        s => format!("{:.2} ms", s * 1e3),
    }
}

/// A large number in the unit that suits it.
pub fn count(n: f64) -> String {
    match n {
        n if n >= 1e9 => format!("{:.2} G", n / 1e9),
        n if n >= 1e6 => format!("{:.1} M", n / 1e6),
        n if n >= 1e4 => format!("{:.0} k", n / 1e3),
        n => format!("{n:.0}"),
    }
}
