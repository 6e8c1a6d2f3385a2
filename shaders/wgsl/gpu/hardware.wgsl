// Trilinear interpolation by the device's sampler, with the weights that it has.

@group(1) @binding(0) var volact_sampler: sampler;

// The texture's numbers at sample coordinates, which are clamped to a region.
fn volact_linear(x: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> vec4<f32> {
    let at = clamp(x, low, high);
    return textureSampleLevel(volact_texture, volact_sampler, (at + 0.5) * volact_floats(ROW + 10u).yzw, 0.0);
}
