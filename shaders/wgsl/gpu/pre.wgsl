// Colour and opacity computed at the voxels, and then interpolated: in place of `shade` of the shader `lut`, for a
// table that applies before interpolation.
//
// Constants given before: those of volume.wgsl, and UNIT, the row of the unit distance. The first function
// is replaced by the table's.

fn volact_classified(v: f32) -> vec4<f32> { return vec4<f32>(v); }

// What is no number stays none.
fn volact_voxel(i: vec3<i32>) -> vec4<f32> {
    let v = volact_picked(textureLoad(volact_texture, i, 0));
    if volact_is_nan(v) { return vec4<f32>(v); }
    return volact_classified(v);
}

// As in exact.wgsl, with a voxel's colour in place of its numbers.
fn volact_colors(x: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> vec4<f32> {
    let at = clamp(x, low, high);
    let base = clamp(floor(at), low, max(high - 1.0, low));
    let t = at - base;
    let top = vec3<i32>(high);
    let i = clamp(vec3<i32>(base), vec3<i32>(low), top);
    let j = min(i + 1, top);
    let a = volact_between(volact_voxel(i), volact_voxel(vec3<i32>(j.x, i.yz)), t.x);
    let b = volact_between(volact_voxel(vec3<i32>(i.x, j.y, i.z)), volact_voxel(vec3<i32>(j.xy, i.z)), t.x);
    let c = volact_between(volact_voxel(vec3<i32>(i.xy, j.z)), volact_voxel(vec3<i32>(j.x, i.y, j.z)), t.x);
    let d = volact_between(volact_voxel(vec3<i32>(i.x, j.yz)), volact_voxel(j), t.x);
    return volact_between(volact_between(a, b, t.y), volact_between(c, d, t.y), t.z);
}

fn volact_pre(s: Sample) -> Medium {
    let x = volact_mapped(0u, s.position);
    let low = volact_floats(ROW + 3u).xyz;
    let high = volact_floats(ROW + 4u).xyz;
    var c = vec4<f32>(0.0);
    if NEAREST {
        c = volact_classified(volact_picked(volact_closest(x, low, high)));
    } else {
        c = volact_colors(x, low, high);
    }
    if c.a == 0.0 { return Medium(c.rgb, 0.0); }
    return Medium(c.rgb, volact_depth_of(c.a) / volact_floats(UNIT).x);
}
