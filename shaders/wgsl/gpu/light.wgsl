// What a ray has gathered: premultiplied colour, what is left of the light from behind, and where
// opacity reached the threshold.

var<private> volact_color: vec4<f32>;
var<private> volact_left: f32;
var<private> volact_depth: f32;
var<private> volact_samples: u32;
// Segments of the lattice that were known to be empty.
var<private> volact_skipped: u32;

fn volact_dark() {
    volact_color = vec4<f32>(0.0);
    volact_left = 1.0;
    volact_depth = volact_frame.infinity;
    volact_samples = 0u;
    volact_skipped = 0u;
}

// Emission and absorption of a medium from t0 to t1: the exact exponential.
fn volact_through(m: Medium, t0: f32, t1: f32) {
    let part = volact_absorb(m.extinction * (t1 - t0));
    let left = volact_left * part.y;
    let wanted = 1.0 - volact_frame.threshold;
    if left <= wanted && volact_left > wanted {
        volact_depth = select(t0 + log(volact_left / wanted) / m.extinction, t0, volact_is_infinite(m.extinction));
    }
    volact_color += (volact_left * part.x) * vec4<f32>(m.color, 1.0);
    volact_left = left;
}

// A place without length, of premultiplied colour.
fn volact_meet(color: vec4<f32>, t: f32) {
    let left = volact_left * (1.0 - color.a);
    let wanted = 1.0 - volact_frame.threshold;
    if left <= wanted && volact_left > wanted { volact_depth = t; }
    volact_color += volact_left * color;
    volact_left = left;
}

// A medium that can be seen: what is not a number is nothing.
fn volact_seen(m: Medium) -> bool {
    let sum = m.color.r + m.color.g + m.color.b;
    return m.extinction > 0.0 && !volact_is_nan(sum) && !volact_is_nan(m.extinction);
}

// A medium whose extinction is an opacity, as premultiplied colour.
fn volact_premultiplied(m: Medium) -> vec4<f32> {
    if !volact_seen(m) { return vec4<f32>(0.0); }
    let a = min(m.extinction, 1.0);
    return vec4<f32>(m.color * a, a);
}

// Whether to stop, between two segments: at every 32nd border, whatever was skipped.
fn volact_is_done(before: i32, k: i32) -> bool {
    return (before >> 5u) != (k >> 5u) && volact_left < volact_frame.termination;
}
