// Where rays are inside meshes: the crossings of the boundary's faces, each in or out, in order.
//
// Faces are found by a tree of boxes without a stack: nodes lie depth first, and each knows where to go on
// where it is missed. The space of a mesh is its box, from -1 to 1; there it is sheared so that the ray is
// the third axis, and a face is met where the signs of its three edges agree, which all faces at an edge
// see alike (S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", 2013). An edge through which the
// ray runs is passed as if the ray were moved by an infinitesimal (H. Edelsbrunner, E. P. Mücke,
// "Simulation of simplicity", 1990). The boundary is closed, so ways in and out add up to nothing; where
// rounding has it otherwise the ray is moved aside by as much.
//
// Rows of a mesh: a head of two, of the number of nodes, their first row, those of faces and of vertices, all
// counted from it, and of the number of nodes of cells, their first row and that of cells (see cells.wgsl);
// nodes of two rows, lowest corner and the node to go on with, highest corner and of leaves 8 times the
// first face and their number; faces of three vertices, turned outward; vertices.

// Crossings that are kept at a time, and stretches between them.
const VOLACT_CROSSINGS: u32 = 8u;
const VOLACT_STRETCHES: u32 = 4u;
const VOLACT_IN: u32 = 0x80000000u;

// A ray in the space of a mesh.
struct VolactLine {
    origin: vec3<f32>,
    inverse: vec3<f32>,
    // By how much boxes have to grow for rounding.
    grow: vec3<f32>,
    // From places beside the origin to those beside the ray and along it.
    beside: mat3x3<f32>,
    aside: vec2<f32>,
    // A length on the ray that is not told from rounding.
    gap: f32,
}

struct VolactCrossings {
    count: u32,
    more: bool,
    // Ways in less ways out on the whole line.
    sum: i32,
    t: array<f32, VOLACT_CROSSINGS>,
    face: array<u32, VOLACT_CROSSINGS>,
}

// The ray, moved aside by as much as rounding may: another way for each number but 0.
fn volact_line(shape: u32, ray: VolactRay, aside: u32) -> VolactLine {
    let p = vec4<f32>(volact_floats(8u * shape).xyz + ray.start, 1.0);
    var line: VolactLine;
    var way = vec3<f32>(0.0);
    for (var a = 0u; a < 3u; a += 1u) {
        let row = volact_floats(8u * shape + a + 1u);
        line.origin[a] = dot(row, p);
        way[a] = dot(row.xyz, ray.direction);
    }
    let tiny = vec3<f32>(1.0e-30);
    line.inverse = 1.0 / select(way, tiny, abs(way) < tiny);
    line.grow = 1.0e-6 * (1.0 + abs(line.origin));
    // The axis along which the ray mostly runs, and the two others turned so that faces toward its origin
    // turn to the left.
    let size = abs(way);
    var k = 2u;
    if size.x >= size.y && size.x >= size.z { k = 0u; } else if size.y >= size.z { k = 1u; }
    let swaps = way[k] > 0.0;
    let i = (k + select(1u, 2u, swaps)) % 3u;
    let j = (k + select(2u, 1u, swaps)) % 3u;
    var unit = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let along = unit[k] / way[k];
    line.beside = mat3x3<f32>(unit[i] - way[i] * along, unit[j] - way[j] * along, along);
    let most = 1.0 + max(max(abs(line.origin.x), abs(line.origin.y)), abs(line.origin.z));
    var ways = array<vec2<f32>, 4>(vec2<f32>(0.0), vec2<f32>(0.9, 0.6), vec2<f32>(-0.7, 1.1), vec2<f32>(0.4, -1.3));
    line.aside = 5.0e-7 * most * ways[aside % 4u];
    line.gap = 4.0e-7 * most / size[k];
    return line;
}

// A place as the ray sees it: beside it, and where the ray passes it.
fn volact_seen_at(line: VolactLine, place: vec3<f32>) -> vec3<f32> {
    let q = (place - line.origin) * line.beside;
    return vec3<f32>(q.xy + line.aside, q.z);
}

// On which side the ray passes the edge from a to b. Rounding keeps the order of products, and swapping the
// ends swaps them.
fn volact_left_of(a: vec3<f32>, b: vec3<f32>) -> bool {
    let m = a.x * b.y;
    let n = b.x * a.y;
    if m != n { return m > n; }
    if a.y != b.y { return b.y < a.y; }
    return b.x > a.x;
}

