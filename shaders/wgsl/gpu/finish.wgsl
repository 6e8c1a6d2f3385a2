// Pixels, depths and counts of the light that slabs have gathered, for a band of rows: see slices.wgsl.

@group(0) @binding(3) var<storage, read> volact_limits: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> volact_pixels: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> volact_depths: array<f32>;
@group(1) @binding(0) var<storage, read> volact_light: array<vec4<f32>>;

@compute @workgroup_size(8, 8)
fn volact_finish(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = id.y + volact_frame.first_row;
    if id.x >= volact_frame.size.x || row >= volact_frame.size.y { return; }
    let at = id.y * volact_frame.size.x + id.x;
    let behind = 2u * (row * volact_frame.size.x + id.x);
    volact_dark();
    let known = volact_light[2u * at + 1u];
    if known.z != 0.0 {
        volact_color = volact_light[2u * at];
        volact_left = known.x;
        volact_depth = known.y;
    }
    // Where pictures of their own were laid over, what is behind is there already.
    if known.z != 3.0 && volact_frame.limited != 0u {
        volact_meet(volact_limits[behind], volact_limits[behind + 1u].x);
    }
    volact_pixels[at] = volact_color;
    volact_depths[at] = volact_depth;
    if known.z != 0.0 {
        let counter = 1u + ((id.x >> 3u) + 7u * (id.y >> 3u)) % 64u;
        atomicAdd(&volact_flags[counter], u32(known.w));
        atomicAdd(&volact_flags[counter + 64u], 1u);
    }
}
