// Trilinear interpolation in f32, with exact weights.

// Constants keep their value to the bit, and a sample without weight does not count.
fn volact_between(a: vec4<f32>, b: vec4<f32>, t: f32) -> vec4<f32> {
    let mixed = a + t * (b - a);
    return select(select(mixed, b, t == 1.0), a, t == 0.0);
}

// The texture's numbers at sample coordinates, which are clamped to a region.
fn volact_linear(x: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> vec4<f32> {
    let at = clamp(x, low, high);
    let base = clamp(floor(at), low, max(high - 1.0, low));
    let t = at - base;
    let top = vec3<i32>(high);
    let i = clamp(vec3<i32>(base), vec3<i32>(low), top);
    let j = min(i + 1, top);
    let a = volact_between(textureLoad(volact_texture, i, 0), textureLoad(volact_texture, vec3<i32>(j.x, i.yz), 0), t.x);
    let b = volact_between(textureLoad(volact_texture, vec3<i32>(i.x, j.y, i.z), 0),
        textureLoad(volact_texture, vec3<i32>(j.xy, i.z), 0), t.x);
    let c = volact_between(textureLoad(volact_texture, vec3<i32>(i.xy, j.z), 0),
        textureLoad(volact_texture, vec3<i32>(j.x, i.y, j.z), 0), t.x);
    let d = volact_between(textureLoad(volact_texture, vec3<i32>(i.x, j.yz), 0), textureLoad(volact_texture, j, 0), t.x);
    return volact_between(volact_between(a, b, t.y), volact_between(c, d, t.y), t.z);
}
