// Where rays end at what an application has drawn, by its depth buffer: z and w of clip space are linear
// in t, so that z(t) = depth·w(t) is one equation.

struct VolactDepths {
    // Rows of the map to clip space that give z and w, from the anchor.
    z: vec4<f32>,
    w: vec4<f32>,
    // The viewport's first column and row.
    corner: vec2<u32>,
    rest: vec2<u32>,
}

@group(1) @binding(0) var<uniform> volact_depths: VolactDepths;
@group(1) @binding(1) var volact_buffer: texture_depth_2d;
@group(1) @binding(2) var<storage, read_write> volact_limits: array<vec4<f32>>;

@compute @workgroup_size(8, 8)
fn volact_find_limits(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= volact_frame.size) { return; }
    let ray = volact_ray(id.xy);
    let depth = textureLoad(volact_buffer, vec2<i32>(id.xy + volact_depths.corner), 0);
    let place = vec4<f32>(ray.start, 1.0);
    let slope = dot(volact_depths.z.xyz, ray.direction) - depth * dot(volact_depths.w.xyz, ray.direction);
    let t = (depth * dot(volact_depths.w, place) - dot(volact_depths.z, place)) / slope;
    let at = id.y * volact_frame.size.x + id.x;
    volact_limits[2u * at] = vec4<f32>(0.0);
    volact_limits[2u * at + 1u] = vec4<f32>(select(t, volact_frame.infinity, depth >= 1.0), 0.0, 0.0, 0.0);
}
