// A picture by casting rays: one invocation a pixel. A dispatch makes a band of rows, from first_row on, and
// its pixels and depths begin with those.

// What the application has drawn: for each pixel premultiplied colour, then where it is.
@group(0) @binding(3) var<storage, read> volact_limits: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> volact_pixels: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> volact_depths: array<f32>;

@compute @workgroup_size(8, 8)
fn volact_picture(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = vec2<u32>(id.x, id.y + volact_frame.first_row);
    if pixel.x >= volact_frame.size.x || pixel.y >= volact_frame.size.y { return; }
    let at = pixel.y * volact_frame.size.x + pixel.x;
    volact_dark();
    var ray = volact_ray(pixel);
    var limit = volact_frame.infinity;
    if volact_frame.limited != 0u {
        limit = volact_limits[2u * at + 1u].x;
        ray.end = min(ray.end, limit);
    }
    let surface = volact_first_surface(ray);
    ray.end = min(ray.end, surface.w);
    if ALONE {
        volact_over(0u, ray);
    } else {
        volact_sweep(ray);
    }
    if !volact_is_infinite(surface.w) {
        volact_samples += 1u;
        volact_meet(vec4<f32>(surface.rgb, 1.0), surface.w);
    }
    if volact_frame.limited != 0u { volact_meet(volact_limits[2u * at], limit); }
    for (var shape = DEEP; shape < SHAPES; shape += 1u) {
        let color = volact_flat(shape, ray);
        volact_color = color + (1.0 - color.a) * volact_color;
    }
    let to = id.y * volact_frame.size.x + id.x;
    volact_pixels[to] = volact_color;
    volact_depths[to] = volact_depth;
    if volact_samples + volact_skipped > 0u {
        let counter = 1u + ((id.x >> 3u) + 7u * (id.y >> 3u)) % 64u;
        atomicAdd(&volact_flags[counter], volact_samples);
        atomicAdd(&volact_flags[counter + 64u], 1u);
        atomicAdd(&volact_flags[counter + 129u], volact_skipped);
    }
    volact_probe();
}
