// A parameter of plain numbers, in rows of its own.
//
// Constants given before: ROW, the first of its rows. After its value comes a row that says whether
// it was given.

fn volact_f32() -> f32 { return volact_floats(ROW).x; }
fn volact_i32() -> i32 { return bitcast<i32>(volact_numbers[ROW].x); }
fn volact_u32() -> u32 { return volact_numbers[ROW].x; }
fn volact_bool() -> bool { return volact_numbers[ROW].x != 0u; }
fn volact_vec2() -> vec2<f32> { return volact_floats(ROW).xy; }
fn volact_vec3() -> vec3<f32> { return volact_floats(ROW).xyz; }
fn volact_vec4() -> vec4<f32> { return volact_floats(ROW); }
fn volact_local() -> vec3<f32> { return volact_floats(ROW + 1u).xyz; }
fn volact_matrix() -> mat4x4<f32> {
    return mat4x4<f32>(volact_floats(ROW), volact_floats(ROW + 1u), volact_floats(ROW + 2u), volact_floats(ROW + 3u));
}
