// What the shaders of a picture's shapes give: these bodies are replaced by calls of each shape's own
// functions, chosen by its number.

fn volact_shade(shape: u32, s: Sample) -> Medium { return Medium(vec3<f32>(0.0), 0.0); }
fn volact_value_of(shape: u32, s: Sample) -> f32 { return 0.0; }
