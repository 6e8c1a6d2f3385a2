// A band of a picture laid over what a target holds: a triangle that covers the viewport, of which no more
// than the band's rows are drawn.

@group(1) @binding(0) var<storage, read> volact_pixels: array<vec4<f32>>;
@group(1) @binding(1) var<uniform> volact_corner: vec4<u32>;

@vertex
fn volact_cover(@builtin(vertex_index) n: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(n & 1u) * 4.0 - 1.0, f32(n >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn volact_lay(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = min(vec2<u32>(place.xy) - volact_corner.xy, volact_frame.size - 1u);
    return volact_pixels[(pixel.y - volact_frame.first_row) * volact_frame.size.x + pixel.x];
}
