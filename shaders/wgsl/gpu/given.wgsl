// Whether a parameter was given, and the medium of a colour and an opacity.
//
// Constants given before: ROW, where it says whether; UNIT, the row of the unit distance; LENGTHS,
// whether opacity becomes extinction.

fn volact_given() -> bool { return volact_numbers[ROW].x != 0u; }

fn medium(color: vec3<f32>, opacity: f32) -> Medium {
    if !LENGTHS { return Medium(color, opacity); }
    if opacity == 0.0 { return Medium(color, 0.0); }
    return Medium(color, volact_depth_of(opacity) / volact_floats(UNIT).x);
}
