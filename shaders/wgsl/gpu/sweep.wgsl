// Several shapes, surfaces of values and slices along a ray. Where shapes overlap extinctions add:
// segments are cut to the pieces that they share. Places without length come before the medium that
// begins there; several at one place have the opacity 1 - Π(1 - a) and the colour Σac/Σa.

struct VolactTrack {
    spans: VolactSpans,
    rest: VolactRest,
    span: u32,
    // The number of the next segment, of the one where the piece at hand begins, and that piece with
    // its medium.
    k: i32,
    first: i32,
    start: f32,
    end: f32,
    medium: Medium,
    // For surfaces: the value at the piece's end, the number of the next value that is crossed, the
    // way the value runs, and where the next crossing is.
    last: f32,
    next: u32,
    rising: bool,
    crossing: f32,
}

var<private> volact_tracks: array<VolactTrack, TRACKS>;

fn volact_kind(shape: u32) -> u32 { return volact_numbers[8u * shape + 4u].z; }

fn volact_track(shape: u32, ray: VolactRay) {
    volact_fill(shape, ray, volact_whole());
    volact_tracks[shape].end = -3.0e38;
    if (volact_numbers[8u * shape + 4u].w & VOLACT_INSIDE) == 0u {
        volact_tracks[shape].span = volact_tracks[shape].spans.count;
        volact_tracks[shape].rest.more = false;
    }
    volact_forward(shape, ray);
}

// The stretches of a shape behind a place, as many as there is room for.
fn volact_fill(shape: u32, ray: VolactRay, rest: VolactRest) {
    let spans = volact_spans(shape, ray, rest);
    volact_tracks[shape].spans = spans;
    volact_tracks[shape].rest = volact_rest;
    volact_tracks[shape].span = 0u;
    volact_tracks[shape].k = volact_first_segment(spans.ends[0].x);
}

// The next piece of a shape; at the end it begins at infinity.
fn volact_forward(shape: u32, ray: VolactRay) {
    volact_tracks[shape].crossing = volact_frame.infinity;
    loop {
        let span = volact_tracks[shape].span;
        if span >= volact_tracks[shape].spans.count {
            if !MESHES || !volact_tracks[shape].rest.more { break; }
            volact_fill(shape, ray, volact_tracks[shape].rest);
            continue;
        }
        let ends = volact_tracks[shape].spans.ends[span];
        let k = volact_tracks[shape].k;
        let t0 = max(volact_border(k), ends.x);
        let t1 = min(volact_border(k + 1), ends.y);
        if t0 >= ends.y {
            volact_tracks[shape].span = span + 1u;
            if span + 1u < volact_tracks[shape].spans.count {
                volact_tracks[shape].k = volact_first_segment(volact_tracks[shape].spans.ends[span + 1u].x);
            }
            continue;
        }
        volact_tracks[shape].first = k;
        volact_tracks[shape].k = k + 1;
        if t1 > t0 {
            let middle = 0.5 * (t0 + t1);
            let ahead = volact_ahead(shape, ray, middle);
            if ahead > middle {
                let next = volact_beyond(k + 1, ahead, ends.y);
                volact_skipped += u32(next - k);
                volact_tracks[shape].k = next;
                volact_tracks[shape].start = t0;
                volact_tracks[shape].end = min(volact_border(next), ends.y);
                volact_tracks[shape].medium = Medium(vec3<f32>(0.0), 0.0);
                return;
            }
            volact_take(shape, ray, t0, t1, t0 == ends.x);
            return;
        }
    }
    volact_tracks[shape].start = volact_frame.infinity;
    volact_tracks[shape].end = volact_frame.infinity;
    volact_tracks[shape].medium = Medium(vec3<f32>(0.0), 0.0);
}

