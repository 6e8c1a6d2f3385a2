// glow: the highest value of the data as it is.
fn value(s: Sample) -> f32 { return volume(s.position); }
fn shade(s: Sample) -> Medium { return Medium(vec3f(s.value), 1.0); }
