// Several shapes, surfaces of values and slices along a ray. Where shapes overlap extinctions add:
// segments are cut to the pieces that they share. Places without length come before the medium that
// begins there; several at one place have the opacity 1 - Π(1 - a) and the colour Σac/Σa.
//
// Drivers copy a function to every place from which it is called. So whatever is large (stretches, samples
// of media, of values) is called from one place of each loop, and what is still to be done is noted.

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
    // way the value runs, where the next crossing is, and what there is to do to know that.
    last: f32,
    next: u32,
    rising: bool,
    crossing: f32,
    sought: u32,
}

// Nothing; a search for the next value; before that the value at the piece's end; and before that the one at
// its start.
const VOLACT_KNOWN: u32 = 0u;
const VOLACT_SEARCH: u32 = 1u;
const VOLACT_END: u32 = 2u;
const VOLACT_START: u32 = 3u;

var<private> volact_tracks: array<VolactTrack, TRACKS>;
// Places without length at the place at hand: Σac and Σa, and Π(1 - a).
var<private> volact_found: vec4<f32>;
var<private> volact_beyond_found: f32;

fn volact_kind(shape: u32) -> u32 { return volact_numbers[8u * shape + 4u].z; }

// Before all stretches of a shape.
fn volact_track(shape: u32) {
    volact_tracks[shape].rest = volact_whole();
    if (volact_numbers[8u * shape + 4u].w & VOLACT_INSIDE) == 0u { volact_tracks[shape].rest.more = false; }
    volact_tracks[shape].spans.count = 0u;
    volact_tracks[shape].span = 0u;
    volact_tracks[shape].k = 0;
    volact_tracks[shape].first = 0;
    volact_tracks[shape].end = -3.0e38;
    volact_tracks[shape].last = 0.0;
}

// The stretches of a shape behind those that there were, as many as there is room for.
fn volact_fill(shape: u32, ray: VolactRay) {
    let spans = volact_spans(shape, ray, volact_tracks[shape].rest);
    volact_tracks[shape].spans = spans;
    volact_tracks[shape].rest = volact_rest;
    volact_tracks[shape].span = 0u;
    volact_tracks[shape].k = volact_first_segment(spans.ends[0].x);
}

