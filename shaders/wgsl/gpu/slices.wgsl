// A picture by slabs: planes at right angles to the view axis, between which a shape's rays are cut.
//
// A draw is a run: slabs of one shape, one behind the other, between which no other shape comes. Its
// polygon covers the pixels that can see them. A fragment cuts its ray by shape, clips and each slab,
// gathers the segments from front to back, and hands what it has to the next run through the pixel's
// light: colour; then what is left of the light from behind, depth, a state, and the number of samples.
// The states: 0 nothing yet, 1 some, 2 enough: the ray has ended.
//
// Levels are counted along the axis from the anchor; slab k begins at `volact_plane(k, rest)`, where rest
// is what the anchor lacks to a plane.

// What the application has drawn: for each pixel premultiplied colour, then where it is.
@group(0) @binding(3) var<storage, read> volact_limits: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> volact_light: array<vec4<f32>>;

struct VolactCorner {
    @builtin(position) place: vec4<f32>,
    // The shape, its first slab, and the one after its last.
    @location(0) @interpolate(flat) run: vec3<i32>,
    @location(1) @interpolate(flat) rest: f32,
}

@vertex
fn volact_corner(@location(0) place: vec2<f32>, @location(1) run: vec3<i32>, @location(2) rest: f32) -> VolactCorner {
    return VolactCorner(vec4<f32>(place, 0.5, 1.0), run, rest);
}

fn volact_plane(k: i32, rest: f32) -> f32 {
    return fma(f32(k), volact_frame.step, fma(f32(k), volact_frame.step_rest, rest));
}

// Gathers the slabs of a run between a and b; whether the ray ends in it.
fn volact_slabs(run: vec3<i32>, rest: f32, ray: VolactRay, a: f32, b: f32) -> bool {
    let slope = dot(volact_frame.axis, ray.direction);
    let place = dot(volact_frame.axis, ray.start);
    let shape = u32(run.x);
    var k = max(run.y, i32(floor((fma(a, slope, place) - rest) / volact_frame.step)));
    var border = (volact_plane(k, rest) - place) / slope;
    while k < run.z && border < b {
        let t0 = max(border, a);
        k += 1;
        border = (volact_plane(k, rest) - place) / slope;
        let t1 = min(border, b);
        if t1 > t0 {
            let m = volact_shade(shape, volact_sample(shape, ray, 0.5 * (t0 + t1), t1 - t0, 0.0));
            volact_samples += 1u;
            if volact_seen(m) { volact_through(m, t0, t1); }
        }
        if volact_is_done(k - 1, k) { return true; }
    }
    return false;
}

@fragment
fn volact_run(corner: VolactCorner) {
    let pixel = vec2<u32>(corner.place.xy);
    if pixel.x >= volact_frame.size.x || pixel.y >= volact_frame.size.y { return; }
    let at = 2u * (pixel.y * volact_frame.size.x + pixel.x);
    volact_dark();
    let known = volact_light[at + 1u];
    if known.z == 2.0 { return; }
    if known.z == 1.0 {
        volact_color = volact_light[at];
        volact_left = known.x;
        volact_depth = known.y;
    }
    var ray = volact_ray(pixel);
    if volact_frame.limited != 0u { ray.end = min(ray.end, volact_limits[at + 1u].x); }
    let spans = volact_spans(u32(corner.run.x), ray);
    var state = 1.0;
    for (var i = 0u; i < spans.count; i += 1u) {
        if volact_slabs(corner.run, corner.rest, ray, spans.ends[i].x, spans.ends[i].y) {
            state = 2.0;
            break;
        }
    }
    if volact_samples == 0u { return; }
    volact_light[at] = volact_color;
    volact_light[at + 1u] = vec4<f32>(volact_left, volact_depth, state, known.w + f32(volact_samples));
}
