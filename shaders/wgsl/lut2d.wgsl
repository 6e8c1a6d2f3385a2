// lut2d: a table of the value times one of the gradient's magnitude.
//
// Opacity is the product of both opacities, colour the product of both colours: a separable
// transfer function in two dimensions (J. Kniss, G. Kindlmann, C. Hansen, "Multidimensional
// transfer functions for interactive volume rendering", IEEE TVCG 8(3), 2002). The magnitude is in
// data units per world unit.
fn shade(s: Sample) -> Medium {
    let a = lookup_table_color(volume(s.position));
    let b = gradient_table_color(length(volume_gradient(s.position)));
    return medium(a.rgb * b.rgb, a.a * b.a);
}
