// What can be skipped of a ray.

// For cells of 8³ samples how many around them, with themselves, are empty; 0 where they are not.
@group(0) @binding(7) var<storage, read> volact_empties: array<u32>;

// Up to where nothing can be seen of a shape from a place on a ray on; the place itself where that is
// not known.
fn volact_ahead(shape: u32, ray: VolactRay, t: f32) -> f32 {
    let grid = volact_numbers[8u * shape + 6u];
    if grid.y == 0u { return t; }
    let p = vec4<f32>(volact_floats(8u * shape).xyz + (ray.start + t * ray.direction), 1.0);
    let row = volact_numbers[8u * shape + 7u].x;
    let x = vec3<f32>(dot(volact_floats(row), p), dot(volact_floats(row + 1u), p), dot(volact_floats(row + 2u), p));
    let cell = clamp(vec3<i32>(floor(x / 8.0)), vec3<i32>(0), vec3<i32>(grid.yzw) - 1);
    let at = u32(cell.x) + grid.y * (u32(cell.y) + grid.z * u32(cell.z));
    let free = i32(volact_empties[grid.x + at]);
    if free == 0 { return t; }
    var left = 3.0e38;
    for (var a = 0u; a < 3u; a += 1u) {
        let slope = dot(volact_floats(row + a).xyz, ray.direction);
        let end = 8.0 * f32(select(cell[a] - free + 1, cell[a] + free, slope > 0.0));
        if slope != 0.0 { left = min(left, (end - x[a]) / slope); }
    }
    return t + max(left, 0.0);
}
