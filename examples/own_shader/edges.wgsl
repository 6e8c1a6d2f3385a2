// Edge enhancement (D. Ebert, P. Rheingans, "Volume illustration", IEEE Visualization 2000):
// extinction by how much the value changes, and colours that fade with the distance.
fn shade(s: Sample) -> Medium {
    let m = lookup_table(volume(s.position));
    if m.extinction == 0.0 { return m; }
    let edge = length(volume_gradient(s.position)) / change();
    let near = 1.0 - smoothstep(fade().x, fade().y, s.depth);
    return Medium(m.color * near, m.extinction * min(edge * edge, 4.0));
}
