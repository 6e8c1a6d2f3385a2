// What the shaders of a picture's shapes give: these bodies are replaced by calls of each shape's own
// functions, chosen by its number. Drivers copy all that a hook calls to where it is called, so there are several:
// each knows only the shapes that come there.

// A medium, of shapes that absorb.
fn volact_shade(shape: u32, s: Sample) -> Medium { return Medium(vec3<f32>(0.0), 0.0); }

// What lies at a place without length: of shapes whose values are crossed, and where there are slice planes of those
// that absorb.
fn volact_shade_hit(shape: u32, s: Sample) -> Medium { return Medium(vec3<f32>(0.0), 0.0); }

// What a shape that is one picture makes of its value.
fn volact_shade_flat(shape: u32, s: Sample) -> Medium { return Medium(vec3<f32>(0.0), 0.0); }

// The value of shapes whose values are crossed, and of those that are one picture.
fn volact_value_hit(shape: u32, s: Sample) -> f32 { return 0.0; }
fn volact_value_flat(shape: u32, s: Sample) -> f32 { return 0.0; }
