// Opaque triangles: the first that a ray meets ends it. They are lit from both sides:
// rgb × (ambient + (1 - ambient)·|n·l|), with the normal of the triangle or, interpolated, of its vertices (B. T. Phong,
// "Illumination for computer generated pictures", 1975).
//
// A surface has eight rows as shapes have: 0 the anchor in local space, the ambient part; 1 to 3 local space
// to that of its mesh; 4 first row of its clip regions, how many; 5 colour, whether there is a light; 6 the
// direction to it; 7 nothing, the first row of its mesh, whether vertices have normals: those lie behind
// the vertices, as covectors of the mesh's space.

fn volact_box(line: VolactLine, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let a = (low - line.grow - line.origin) * line.inverse;
    let b = (high + line.grow - line.origin) * line.inverse;
    let begin = min(a, b);
    let end = max(a, b);
    return vec2<f32>(max(max(begin.x, begin.y), begin.z), min(min(end.x, end.y), end.z));
}

struct VolactFace { t: f32, face: u32 }

// Where a surface is first met, and by which face; at infinity where it is not.
fn volact_nearest_face(number: u32, line: VolactLine, kept: VolactSpans) -> VolactFace {
    let base = volact_numbers[8u * number + 7u].y;
    let head = volact_meshes[base];
    var nearest = volact_frame.infinity;
    var which = 0u;
    var node = 0u;
    while node < head.x {
        let low = volact_meshes[base + head.y + 2u * node];
        let high = volact_meshes[base + head.y + 2u * node + 1u];
        let through = volact_box(line, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz));
        if through.x > through.y || through.x > nearest {
            node = low.w;
            continue;
        }
        node += 1u;
        for (var n = 0u; n < (high.w & 7u); n += 1u) {
            let face = (high.w >> 3u) + n;
            let corners = base + head.w + volact_meshes[base + head.z + face].xyz;
            let met = volact_met(volact_corner_of(line, corners.x), volact_corner_of(line, corners.y),
                volact_corner_of(line, corners.z));
            // Of faces at one place the first counts, in whatever order the tree has them.
            let sooner = met.x < nearest || (met.x == nearest && face < which);
            if met.y != 0.0 && sooner && volact_held(kept, met.x) {
                nearest = met.x;
                which = face;
            }
        }
    }
    return VolactFace(nearest, which);
}

// The normal where a face is met, in the world and of any length.
fn volact_normal(number: u32, line: VolactLine, face: u32) -> vec3<f32> {
    let rows = volact_numbers[8u * number + 7u];
    let head = volact_meshes[rows.y];
    let corners = volact_meshes[rows.y + head.z + face].xyz;
    let first = rows.y + head.w;
    let a = volact_mesh_row(first + corners.x).xyz;
    let b = volact_mesh_row(first + corners.y).xyz;
    let c = volact_mesh_row(first + corners.z).xyz;
    var normal = cross(b - a, c - a);
    if rows.z != 0u {
        let p = volact_seen_at(line, a);
        let q = volact_seen_at(line, b);
        let r = volact_seen_at(line, c);
        let parts = vec3<f32>(q.x * r.y - r.x * q.y, r.x * p.y - p.x * r.y, p.x * q.y - q.x * p.y);
        let corner = corners + rows.y + volact_meshes[rows.y + 1u].w;
        let smooth_one = (parts.x * volact_mesh_row(corner.x).xyz + parts.y * volact_mesh_row(corner.y).xyz
            + parts.z * volact_mesh_row(corner.z).xyz) / (parts.x + parts.y + parts.z);
        if dot(smooth_one, smooth_one) > 0.0 { normal = smooth_one; }
    }
    let world = normal.x * volact_floats(8u * number + 1u).xyz + normal.y * volact_floats(8u * number + 2u).xyz
        + normal.z * volact_floats(8u * number + 3u).xyz;
    return world / max(max(abs(world.x), abs(world.y)), abs(world.z));
}

// The colour of what ends a ray first, and where; at infinity where nothing does.
fn volact_first_surface(ray: VolactRay) -> vec4<f32> {
    var found = vec4<f32>(0.0, 0.0, 0.0, volact_frame.infinity);
    for (var number = volact_frame.surfaces.x; number < volact_frame.surfaces.y; number += 1u) {
        var whole: VolactSpans;
        whole.count = 1u;
        whole.ends[0] = vec2<f32>(ray.begin, ray.end);
        let line = volact_line(number, ray, 0u);
        let met = volact_nearest_face(number, line, volact_clipped(number, ray, whole));
        if met.t >= found.w { continue; }
        let color = volact_floats(8u * number + 5u);
        var light = ray.direction;
        if color.w != 0.0 { light = volact_floats(8u * number + 6u).xyz; }
        let normal = volact_normal(number, line, met.face);
        let cosine = min(abs(dot(normal, light)) / (length(normal) * length(light)), 1.0);
        let ambient = volact_floats(8u * number).w;
        found = vec4<f32>(color.rgb * (ambient + (1.0 - ambient) * cosine), met.t);
    }
    return found;
}
