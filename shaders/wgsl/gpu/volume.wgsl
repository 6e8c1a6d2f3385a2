// A volume parameter: its functions over a texture that holds the whole data.
//
// Constants given before: ROW, the first row of its numbers; TEXTURE, its binding; CHANNELS, the
// texture's; NEAREST, whether values between samples are those of the nearest. `volact_linear`, which
// interpolates, is in exact.wgsl or hardware.wgsl.
//
// Rows: 0 to 2 local space to sample coordinates; 3 first sample of the region, component; 4 last
// sample, spacing; 5 last sample of the data, number of components; 6 scale and offset to data
// units, lowest of the range and one over its width; 7 to 9 local space to texture coordinates;
// 10 what the components mean, and one over the numbers of samples.

@group(1) @binding(TEXTURE) var volact_texture: texture_3d<f32>;

fn volact_mapped(first: u32, p: vec3<f32>) -> vec3<f32> {
    let q = vec4<f32>(p, 1.0);
    let x = dot(volact_floats(ROW + first), q);
    let y = dot(volact_floats(ROW + first + 1u), q);
    return vec3<f32>(x, y, dot(volact_floats(ROW + first + 2u), q));
}

fn volact_closest(x: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> vec4<f32> {
    let i = vec3<i32>(clamp(floor(clamp(x, low, high) + 0.5), low, high));
    return textureLoad(volact_texture, clamp(i, vec3<i32>(low), vec3<i32>(high)), 0);
}

fn volact_texel(p: vec3<f32>) -> vec4<f32> {
    let x = volact_mapped(0u, p);
    let low = volact_floats(ROW + 3u).xyz;
    let high = volact_floats(ROW + 4u).xyz;
    if NEAREST { return volact_closest(x, low, high); }
    return volact_linear(x, low, high);
}

fn volact_picked(v: vec4<f32>) -> f32 {
    let units = volact_floats(ROW + 6u);
    if CHANNELS == 1u { return fma(v.x, units.x, units.y); }
    return fma(v[min(volact_numbers[ROW + 3u].w, 3u)], units.x, units.y);
}

fn volact_value(p: vec3<f32>) -> f32 { return volact_picked(volact_texel(p)); }

fn volact_components(p: vec3<f32>) -> vec4<f32> {
    let units = volact_floats(ROW + 6u);
    let there = vec4<u32>(0u, 1u, 2u, 3u) < vec4<u32>(volact_numbers[ROW + 5u].w);
    return select(vec4<f32>(0.0), fma(volact_texel(p), vec4<f32>(units.x), vec4<f32>(units.y)), there);
}

fn volact_normalized(p: vec3<f32>) -> f32 {
    let units = volact_floats(ROW + 6u);
    return (volact_value(p) - units.z) * units.w;
}

fn volact_color(p: vec3<f32>) -> vec4<f32> {
    let units = volact_floats(ROW + 6u);
    let v = clamp((volact_components(p) - units.z) * units.w, vec4<f32>(0.0), vec4<f32>(1.0));
    switch volact_numbers[ROW + 10u].x {
        case 0u: { return v.xxxx; }
        case 1u: { return vec4<f32>(v.xxx, 1.0); }
        case 2u: { return vec4<f32>(v.xxx, v.y); }
        case 3u: { return vec4<f32>(v.xyz, 1.0); }
        default: { return v; }
    }
}

// Central differences over one voxel either way, neighbours clamped to the data's edge.
fn volact_gradient(p: vec3<f32>) -> vec3<f32> {
    let at = volact_mapped(0u, p);
    let low = vec3<f32>(0.0);
    let high = volact_floats(ROW + 5u).xyz;
    let step = vec2<f32>(1.0, 0.0);
    let x = volact_picked(volact_linear(at + step.xyy, low, high)) - volact_picked(volact_linear(at - step.xyy, low, high));
    let y = volact_picked(volact_linear(at + step.yxy, low, high)) - volact_picked(volact_linear(at - step.yxy, low, high));
    let z = volact_picked(volact_linear(at + step.yyx, low, high)) - volact_picked(volact_linear(at - step.yyx, low, high));
    // To world units by the transpose of the map to samples.
    return 0.5 * (x * volact_floats(ROW).xyz + y * volact_floats(ROW + 1u).xyz + z * volact_floats(ROW + 2u).xyz);
}

fn volact_nearest(p: vec3<f32>) -> f32 {
    let x = volact_mapped(0u, p);
    return volact_picked(volact_closest(x, volact_floats(ROW + 3u).xyz, volact_floats(ROW + 4u).xyz));
}

fn volact_coordinates(p: vec3<f32>) -> vec3<f32> { return volact_mapped(7u, p); }

fn volact_inside(p: vec3<f32>) -> bool {
    let t = volact_mapped(7u, p);
    return all(t >= vec3<f32>(0.0)) && all(t <= vec3<f32>(1.0));
}

fn volact_spacing() -> f32 { return volact_floats(ROW + 4u).w; }
