// What cells carry: numbers of their vertices, linear in each.
//
// The cell that holds a place is found from the last one: as long as it lies behind a face one goes on to
// the cell there. Where that leads out of the mesh, or nowhere, the tree of all cells tells; of those that
// are there the one in which the place lies deepest.
//
// Rows of a cell: three of what vertices 1 to 3 count for, as a slope and in the fourth numbers the place of
// vertex 0; the vertices; the cells behind the faces opposite to them.

const VOLACT_NOWHERE: u32 = 0xffffffffu;
const VOLACT_STEPS: u32 = 24u;
// Deeper outside of a cell than that is not rounding.
const VOLACT_OUTSIDE: f32 = -1.0e-6;

// For each shape one more than the cell that was found last; 0 where none was.
var<private> volact_hints: array<u32, SHAPES>;

fn volact_cell_rows(base: u32, cell: u32) -> u32 { return base + volact_meshes[base + 1u].z + 5u * cell; }

// What the vertices of a cell count for at a place.
fn volact_weights_at(row: u32, p: vec3<f32>) -> vec4<f32> {
    let a = volact_mesh_row(row);
    let b = volact_mesh_row(row + 1u);
    let c = volact_mesh_row(row + 2u);
    let q = p - vec3<f32>(a.w, b.w, c.w);
    let rest = vec3<f32>(dot(a.xyz, q), dot(b.xyz, q), dot(c.xyz, q));
    return vec4<f32>(1.0 - (rest.x + rest.y + rest.z), rest);
}

fn volact_least(w: vec4<f32>) -> f32 { return min(min(w.x, w.y), min(w.z, w.w)); }

// The cell that holds a place, found from another.
fn volact_walked(base: u32, p: vec3<f32>, hint: u32) -> u32 {
    var cell = hint;
    for (var n = 0u; n < VOLACT_STEPS; n += 1u) {
        let row = volact_cell_rows(base, cell);
        let w = volact_weights_at(row, p);
        let least = volact_least(w);
        if least >= VOLACT_OUTSIDE { return cell; }
        let behind = volact_meshes[row + 4u];
        if w.x == least { cell = behind.x; } else if w.y == least { cell = behind.y; }
        else if w.z == least { cell = behind.z; } else { cell = behind.w; }
        if cell == VOLACT_NOWHERE { return cell; }
    }
    return VOLACT_NOWHERE;
}

// The cell in which a place lies deepest, or that it is least outside of.
fn volact_deepest(base: u32, p: vec3<f32>) -> u32 {
    let head = volact_meshes[base + 1u];
    let grow = vec3<f32>(4.0e-6);
    var best = -3.0e38;
    var cell = VOLACT_NOWHERE;
    var node = 0u;
    while node < head.x {
        let low = volact_meshes[base + head.y + 2u * node];
        let high = volact_meshes[base + head.y + 2u * node + 1u];
        let under = p < bitcast<vec3<f32>>(low.xyz) - grow;
        let above = p > bitcast<vec3<f32>>(high.xyz) + grow;
        if any(under) || any(above) {
            node = low.w;
            continue;
        }
        node += 1u;
        for (var n = 0u; n < (high.w & 7u); n += 1u) {
            let one = (high.w >> 3u) + n;
            let least = volact_least(volact_weights_at(volact_cell_rows(base, one), p));
            if least > best {
                best = least;
                cell = one;
            }
        }
    }
    return cell;
}

// Finds what counts at a place of local space.
fn volact_carry(shape: u32, p: vec3<f32>) {
    if (volact_numbers[8u * shape + 4u].w & VOLACT_CARRIES) == 0u { return; }
    let q = vec4<f32>(p, 1.0);
    let place = vec3<f32>(dot(volact_floats(8u * shape + 1u), q), dot(volact_floats(8u * shape + 2u), q),
        dot(volact_floats(8u * shape + 3u), q));
    let base = volact_numbers[8u * shape + 7u].y;
    let hint = volact_hints[shape];
    var cell = VOLACT_NOWHERE;
    if hint > 0u { cell = volact_walked(base, place, hint - 1u); }
    if cell == VOLACT_NOWHERE { cell = volact_deepest(base, place); }
    // By rounding there may be none: then it is beside the last one.
    if cell == VOLACT_NOWHERE { cell = max(hint, 1u) - 1u; }
    volact_hints[shape] = cell + 1u;
    let row = volact_cell_rows(base, cell);
    volact_corners = volact_meshes[row + 3u];
    volact_weights = volact_weights_at(row, place);
}

// Cells that overlap would count each, and here only one does: which is the picture's error, where they overlap
// by more than parts that merely touch may, by rounding.
fn volact_overlapping(shape: u32, begin: f32, end: f32, gap: f32) {
    if (volact_numbers[8u * shape + 4u].w & VOLACT_CARRIES) != 0u && end - begin > 1024.0 * gap {
        atomicMax(&volact_flags[194], shape + 1u);
    }
}
