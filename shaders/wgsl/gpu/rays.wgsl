// Where rays are inside shapes.
//
// Constants given before: SHAPES, how many; DEEP, how many of them are composited in depth: the first,
// and TRACKS, that or 1;
// SPANS, the stretches of a ray that there is room for; MESHES, whether a shape may be one; ALONE, whether
// there is just one shape, which absorbs; PLANES and CROSSES, whether a shape may have slice planes, or crossings of
// values: what there is not need not be compiled.
//
// Rows of shape i, from 8i: 0 the anchor in local space, unit distance; 1 to 3 local space to
// the block as a unit cube, or to the box around a mesh as one from -1 to 1; 4 first row of its clip regions,
// how many, how it is composited, its
// flags; 5 first row of the values it crosses, how many, first row of its planes, how many; 6 where its
// cells begin, and how many there are along each axis; 7 first row of the volume that the cells are of, and
// of its mesh.
// A region: how many planes, and whether its inside is kept; then its planes, normal and offset.

const VOLACT_FIRST: u32 = 1u;
const VOLACT_MAXIMUM: u32 = 2u;
const VOLACT_MINIMUM: u32 = 3u;
const VOLACT_AVERAGE: u32 = 4u;
const VOLACT_ADD: u32 = 5u;
// Flags: the shape's inside is drawn; its planes are opaque; it is a mesh; its cells carry something.
const VOLACT_INSIDE: u32 = 1u;
const VOLACT_OPAQUE: u32 = 2u;
const VOLACT_MESH: u32 = 4u;
const VOLACT_CARRIES: u32 = 8u;

struct VolactSpans {
    count: u32,
    ends: array<vec2<f32>, SPANS>,
}

// Where to go on when there are more stretches than there was room for: behind which place, and which face
// of a mesh there; and how far the ray is moved aside.
struct VolactRest {
    more: bool,
    t: f32,
    face: u32,
    aside: u32,
}

var<private> volact_rest: VolactRest;

fn volact_whole() -> VolactRest { return VolactRest(true, -3.0e38, 0u, 0u); }

// The stretch inside the shape's block: no length where there is none.
fn volact_block(shape: u32, ray: VolactRay) -> vec2<f32> {
    let p = vec4<f32>(volact_floats(8u * shape).xyz + ray.start, 1.0);
    var span = vec2<f32>(ray.begin, ray.end);
    for (var a = 1u; a <= 3u; a += 1u) {
        let row = volact_floats(8u * shape + a);
        let place = dot(row, p);
        let slope = dot(row.xyz, ray.direction);
        if slope == 0.0 {
            if place < 0.0 || place > 1.0 { return vec2<f32>(0.0); }
        } else {
            let low = -place / slope;
            let high = (1.0 - place) / slope;
            span = vec2<f32>(max(span.x, min(low, high)), min(span.y, max(low, high)));
        }
    }
    return span;
}

// The stretch inside a region of planes.
fn volact_region(shape: u32, ray: VolactRay, row: u32) -> vec2<f32> {
    let p = volact_floats(8u * shape).xyz + ray.start;
    var span = vec2<f32>(-3.0e38, 3.0e38);
    let planes = volact_numbers[row].x;
    for (var n = 1u; n <= planes; n += 1u) {
        let plane = volact_floats(row + n);
        let slope = dot(plane.xyz, ray.direction);
        let distance = dot(plane.xyz, p) - plane.w;
        if slope == 0.0 {
            if distance < 0.0 { return vec2<f32>(0.0); }
        } else if slope > 0.0 {
            span.x = max(span.x, -distance / slope);
        } else {
            span.y = min(span.y, -distance / slope);
        }
    }
    return span;
}

// What clips leave of stretches.
fn volact_clipped(shape: u32, ray: VolactRay, whole: VolactSpans) -> VolactSpans {
    var spans = whole;
    var row = volact_numbers[8u * shape + 4u].x;
    let regions = volact_numbers[8u * shape + 4u].y;
    for (var n = 0u; n < regions; n += 1u) {
        let inside = volact_region(shape, ray, row);
        let keeps = volact_numbers[row].y != 0u;
        row += 1u + volact_numbers[row].x;
        if keeps {
            spans = volact_kept(spans, inside);
        } else if inside.x < inside.y {
            spans = volact_cut(spans, inside);
        }
    }
    return spans;
}

// The stretch inside a block, of which there is no more.
fn volact_block_span(shape: u32, ray: VolactRay) -> VolactSpans {
    var spans: VolactSpans;
    volact_rest.more = false;
    spans.ends[0] = volact_block(shape, ray);
    spans.count = select(0u, 1u, spans.ends[0].x < spans.ends[0].y);
    return spans;
}

// Whether a place is in a stretch, ends included.
fn volact_held(spans: VolactSpans, t: f32) -> bool {
    for (var i = 0u; i < spans.count; i += 1u) {
        if t >= spans.ends[i].x && t <= spans.ends[i].y { return true; }
    }
    return false;
}

fn volact_kept(old: VolactSpans, inside: vec2<f32>) -> VolactSpans {
    var made: VolactSpans;
    for (var i = 0u; i < old.count; i += 1u) {
        let left = vec2<f32>(max(old.ends[i].x, inside.x), min(old.ends[i].y, inside.y));
        if left.x < left.y {
            made.ends[made.count] = left;
            made.count += 1u;
        }
    }
    return made;
}

fn volact_cut(old: VolactSpans, inside: vec2<f32>) -> VolactSpans {
    var made: VolactSpans;
    for (var i = 0u; i < old.count; i += 1u) {
        let before = vec2<f32>(old.ends[i].x, min(old.ends[i].y, inside.x));
        let after = vec2<f32>(max(old.ends[i].x, inside.y), old.ends[i].y);
        if before.x < before.y {
            made.ends[made.count] = before;
            made.count += 1u;
        }
        if after.x < after.y && made.count < SPANS {
            made.ends[made.count] = after;
            made.count += 1u;
        }
    }
    return made;
}

fn volact_sample(shape: u32, ray: VolactRay, t: f32, step: f32, value: f32) -> Sample {
    let p = volact_floats(8u * shape).xyz + (ray.start + t * ray.direction);
    volact_carry(shape, p);
    return Sample(p, ray.direction, step, -ray.direction, t + volact_frame.depth_shift, value);
}

// The segment to go on with where nothing is seen up to some place: not the last of a stretch, which is
// a piece of its own.
fn volact_beyond(k: i32, ahead: f32, end: f32) -> i32 {
    return max(k, volact_first_segment(min(ahead, end)));
}
