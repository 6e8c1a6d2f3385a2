// isosurface: surfaces of given values, lit.
//
// Each control point of `surfaces` is a surface: where the value along the ray crosses its value,
// there is its colour with its opacity, of no thickness. The framework finds the crossings and
// merges them in depth; `s.value` is then the surface's value (crossings along rays: S. Parker et
// al., "Interactive ray tracing for isosurface rendering", IEEE Visualization 1998). Light as in
// `gradient`:
//
//     colour = min(1, c·(ambient + diffuse·n·l) + specular·m^shininess)
//
// with n along the gradient in world units, light in world space, and m after J. Blinn, "Models of
// light reflection for computer synthesized pictures", SIGGRAPH 1977, or B. T. Phong, CACM 18(6), 1975.
fn value(s: Sample) -> f32 { return volume(s.position); }

// The direction to the light, of length 1, along the axes of the world.
fn to_light(s: Sample) -> vec3<f32> {
    switch light() {
        case light_directional: { return normalize(lightdir()); }
        case light_positional: { return normalize(light_position_local() - s.position); }
        default: { return s.view; }
    }
}

// Colour of a lit point. The normal is the gradient turned to the eye; where there is none, only
// the ambient light is left.
fn lit(color: vec3<f32>, s: Sample) -> vec3<f32> {
    let gradient = volume_gradient(s.position);
    let size = length(gradient);
    if !(size > 0.0) { return color * ambient(); }
    let normal = faceForward(gradient / size, s.direction, gradient);
    let l = to_light(s);
    let cosine = dot(normal, l);
    if cosine <= 0.0 { return color * ambient(); }
    var mirrored = 0.0;
    if model() == model_phong {
        mirrored = max(dot(reflect(-l, normal), s.view), 0.0);
    } else {
        mirrored = max(dot(normal, normalize(l + s.view)), 0.0);
    }
    return min(color * (ambient() + diffuse() * cosine) + specular() * pow(mirrored, shininess()), vec3<f32>(1.0));
}

fn shade(s: Sample) -> Medium {
    let m = surfaces(s.value);
    return Medium(lit(m.color, s), m.extinction);
}
