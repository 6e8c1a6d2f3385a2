// A lookup table: control points at any places, linear between them to rounding.
//
// Constants given before: ROW, the row of its numbers; UNIT, the row of the unit distance; LENGTHS,
// whether opacity becomes extinction.
//
// Its number is where it begins among the rows of tables. There: one row with the lowest value, the
// highest, the buckets in one unit of value and, as a whole number, how many points there are; one
// with how many buckets; the buckets, four a row, each the last point at or below its values; and
// for each point its value with one over the distance to the next, then colour and opacity.

fn volact_cell(row: u32) -> vec4<f32> { return bitcast<vec4<f32>>(volact_tables[row]); }

// The last point at or below a value that lies inside the table.
fn volact_point(v: f32, head: vec4<f32>, base: u32, points: u32, count: u32) -> u32 {
    let buckets = volact_tables[base + 1u].x;
    let bucket = min(u32(max((v - head.x) * head.z, 0.0)), buckets - 1u);
    var i = min(volact_tables[base + 2u + bucket / 4u][bucket % 4u], count - 1u);
    while i + 1u < count && volact_cell(points + 2u * (i + 1u)).x <= v { i += 1u; }
    return i;
}

fn volact_table_color(v: f32) -> vec4<f32> {
    if volact_is_nan(v) { return vec4<f32>(0.0); }
    let base = volact_numbers[ROW].x;
    let head = volact_cell(base);
    let count = volact_tables[base].w;
    let points = base + 2u + (volact_tables[base + 1u].x + 3u) / 4u;
    if v >= head.y { return volact_cell(points + 2u * count - 1u); }
    if v < head.x { return volact_cell(points + 1u); }
    let i = volact_point(v, head, base, points, count);
    let place = volact_cell(points + 2u * i);
    let a = volact_cell(points + 2u * i + 1u);
    let b = volact_cell(points + 2u * i + 3u);
    return a + ((v - place.x) * place.y) * (b - a);
}

// How far a value may be from that of an entry and still mean it.
const VOLACT_REACH: f32 = 1.0 / 1024.0;

// The entry at a value, not interpolated; transparent black where there is none.
fn volact_entry(v: f32) -> vec4<f32> {
    if volact_is_nan(v) { return vec4<f32>(0.0); }
    let base = volact_numbers[ROW].x;
    let head = volact_cell(base);
    let count = volact_tables[base].w;
    let points = base + 2u + (volact_tables[base + 1u].x + 3u) / 4u;
    let reached = v + VOLACT_REACH;
    if reached < head.x { return vec4<f32>(0.0); }
    var i = count - 1u;
    if reached < head.y { i = volact_point(reached, head, base, points, count); }
    if v - volact_cell(points + 2u * i).x > VOLACT_REACH { return vec4<f32>(0.0); }
    return volact_cell(points + 2u * i + 1u);
}

fn volact_medium(v: f32) -> Medium {
    let c = volact_table_color(v);
    if !LENGTHS { return Medium(c.rgb, c.a); }
    if c.a == 0.0 { return Medium(c.rgb, 0.0); }
    return Medium(c.rgb, volact_depth_of(c.a) / volact_floats(UNIT).x);
}

// Parts that a segment is cut into between two of the table's points.
const VOLACT_PARTS: u32 = 16u;

// The uniform medium with the transmittance of the segment and its emitted colour: C = ∫ T σ c ds by
// the midpoint rule on parts between the table's points.
fn volact_segment(front: f32, back: f32, length: f32) -> Medium {
    if front == back || volact_is_nan(front) || volact_is_nan(back) { return volact_medium(front); }
    let base = volact_numbers[ROW].x;
    let count = volact_tables[base].w;
    let points = base + 2u + (volact_tables[base + 1u].x + 3u) / 4u;
    let rising = back > front;
    var depth = 0.0;
    var color = vec3<f32>(0.0);
    var from_value = front;
    for (var n = 0u; n <= count; n += 1u) {
        var to_value = back;
        if n < count { to_value = volact_cell(points + 2u * select(count - 1u - n, n, rising)).x; }
        let ahead = (to_value - from_value) * (back - front) > 0.0;
        let before = (back - to_value) * (back - front) >= 0.0;
        if ahead && before {
            let ds = length * (to_value - from_value) / (back - front) / f32(VOLACT_PARTS);
            for (var k = 0u; k < VOLACT_PARTS; k += 1u) {
                let m = volact_medium(mix(from_value, to_value, (f32(k) + 0.5) / f32(VOLACT_PARTS)));
                let part = volact_absorb(m.extinction * ds);
                color += exp(-depth) * part.x * m.color;
                depth += m.extinction * ds;
            }
            from_value = to_value;
        }
    }
    let opacity = volact_absorb(depth).x;
    if opacity == 0.0 { return volact_medium(front); }
    return Medium(color / opacity, depth / length);
}
