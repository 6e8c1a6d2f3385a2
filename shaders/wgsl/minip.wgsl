// minip: the lowest value along the ray, classified.
//
// What the ray's compositing takes is the interpolated value in data units; the table then gives
// colour and opacity once a ray, and no length counts in the opacity. The lowest in
// place of the highest value of J. Wallis, T. Miller, C. Lerner, E. Kleerup, "Three-dimensional display
// in nuclear medicine", IEEE Transactions on Medical Imaging 8(4), 1989.
fn value(s: Sample) -> f32 { return volume(s.position); }

fn shade(s: Sample) -> Medium { return lookup_table(s.value); }
