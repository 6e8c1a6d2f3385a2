// A picture by slabs: planes at right angles to the view axis, between which rays are cut.
//
// A draw is a run: slabs, one behind the other, of shapes between which no other shape comes. Its
// polygon covers the pixels that can see them. A fragment sweeps its ray between the run's first
// plane and its last, and hands what it has to the next run through the pixel's light: colour; then what
// is left of the light from behind, depth, a state, and the number of samples. The states: 0 nothing
// yet, 1 some, 2 enough: the ray has ended, 3 shapes that are one picture each are being laid over.
//
// A shape that is one picture is one run, after all others. Before those, where there are surfaces, comes a run
// of no shape, which lays them behind what was gathered. Light is that of a band of rows, from first_row on.
//
// Levels are counted along the axis from the anchor; slab k begins at k steps and a rest, which is what
// the anchor lacks to a plane. A run's ends beyond which there is nothing of its shapes are open, so that
// what lies on a shape's very face is in a run.

// What the application has drawn: for each pixel premultiplied colour, then where it is.
@group(0) @binding(3) var<storage, read> volact_limits: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> volact_light: array<vec4<f32>>;

const VOLACT_OPEN: i32 = 0x7fffffff;
const VOLACT_FAR: f32 = 3.0e38;

struct VolactCorner {
    @builtin(position) place: vec4<f32>,
    // The first shape, the one after the last, the first slab, and the one after the last.
    @location(0) @interpolate(flat) run: vec4<i32>,
    @location(1) @interpolate(flat) rest: f32,
}

@vertex
fn volact_corner(@location(0) place: vec2<f32>, @location(1) run: vec4<i32>, @location(2) rest: f32) -> VolactCorner {
    return VolactCorner(vec4<f32>(place, 0.5, 1.0), run, rest);
}

// How levels run along the ray at hand: their rise, the level at t = 0, and where slab 0 begins.
var<private> volact_levels: vec3<f32>;
// The shapes of the run, and where it begins and ends on the ray.
var<private> volact_members: vec2<u32>;
var<private> volact_reach: vec2<f32>;

// Where slab k begins.
fn volact_border(k: i32) -> f32 {
    let level = fma(f32(k), volact_frame.step, fma(f32(k), volact_frame.step_rest, volact_levels.z));
    return (level - volact_levels.y) / volact_levels.x;
}

fn volact_first_segment(t: f32) -> i32 {
    return i32(floor((fma(t, volact_levels.x, volact_levels.y) - volact_levels.z) / volact_frame.step));
}

fn volact_swept() -> vec2<u32> { return volact_members; }

fn volact_holds(t: f32) -> bool { return t >= volact_reach.x && t < volact_reach.y; }

// Gathers a run of shapes composited in depth; whether the ray ends there.
fn volact_gather(run: vec4<i32>, whole: VolactRay) -> bool {
    volact_reach = vec2<f32>(-VOLACT_FAR, VOLACT_FAR);
    if run.z != -VOLACT_OPEN { volact_reach.x = volact_border(run.z); }
    if run.w != VOLACT_OPEN { volact_reach.y = volact_border(run.w); }
    var ray = whole;
    ray.begin = max(ray.begin, volact_reach.x);
    ray.end = min(ray.end, volact_reach.y);
    let first = volact_members.x;
    let numbers = volact_numbers[8u * first + 5u];
    // Of meshes both would take long to compile.
    let single = !MESHES && volact_members.y == first + 1u && volact_kind(first) == 0u && numbers.w == 0u;
    if ALONES || single {
        volact_over(first, ray);
    } else {
        volact_sweep(ray);
    }
    return run.w != VOLACT_OPEN && (run.w & 31) == 0 && volact_left < volact_frame.termination;
}

fn volact_drawn(corner: VolactCorner) {
    let pixel = vec2<u32>(corner.place.xy);
    if pixel.x >= volact_frame.size.x || pixel.y >= volact_frame.size.y { return; }
    if pixel.y < volact_frame.first_row { return; }
    let behind = 2u * (pixel.y * volact_frame.size.x + pixel.x);
    let at = behind - 2u * volact_frame.first_row * volact_frame.size.x;
    volact_dark();
    let known = volact_light[at + 1u];
    volact_members = vec2<u32>(corner.run.xy);
    let flat_one = DEEP < SHAPES && volact_members.x >= DEEP && volact_members.x < volact_members.y;
    if known.z == 2.0 && !flat_one { return; }
    if known.z != 0.0 {
        volact_color = volact_light[at];
        volact_left = known.x;
        volact_depth = known.y;
    }
    var ray = volact_ray(pixel);
    volact_levels = vec3<f32>(dot(volact_frame.axis, ray.direction), dot(volact_frame.axis, ray.start), corner.rest);
    var limit = volact_frame.infinity;
    if volact_frame.limited != 0u {
        limit = volact_limits[behind + 1u].x;
        ray.end = min(ray.end, limit);
    }
    let surface = volact_first_surface(ray);
    ray.end = min(ray.end, surface.w);
    var state = 1.0;
    if volact_members.x == volact_members.y {
        if volact_is_infinite(surface.w) { return; }
        volact_samples += 1u;
        volact_meet(vec4<f32>(surface.rgb, 1.0), surface.w);
    } else if flat_one {
        // What was drawn already lies behind the first picture of its own.
        if known.z != 3.0 && volact_frame.limited != 0u { volact_meet(volact_limits[behind], limit); }
        let color = volact_flat(volact_members.x, ray);
        if volact_samples == 0u { return; }
        volact_color = color + (1.0 - color.a) * volact_color;
        state = 3.0;
    } else {
        let before = volact_left;
        if volact_gather(corner.run, ray) { state = 2.0; }
        if volact_samples + volact_skipped == 0u && volact_left == before { return; }
        if volact_skipped > 0u {
            let counter = ((pixel.x >> 3u) + 7u * (pixel.y >> 3u)) % 64u;
            atomicAdd(&volact_flags[130u + counter], volact_skipped);
        }
    }
    volact_light[at] = volact_color;
    volact_light[at + 1u] = vec4<f32>(volact_left, volact_depth, state, known.w + f32(volact_samples));
}

@fragment
fn volact_run(corner: VolactCorner) {
    volact_drawn(corner);
    volact_probe();
}
