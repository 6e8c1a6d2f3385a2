// attribute: per-vertex numbers of a mesh through a table.
//
// Numbers are linear in each tetrahedron. Colour comes from the scalars; opacity from the first
// component of `opacity_scalars`, else from the scalars, by `opacity_table`, else by the same
// table. Emission and absorption over `unit_distance` in world units (N. Max, "Optical models for
// direct volume rendering", IEEE TVCG 1(2), 1995, section 4); cells as in P. Shirley, A. Tuchman,
// "A polygonal approximation to direct scalar volume rendering", Computer Graphics 24(5), 1990.
fn opacity_value(s: Sample) -> f32 {
    if opacity_scalars_given() { return opacity_scalars_components(s).x; } else { return scalars(s); }
}

fn shade(s: Sample) -> Medium {
    let color = lookup_table_color(scalars(s)).rgb;
    if opacity_table_given() {
        return medium(color, opacity_table_color(opacity_value(s)).a);
    } else {
        return medium(color, lookup_table_color(opacity_value(s)).a);
    }
}
