// A lookup table, darker with the distance from the eye.
fn shade(s: Sample) -> Medium {
    let m = lookup_table(volume(s.position));
    return Medium(m.color * exp(-s.depth / reach()), m.extinction);
}
