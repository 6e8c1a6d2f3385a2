// What all stages and all functions of parameters share: types, the buffers that hold a frame's
// numbers, and functions of opacity that keep their digits where little is absorbed.
//
// Local space: the world's axes and units, the origin near the shape. Places on a ray are counted
// in `t`, the world distance from the anchor: the point of the anchor ray at a segment's border near
// the middle of the scene. So all numbers are of the scene's own size, wherever in the world it is.

struct Medium { color: vec3<f32>, extinction: f32 }
struct Sample { position: vec3<f32>, direction: vec3<f32>, step: f32, view: vec3<f32>, depth: f32, value: f32 }

struct VolactFrame {
    // The direction of the anchor ray, of length 1, and the distance of the anchor from the eye.
    toward: vec3<f32>,
    start: f32,
    // What a column more changes of the point on the image plane, at distance 1.
    dx: vec3<f32>,
    perspective: f32,
    // The same for a row.
    dy: vec3<f32>,
    // Width of the lattice's segments, in two numbers whose sum it is.
    step: f32,
    // Normal of the near and far planes, and what step leaves.
    axis: vec3<f32>,
    step_rest: f32,
    // Distances of the near and far planes from the anchor along their normal.
    near: f32,
    far: f32,
    // Where rays begin at the earliest, and what `t` lacks to a depth.
    first: f32,
    depth_shift: f32,
    // The pixel through which the anchor ray goes.
    anchor: vec2<f32>,
    // Columns and rows of the viewport.
    size: vec2<u32>,
    // 1 where the application has drawn something.
    limited: u32,
    // Opacity at which depth is taken, and transmittance below which rays end.
    threshold: f32,
    termination: f32,
    // Infinity, which no text can say.
    infinity: f32,
    // Rows of this dispatch begin here.
    first_row: u32,
    // Rounds of the loop that shows whether loops were cut short.
    probe: u32,
    // The number of the first surface, and the one after the last.
    surfaces: vec2<u32>,
}

@group(0) @binding(0) var<uniform> volact_frame: VolactFrame;
@group(0) @binding(1) var<uniform> volact_numbers: array<vec4<u32>, 4096>;
@group(0) @binding(2) var<storage, read> volact_tables: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> volact_flags: array<atomic<u32>, 195>;
@group(0) @binding(8) var<storage, read> volact_meshes: array<vec4<u32>>;

// Rounds that loops of shaders may still go for this sample, and the shape that is evaluated.
var<private> volact_rounds: u32;
var<private> volact_shape: u32;
// The vertices of the cell that holds the sample at hand, and what each counts for there.
var<private> volact_corners: vec4<u32>;
var<private> volact_weights: vec4<f32>;

fn volact_floats(row: u32) -> vec4<f32> { return bitcast<vec4<f32>>(volact_numbers[row]); }

fn volact_is_nan(v: f32) -> bool { return (bitcast<u32>(v) & 0x7fffffffu) > 0x7f800000u; }

fn volact_is_infinite(v: f32) -> bool { return (bitcast<u32>(v) & 0x7fffffffu) == 0x7f800000u; }

// A round of a shader's loop: true where the budget is spent, which is then the picture's error.
fn volact_round() -> bool {
    if volact_rounds == 0u {
        atomicMax(&volact_flags[0], volact_shape + 1u);
        return true;
    }
    volact_rounds -= 1u;
    return false;
}

// A device may end loops after so many rounds of all loops together, without a word. Then it ends this one too,
// before as many rounds as the host wants, which no compiler knows; all entry points end with it.
fn volact_probe() {
    var n = 0u;
    loop {
        n += 1u;
        if n >= volact_frame.probe { break; }
    }
    if f32(n) < f32(volact_frame.probe) { atomicMax(&volact_flags[129], 1u); }
}

fn volact_mesh_row(row: u32) -> vec4<f32> { return bitcast<vec4<f32>>(volact_meshes[row]); }

// -ln(1 - a): by the series of the inverse hyperbolic tangent up to one half, where the first term
// left out is below 1e-8 of the sum; infinite for 1.
fn volact_depth_of(opacity: f32) -> f32 {
    if opacity >= 1.0 { return volact_frame.infinity; }
    if opacity > 0.5 { return -log(1.0 - opacity); }
    let s = opacity / (2.0 - opacity);
    let q = s * s;
    return 2.0 * s * (1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0
        + q / 13.0))))));
}

// 1 - exp(-depth) and exp(-depth): by Taylor's series up to a quarter, where the first term left
// out is below 1e-8 of the sum.
fn volact_absorb(depth: f32) -> vec2<f32> {
    if depth < 0.25 {
        let d = depth;
        let absorbed = d * (1.0 - d * (1.0 / 2.0 - d * (1.0 / 6.0 - d * (1.0 / 24.0 - d * (1.0 / 120.0
            - d * (1.0 / 720.0 - d / 5040.0))))));
        return vec2<f32>(absorbed, 1.0 - absorbed);
    }
    let left = exp(-depth);
    return vec2<f32>(1.0 - left, left);
}
