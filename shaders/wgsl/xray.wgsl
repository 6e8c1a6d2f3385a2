// xray: the line integral of the value divided by unit_distance, classified: as a film shows it.
//
// What the ray's compositing takes is the interpolated value in data units; the table then gives
// colour and opacity once a ray, and no length counts in the opacity. Line integrals are
// the projections of A. Kak, M. Slaney, "Principles of computerized tomographic imaging", IEEE Press,
// 1988, chapter 3: by Lambert and Beer, what a film sees is their exponential.
fn value(s: Sample) -> f32 { return volume(s.position); }

fn shade(s: Sample) -> Medium { return lookup_table(s.value); }
