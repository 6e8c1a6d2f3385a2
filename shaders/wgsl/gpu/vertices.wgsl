// Numbers of vertices at the sample at hand.
//
// Constant given before: ROW. There: the first row of each vertex' first four numbers among the rows of
// meshes, the first of those of single numbers, four a row, and whether it was given.

fn volact_number_of(base: u32, vertex: u32) -> f32 { return volact_mesh_row(base + vertex / 4u)[vertex % 4u]; }

// The number of the component that is read; 0 where it was left out.
fn volact_number() -> f32 {
    let place = volact_numbers[ROW];
    if place.z == 0u { return 0.0; }
    let v = volact_corners;
    return dot(volact_weights, vec4<f32>(volact_number_of(place.y, v.x), volact_number_of(place.y, v.y),
        volact_number_of(place.y, v.z), volact_number_of(place.y, v.w)));
}

fn volact_number_components() -> vec4<f32> {
    let place = volact_numbers[ROW];
    if place.z == 0u { return vec4<f32>(0.0); }
    let v = place.x + volact_corners;
    let w = volact_weights;
    return w.x * volact_mesh_row(v.x) + w.y * volact_mesh_row(v.y) + w.z * volact_mesh_row(v.z)
        + w.w * volact_mesh_row(v.w);
}
