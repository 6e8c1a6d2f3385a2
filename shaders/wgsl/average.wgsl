// average: the mean value along the ray by length, classified.
//
// What the ray's compositing takes is the interpolated value in data units; the table then gives
// colour and opacity once a ray, and no length counts in the opacity. The mean is the
// line integral (A. Kak, M. Slaney, "Principles of computerized tomographic imaging", IEEE Press,
// 1988, chapter 3) over the length of the ray inside.
fn value(s: Sample) -> f32 { return volume(s.position); }

fn shade(s: Sample) -> Medium { return lookup_table(s.value); }
