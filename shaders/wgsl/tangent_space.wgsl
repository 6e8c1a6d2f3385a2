// tangent_space: a table, lit without gradients (OpenGL Volumizer's shader of that name).
//
// Lambert's diffuse light is max(n·l, 0) with n = −∇f/|∇f|: bright where the value falls towards
// the light. Instead of three differences for ∇f, one along the direction l to the light, which
// is in world space:
//
//     (f(x + εl) − f(x)) / ε  →  ∇f(x)·l  as ε → 0,
//
// the derivative along l, to first order in ε. It is not divided by |∇f|, so steep places are
// brighter than faint ones. f is the value with its range mapped to 0 to 1; ε is `offset` voxels
// (the smallest spacing in the world), and slopes are per voxel, so the scene's scale means nothing.
fn towards_light(p: vec3<f32>) -> f32 {
    let step = offset() * volume_spacing();
    let light = normalize(lightdir());
    return (volume_normalized(p + step * light) - volume_normalized(p)) / offset();
}

fn shade(s: Sample) -> Medium {
    let m = lookup_table(volume(s.position));
    let slope = -towards_light(s.position);
    return Medium(m.color * (ambient() + diffuse() * saturate(contrast() * slope)), m.extinction);
}
