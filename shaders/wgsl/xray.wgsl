// xray: the line integral of the value divided by unit_distance, classified: as a film shows it.
//
// What the ray's compositing takes is the interpolated value in data units; the table then gives
// colour and opacity once a ray, and no length counts in the opacity.
fn value(s: Sample) -> f32 { return volume(s.position); }

fn shade(s: Sample) -> Medium { return lookup_table(s.value); }