fn volact_take(shape: u32, ray: VolactRay, t0: f32, t1: f32, enters: bool) {
    volact_tracks[shape].start = t0;
    volact_tracks[shape].end = t1;
    volact_tracks[shape].medium = Medium(vec3<f32>(0.0), 0.0);
    volact_samples += 1u;
    if !CROSSES || volact_kind(shape) != VOLACT_FIRST {
        let m = volact_shade(shape, volact_sample(shape, ray, 0.5 * (t0 + t1), t1 - t0, 0.0));
        if volact_seen(m) { volact_tracks[shape].medium = m; }
        return;
    }
    var a = volact_tracks[shape].last;
    if enters { a = volact_along(shape, ray, t0); }
    let b = volact_along(shape, ray, t1);
    volact_tracks[shape].last = b;
    if volact_is_nan(a) || volact_is_nan(b) { return; }
    volact_tracks[shape].rising = b > a;
    let count = volact_numbers[8u * shape + 5u].y;
    var n = 0u;
    if b > a {
        while n < count && volact_level(shape, n) <= a { n += 1u; }
    } else {
        n = count;
        while n > 0u && volact_level(shape, n - 1u) > a { n -= 1u; }
    }
    volact_tracks[shape].next = n;
    volact_cross(shape, ray);
}

fn volact_along(shape: u32, ray: VolactRay, t: f32) -> f32 {
    return volact_value_of(shape, volact_sample(shape, ray, t, volact_frame.step, 0.0));
}

// A value that is crossed, of those in rising order.
fn volact_level(shape: u32, n: u32) -> f32 {
    return volact_floats(volact_numbers[8u * shape + 5u].x + n).x;
}

// The level at hand, by its number from either side.
fn volact_current(shape: u32) -> f32 {
    let next = volact_tracks[shape].next;
    return volact_level(shape, select(max(next, 1u) - 1u, next, volact_tracks[shape].rising));
}

// Where the piece crosses its next value: the first of eight parts at whose ends the value lies on
// different sides, four times over, and a straight line in what is left.
fn volact_cross(shape: u32, ray: VolactRay) {
    volact_tracks[shape].crossing = volact_frame.infinity;
    let next = volact_tracks[shape].next;
    let rising = volact_tracks[shape].rising;
    let b = volact_tracks[shape].last;
    if rising && next >= volact_numbers[8u * shape + 5u].y { return; }
    if !rising && next == 0u { return; }
    let level = volact_current(shape);
    if (b >= level) != rising { return; }
    var t0 = volact_tracks[shape].start;
    var t1 = volact_tracks[shape].end;
    var v0 = level;
    var v1 = level;
    for (var round = 0u; round < 4u; round += 1u) {
        let width = (t1 - t0) / 8.0;
        let from_t = t0;
        var n = 1u;
        var v = v0;
        t0 = from_t;
        while n < 8u {
            v = volact_along(shape, ray, from_t + f32(n) * width);
            if !volact_is_nan(v) && (v >= level) == rising { break; }
            t0 = from_t + f32(n) * width;
            v0 = v;
            n += 1u;
        }
        if n < 8u {
            t1 = from_t + f32(n) * width;
            v1 = v;
        }
    }
    var part = 0.5;
    if v0 != v1 && !volact_is_nan(v0) && v0 != level { part = clamp((level - v0) / (v1 - v0), 0.0, 1.0); }
    volact_tracks[shape].crossing = t0 + part * (t1 - t0);
}

// The nearest place without length behind `last`.
fn volact_next_hit(ray: VolactRay, last: f32) -> f32 {
    var nearest = volact_frame.infinity;
    for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
        nearest = min(nearest, volact_tracks[shape].crossing);
        let planes = volact_numbers[8u * shape + 5u];
        for (var n = 0u; PLANES && n < planes.w; n += 1u) {
            let t = volact_slice(shape, ray, planes.z + n);
            if t > last { nearest = min(nearest, t); }
        }
    }
    return nearest;
}

// Where the ray meets a slice inside the shape; before everything where it does not.
fn volact_slice(shape: u32, ray: VolactRay, row: u32) -> f32 {
    let plane = volact_floats(row);
    let slope = dot(plane.xyz, ray.direction);
    if slope == 0.0 { return -3.0e38; }
    let t = (plane.w - dot(plane.xyz, volact_floats(8u * shape).xyz + ray.start)) / slope;
    if volact_holds(t) && volact_within(shape, ray, volact_tracks[shape].spans, t) { return t; }
    return -3.0e38;
}