// Where the ray crosses a triangle, and 1 where it does so to the side to which it turns, -1 to the other,
// 0 where it does not.
fn volact_met(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec2<f32> {
    let side = volact_left_of(a, b);
    if volact_left_of(b, c) != side || volact_left_of(c, a) != side { return vec2<f32>(0.0); }
    let parts = max(select(-1.0f, 1.0f, side)
        * vec3<f32>(b.x * c.y - c.x * b.y, c.x * a.y - a.x * c.y, a.x * b.y - b.x * a.y), vec3<f32>(0.0));
    let sum = parts.x + parts.y + parts.z;
    var t = (a.z + b.z + c.z) / 3.0;
    if sum > 0.0 { t = dot(parts, vec3<f32>(a.z, b.z, c.z)) / sum; }
    return vec2<f32>(t, select(-1.0f, 1.0f, side));
}

fn volact_corner_of(line: VolactLine, row: u32) -> vec3<f32> { return volact_seen_at(line, volact_mesh_row(row).xyz); }

// Whether the line meets a box (T. Kay, J. Kajiya, "Ray tracing complex scenes", 1986).
fn volact_meets(line: VolactLine, low: vec3<f32>, high: vec3<f32>) -> bool {
    let a = (low - line.grow - line.origin) * line.inverse;
    let b = (high + line.grow - line.origin) * line.inverse;
    let begin = min(a, b);
    let end = max(a, b);
    return max(max(begin.x, begin.y), begin.z) <= min(min(end.x, end.y), end.z);
}

// The first crossings behind a place.
fn volact_crossings(base: u32, line: VolactLine, rest: VolactRest) -> VolactCrossings {
    var found: VolactCrossings;
    let head = volact_meshes[base];
    var node = 0u;
    while node < head.x {
        let low = volact_meshes[base + head.y + 2u * node];
        let high = volact_meshes[base + head.y + 2u * node + 1u];
        if !volact_meets(line, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz)) {
            node = low.w;
            continue;
        }
        node += 1u;
        for (var n = 0u; n < (high.w & 7u); n += 1u) {
            let face = (high.w >> 3u) + n;
            let corners = base + head.w + volact_meshes[base + head.z + face].xyz;
            let met = volact_met(volact_corner_of(line, corners.x), volact_corner_of(line, corners.y),
                volact_corner_of(line, corners.z));
            if met.y == 0.0 { continue; }
            found.sum += select(-1i, 1i, met.y > 0.0);
            if met.x > rest.t || (met.x == rest.t && face > (rest.face & 0x7fffffffu)) {
                volact_keep(&found, met.x, face | select(0u, VOLACT_IN, met.y > 0.0));
            }
        }
    }
    return found;
}

// Whether a crossing comes before another; those at one place go by their faces.
fn volact_sooner(t: f32, face: u32, other: f32, other_face: u32) -> bool {
    return t < other || (t == other && (face & 0x7fffffffu) < (other_face & 0x7fffffffu));
}

// Puts a crossing among those that are kept, in order; the last goes where there is no room.
fn volact_keep(found: ptr<function, VolactCrossings>, t: f32, face: u32) {
    var n = (*found).count;
    if n == VOLACT_CROSSINGS {
        (*found).more = true;
        n -= 1u;
        if !volact_sooner(t, face, (*found).t[n], (*found).face[n]) { return; }
    } else {
        (*found).count = n + 1u;
    }
    while n > 0u && volact_sooner(t, face, (*found).t[n - 1u], (*found).face[n - 1u]) {
        (*found).t[n] = (*found).t[n - 1u];
        (*found).face[n] = (*found).face[n - 1u];
        n -= 1u;
    }
    (*found).t[n] = t;
    (*found).face[n] = face;
}

// The first stretches inside a mesh behind a place at which the ray is outside. Those that rounding
// parts are one.
fn volact_mesh_stretches(shape: u32, ray: VolactRay, from_rest: VolactRest) -> VolactSpans {
    let base = volact_numbers[8u * shape + 7u].y;
    var rest = from_rest;
    var spans: VolactSpans;
    volact_rest.more = false;
    var depth = 0;
    var begin = 0.0;
    loop {
        let line = volact_line(shape, ray, rest.aside);
        let found = volact_crossings(base, line, rest);
        if found.sum != 0 && rest.aside < 3u && rest.t == -3.0e38 {
            rest.aside += 1u;
            continue;
        }
        for (var i = 0u; i < found.count; i += 1u) {
            let t = found.t[i];
            let before = depth;
            depth += select(-1i, 1i, (found.face[i] & VOLACT_IN) != 0u);
            if depth > 1 && i + 1u < found.count { volact_overlapping(shape, t, found.t[i + 1u], line.gap); }
            if before == 0 && depth == 1 {
                begin = t;
                if spans.count > 0u && t - spans.ends[spans.count - 1u].y <= line.gap {
                    spans.count -= 1u;
                    begin = spans.ends[spans.count].x;
                } else if spans.count == VOLACT_STRETCHES {
                    volact_rest.more = true;
                    return spans;
                }
            }
            if before == 1 && depth == 0 {
                spans.ends[spans.count] = vec2<f32>(begin, t);
                spans.count += 1u;
                volact_rest = VolactRest(false, t, found.face[i], rest.aside);
            }
        }
        if !found.more { return spans; }
        rest.t = found.t[VOLACT_CROSSINGS - 1u];
        rest.face = found.face[VOLACT_CROSSINGS - 1u];
    }
    return spans;
}

fn volact_is_mesh(shape: u32) -> bool { return (volact_numbers[8u * shape + 4u].w & VOLACT_MESH) != 0u; }

// What the clips leave of a ray inside a shape, in order: as much as there is room for behind a place;
// `volact_rest` says where to go on.
fn volact_spans(shape: u32, ray: VolactRay, rest: VolactRest) -> VolactSpans {
    var inside: VolactSpans;
    if volact_is_mesh(shape) {
        inside = volact_kept(volact_mesh_stretches(shape, ray, rest), vec2<f32>(ray.begin, ray.end));
    } else {
        inside = volact_block_span(shape, ray);
    }
    return volact_clipped(shape, ray, inside);
}

// Whether a place on a ray is inside a shape.
fn volact_within(shape: u32, ray: VolactRay, t: f32) -> bool {
    var rest = volact_whole();
    while rest.more {
        let spans = volact_spans(shape, ray, rest);
        rest = volact_rest;
        if volact_held(spans, t) { return true; }
    }
    return false;
}