// The next piece of a shape; at the end it begins at infinity.
fn volact_forward(shape: u32, ray: VolactRay) {
    volact_tracks[shape].crossing = volact_frame.infinity;
    volact_tracks[shape].sought = VOLACT_KNOWN;
    volact_tracks[shape].medium = Medium(vec3<f32>(0.0), 0.0);
    loop {
        let span = volact_tracks[shape].span;
        if span >= volact_tracks[shape].spans.count {
            if !volact_tracks[shape].rest.more { break; }
            volact_fill(shape, ray);
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
        if t1 <= t0 { continue; }
        volact_tracks[shape].start = t0;
        volact_tracks[shape].end = t1;
        let middle = 0.5 * (t0 + t1);
        let ahead = volact_ahead(shape, ray, middle);
        if ahead > middle {
            let next = volact_beyond(k + 1, ahead, ends.y);
            volact_skipped += u32(next - k);
            volact_tracks[shape].k = next;
            volact_tracks[shape].end = min(volact_border(next), ends.y);
            return;
        }
        volact_samples += 1u;
        if CROSSES && volact_kind(shape) == VOLACT_FIRST {
            volact_tracks[shape].sought = select(VOLACT_END, VOLACT_START, t0 == ends.x);
            return;
        }
        let m = volact_shade(shape, volact_sample(shape, ray, middle, t1 - t0, 0.0));
        if volact_seen(m) { volact_tracks[shape].medium = m; }
        return;
    }
    volact_tracks[shape].start = volact_frame.infinity;
    volact_tracks[shape].end = volact_frame.infinity;
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

// The number of the first value that is crossed on the way from a value, from either side.
fn volact_first_level(shape: u32, a: f32, rising: bool) -> u32 {
    let count = volact_numbers[8u * shape + 5u].y;
    var n = 0u;
    if rising {
        while n < count && volact_level(shape, n) <= a { n += 1u; }
    } else {
        n = count;
        while n > 0u && volact_level(shape, n - 1u) > a { n -= 1u; }
    }
    return n;
}

// Whether the piece crosses the next value, given that at its end.
fn volact_crosses(shape: u32) -> bool {
    let next = volact_tracks[shape].next;
    let rising = volact_tracks[shape].rising;
    if rising && next >= volact_numbers[8u * shape + 5u].y { return false; }
    if !rising && next == 0u { return false; }
    return (volact_tracks[shape].last >= volact_current(shape)) == rising;
}

// Where the piece crosses its next value: the first of eight parts at whose ends the value lies on
// different sides, four times over, and a straight line in what is left.
fn volact_cross(shape: u32, ray: VolactRay) -> f32 {
    var sought = volact_tracks[shape].sought;
    volact_tracks[shape].sought = VOLACT_KNOWN;
    var a = volact_tracks[shape].last;
    var t0 = volact_tracks[shape].start;
    var t1 = volact_tracks[shape].end;
    var from_t = t0;
    var v0 = 0.0;
    var v1 = 0.0;
    var level = 0.0;
    var parts = 0u;
    var round = 0u;
    while round < 4u {
        if sought == VOLACT_SEARCH && parts == 0u {
            if !volact_crosses(shape) { return volact_frame.infinity; }
            level = volact_current(shape);
            v0 = level;
            v1 = level;
            parts = 1u;
        }
        let width = (t1 - from_t) / 8.0;
        var at = from_t + f32(parts) * width;
        if sought == VOLACT_START { at = t0; }
        if sought == VOLACT_END { at = t1; }
        let v = volact_value_hit(shape, volact_sample(shape, ray, at, volact_frame.step, 0.0));
        if sought == VOLACT_START {
            a = v;
            sought = VOLACT_END;
        } else if sought == VOLACT_END {
            volact_tracks[shape].last = v;
            if volact_is_nan(a) || volact_is_nan(v) { return volact_frame.infinity; }
            volact_tracks[shape].rising = v > a;
            volact_tracks[shape].next = volact_first_level(shape, a, v > a);
            sought = VOLACT_SEARCH;
        } else {
            let passed = !volact_is_nan(v) && (v >= level) == volact_tracks[shape].rising;
            if passed {
                t1 = at;
                v1 = v;
            } else {
                t0 = at;
                v0 = v;
                parts += 1u;
            }
            if passed || parts == 8u {
                from_t = t0;
                parts = 1u;
                round += 1u;
            }
        }
    }
    var part = 0.5;
    if v0 != v1 && !volact_is_nan(v0) && v0 != level { part = clamp((level - v0) / (v1 - v0), 0.0, 1.0); }
    return t0 + part * (t1 - t0);
}

// The nearest place without length behind `last`, or of surfaces there.
fn volact_next_hit(ray: VolactRay, last: f32) -> f32 {
    var nearest = volact_frame.infinity;
    for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
        if CROSSES && volact_tracks[shape].sought != VOLACT_KNOWN {
            // What lies before, by rounding, is at the same place.
            volact_tracks[shape].crossing = max(volact_cross(shape, ray), last);
        }
        nearest = min(nearest, volact_tracks[shape].crossing);
        let planes = volact_numbers[8u * shape + 5u];
        for (var n = 0u; PLANES && n < planes.w; n += 1u) {
            let t = volact_slice(shape, ray, planes.z + n);
            if t > last { nearest = min(nearest, t); }
        }
    }
    return nearest;
}

// Where the ray meets a slice, inside the shape or not; before everything where it does not.
fn volact_slice(shape: u32, ray: VolactRay, row: u32) -> f32 {
    let plane = volact_floats(row);
    let slope = dot(plane.xyz, ray.direction);
    if slope == 0.0 { return -3.0e38; }
    let t = (plane.w - dot(plane.xyz, volact_floats(8u * shape).xyz + ray.start)) / slope;
    return select(-3.0e38, t, volact_holds(t));
}

// Adds what there is at one place without length: of each shape the next surface, and slices, unless those
// were added.
fn volact_find(ray: VolactRay, t: f32, added: bool) {
    for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
        let planes = volact_numbers[8u * shape + 5u];
        var n = select(0u, planes.w, !PLANES || added);
        loop {
            let slice = n < planes.w;
            var value = 0.0;
            if slice {
                n += 1u;
                if volact_slice(shape, ray, planes.z + n - 1u) != t || !volact_within(shape, ray, t) { continue; }
            } else {
                if !CROSSES || volact_tracks[shape].crossing > t { break; }
                value = volact_current(shape);
            }
            let m = volact_shade_hit(shape, volact_sample(shape, ray, t, volact_frame.step, value));
            var color = volact_premultiplied(m);
            if slice {
                color = volact_on_slice(shape, m);
                volact_samples += 1u;
            } else {
                if volact_tracks[shape].rising { volact_tracks[shape].next += 1u; } else { volact_tracks[shape].next -= 1u; }
                volact_tracks[shape].crossing = volact_frame.infinity;
                volact_tracks[shape].sought = VOLACT_SEARCH;
            }
            volact_found += color;
            volact_beyond_found *= 1.0 - color.a;
        }
    }
}

