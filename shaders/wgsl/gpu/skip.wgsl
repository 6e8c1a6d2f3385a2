// Where nothing can be seen: bounds of the values in cells of 8³ samples, whether the table is
// transparent between them, and how many cells around are empty, too.
//
// Bounds include the samples that bound a cell and one more on either side, so that interpolation and
// the rounding of places stay inside of them. They are widened by rounding itself. Distances are in
// the maximum norm, which goes axis by axis: min over k of max(|k|, distance along the other axes).

struct VolactCells {
    // Cells along each axis, and the first row of the volume's numbers.
    cells: vec3<u32>,
    row: u32,
    // Where the shape's cells begin, and the row of its table's number.
    base: u32,
    table: u32,
    // The way along which distances are taken.
    axis: u32,
    rest: u32,
}

@group(1) @binding(0) var<uniform> volact_cells: VolactCells;
@group(1) @binding(1) var volact_samples: texture_3d<f32>;
@group(1) @binding(2) var<storage, read_write> volact_bounds: array<vec2<f32>>;
@group(1) @binding(3) var<storage, read_write> volact_before: array<u32>;
@group(1) @binding(4) var<storage, read_write> volact_empty: array<u32>;

// The farthest that is looked.
const VOLACT_REACH: i32 = 8;

fn volact_place(id: vec3<u32>) -> u32 {
    return (id.z * volact_cells.cells.y + id.y) * volact_cells.cells.x + id.x;
}

// Lowest and highest of the texture's numbers; where one is not a number, everything.
@compute @workgroup_size(4, 4, 4)
fn volact_find_bounds(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id >= volact_cells.cells) { return; }
    let size = vec3<i32>(textureDimensions(volact_samples));
    let first = max(vec3<i32>(id) * 8 - 1, vec3<i32>(0));
    let last = min(vec3<i32>(id) * 8 + 9, size - 1);
    let component = volact_numbers[volact_cells.row + 3u].w;
    var low = 3.0e38;
    var high = -3.0e38;
    for (var z = first.z; z <= last.z; z += 1) {
        for (var y = first.y; y <= last.y; y += 1) {
            for (var x = first.x; x <= last.x; x += 1) {
                let v = textureLoad(volact_samples, vec3<i32>(x, y, z), 0)[component];
                if volact_is_nan(v) || volact_is_infinite(v) {
                    volact_bounds[volact_place(id)] = vec2<f32>(-3.0e38, 3.0e38);
                    return;
                }
                low = min(low, v);
                high = max(high, v);
            }
        }
    }
    volact_bounds[volact_place(id)] = vec2<f32>(low, high);
}

// The highest opacity between two values.
fn volact_highest(low: f32, high: f32) -> f32 {
    let base = volact_numbers[volact_cells.table].x;
    let count = volact_tables[base].w;
    let points = base + 2u + (volact_tables[base + 1u].x + 3u) / 4u;
    var most = 0.0;
    for (var i = 0u; i < count; i += 1u) {
        let value = bitcast<f32>(volact_tables[points + 2u * i].x);
        let opacity = bitcast<f32>(volact_tables[points + 2u * i + 1u].w);
        // A point counts where it lies between the values or is the next beyond one of them.
        var before = -3.0e38;
        var after = 3.0e38;
        if i > 0u { before = bitcast<f32>(volact_tables[points + 2u * (i - 1u)].x); }
        if i + 1u < count { after = bitcast<f32>(volact_tables[points + 2u * (i + 1u)].x); }
        let matters = (value >= low && before <= high) || (value <= high && after >= low);
        if matters && opacity > most { most = opacity; }
    }
    return most;
}

// 0 where something may be seen, else as far as is looked.
@compute @workgroup_size(4, 4, 4)
fn volact_find_empty(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id >= volact_cells.cells) { return; }
    let units = volact_floats(volact_cells.row + 6u);
    let ends = fma(volact_bounds[volact_place(id)], vec2<f32>(units.x), vec2<f32>(units.y));
    let slack = 1.0e-5 * max(abs(ends.x), abs(ends.y));
    let low = min(ends.x, ends.y) - slack;
    let high = max(ends.x, ends.y) + slack;
    let empty = high < 1.0e38 && volact_highest(low, high) == 0.0;
    volact_empty[volact_cells.base + volact_place(id)] = select(0u, u32(VOLACT_REACH), empty);
}

// One of three passes, along an axis each.
@compute @workgroup_size(4, 4, 4)
fn volact_spread(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id >= volact_cells.cells) { return; }
    var nearest = u32(VOLACT_REACH);
    let axis = volact_cells.axis;
    for (var k = -VOLACT_REACH; k <= VOLACT_REACH; k += 1) {
        var at = vec3<i32>(id);
        at[axis] += k;
        if at[axis] >= 0 && at[axis] < i32(volact_cells.cells[axis]) {
            nearest = min(nearest, max(u32(abs(k)), volact_before[volact_place(vec3<u32>(at))]));
        }
    }
    volact_empty[volact_cells.base + volact_place(id)] = nearest;
}
