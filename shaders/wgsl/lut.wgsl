// lut: classify after interpolation.
//
// The interpolated value in data units through the table; emission and absorption as in
// N. Max, "Optical models for direct volume rendering", IEEE TVCG 1(2), 1995, section 4.
fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position)); }