fn volact_on_slice(shape: u32, m: Medium) -> vec4<f32> {
    let sum = m.color.r + m.color.g + m.color.b;
    let nothing = m.extinction == 0.0 && sum == 0.0;
    if nothing || volact_is_nan(m.extinction) || volact_is_nan(sum) { return vec4<f32>(0.0); }
    var a = 1.0;
    if (volact_numbers[8u * shape + 4u].w & VOLACT_OPAQUE) == 0u {
        a = volact_absorb(max(m.extinction, 0.0) * volact_floats(8u * shape).w).x;
    }
    return vec4<f32>(m.color * a, a);
}

// Meets all that was found at a place.
fn volact_meet_found(t: f32) {
    let opacity = 1.0 - volact_beyond_found;
    if volact_found.a > 0.0 { volact_meet(vec4<f32>(volact_found.rgb / volact_found.a * opacity, opacity), t); }
    volact_found = vec4<f32>(0.0);
    volact_beyond_found = 1.0;
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

// Goes along a ray from place to place where something changes. At each come first the places without length,
// at the ends of pieces and where the next begin, then these.
fn volact_sweep(ray: VolactRay) {
    for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) { volact_track(shape); }
    volact_found = vec4<f32>(0.0);
    volact_beyond_found = 1.0;
    var t = -3.0e38;
    var hit = volact_frame.infinity;
    var stale = PLANES || CROSSES;
    var added = true;
    loop {
        if (PLANES || CROSSES) && stale {
            hit = volact_next_hit(ray, t);
            stale = false;
        }
        if (PLANES || CROSSES) && hit <= t {
            volact_find(ray, t, added);
            added = true;
            stale = true;
            continue;
        }
        if PLANES || CROSSES { volact_meet_found(t); }
        for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
            if volact_tracks[shape].end <= t {
                let first = volact_tracks[shape].first;
                let k = volact_tracks[shape].k;
                // Where a stretch ends inside of a segment others go on.
                if t >= volact_border(k) && volact_is_done(first, k) { return; }
                volact_forward(shape, ray);
                stale = stale || volact_tracks[shape].sought != VOLACT_KNOWN;
            }
        }
        if CROSSES && stale { continue; }
        var begin = volact_frame.infinity;
        for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) { begin = min(begin, max(volact_tracks[shape].start, t)); }
        if hit <= begin {
            if volact_is_infinite(hit) { return; }
            t = hit;
        } else {
            var end = hit;
            for (var shape = volact_swept().x; shape < volact_swept().y; shape += 1u) {
                let start = volact_tracks[shape].start;
                end = min(end, select(volact_tracks[shape].end, start, start > begin));
            }
            let m = volact_mixed(begin);
            if m.extinction > 0.0 { volact_through(m, begin, end); }
            t = end;
        }
        added = false;
    }
}
