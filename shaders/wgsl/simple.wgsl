// simple: the volume's own components as colour and opacity.
//
// One component is grey and opacity alike, or opaque grey; two are grey and opacity; three a
// colour, opaque; four colour and opacity. The texture's range is mapped to 0 to 1. Emission and
// absorption (N. Max, "Optical models for direct volume rendering", IEEE TVCG 1(2), 1995, section
// 4): opacity is the fraction absorbed over `unit_distance` in world units.
fn shade(s: Sample) -> Medium {
    let c = volume_color(s.position);
    return medium(c.rgb, c.a);
}