// All that there is at one place without length.
fn volact_hits(ray: VolactRay, t: f32) {
    var sum = vec4<f32>(0.0);
    var left = 1.0;
    for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
        let planes = volact_numbers[8u * shape + 5u];
        for (var n = 0u; PLANES && n < planes.w; n += 1u) {
            if volact_slice(shape, ray, planes.z + n) == t {
                let color = volact_on_slice(shape, ray, t);
                sum += color;
                left *= 1.0 - color.a;
            }
        }
        while CROSSES && volact_tracks[shape].crossing == t {
            let m = volact_shade(shape, volact_sample(shape, ray, t, volact_frame.step, volact_current(shape)));
            let color = volact_premultiplied(m);
            sum += color;
            left *= 1.0 - color.a;
            if volact_tracks[shape].rising { volact_tracks[shape].next += 1u; } else { volact_tracks[shape].next -= 1u; }
            volact_cross(shape, ray);
            // What lies behind the next, by rounding, is at the same place.
            if volact_tracks[shape].crossing < t { volact_tracks[shape].crossing = t; }
        }
    }
    if sum.a > 0.0 { volact_meet(vec4<f32>(sum.rgb / sum.a * (1.0 - left), 1.0 - left), t); }
}

fn volact_on_slice(shape: u32, ray: VolactRay, t: f32) -> vec4<f32> {
    let m = volact_shade(shape, volact_sample(shape, ray, t, volact_frame.step, 0.0));
    volact_samples += 1u;
    let sum = m.color.r + m.color.g + m.color.b;
    let nothing = m.extinction == 0.0 && sum == 0.0;
    if nothing || volact_is_nan(m.extinction) || volact_is_nan(sum) { return vec4<f32>(0.0); }
    var a = 1.0;
    if (volact_numbers[8u * shape + 4u].w & VOLACT_OPAQUE) == 0u {
        a = volact_absorb(max(m.extinction, 0.0) * volact_floats(8u * shape).w).x;
    }
    return vec4<f32>(m.color * a, a);
}

// What the shapes that are there make together: equal parts of those that are infinitely dense.
fn volact_mixed(start: f32) -> Medium {
    var sum = vec4<f32>(0.0);
    var dense = vec4<f32>(0.0);
    for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
        let m = volact_tracks[shape].medium;
        if volact_tracks[shape].start <= start && m.extinction > 0.0 {
            if volact_is_infinite(m.extinction) {
                dense += vec4<f32>(m.color, 1.0);
            } else {
                sum += vec4<f32>(m.color * m.extinction, m.extinction);
            }
        }
    }
    if dense.a > 0.0 { return Medium(dense.rgb / dense.a, volact_frame.infinity); }
    if sum.a > 0.0 { return Medium(sum.rgb / sum.a, sum.a); }
    return Medium(vec3<f32>(0.0), 0.0);
}

fn volact_sweep(ray: VolactRay) {
    for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) { volact_track(shape, ray); }
    var t = -3.0e38;
    var hit = volact_next_hit(ray, t);
    loop {
        var begin = volact_frame.infinity;
        for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) { begin = min(begin, max(volact_tracks[shape].start, t)); }
        if hit <= begin {
            if volact_is_infinite(hit) || !(PLANES || CROSSES) { return; }
            volact_hits(ray, hit);
            t = hit;
            hit = volact_next_hit(ray, t);
            continue;
        }
        var end = hit;
        for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
            let start = volact_tracks[shape].start;
            end = min(end, select(volact_tracks[shape].end, start, start > begin));
        }
        let m = volact_mixed(begin);
        if m.extinction > 0.0 { volact_through(m, begin, end); }
        t = end;
        // What lies at the very end of a piece comes before the next, with which it would be forgotten.
        if (PLANES || CROSSES) && hit <= t {
            volact_hits(ray, t);
            hit = volact_next_hit(ray, t);
        }
        var surfaces = false;
        for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
            if volact_tracks[shape].end <= t {
                let first = volact_tracks[shape].first;
                let k = volact_tracks[shape].k;
                // Where a stretch ends inside of a segment others go on.
                if t >= volact_border(k) && volact_is_done(first, k) { return; }
                volact_forward(shape, ray);
                surfaces = surfaces || volact_kind(shape) == VOLACT_FIRST;
            }
        }
        if CROSSES && surfaces { hit = volact_next_hit(ray, t); }
    }
}
