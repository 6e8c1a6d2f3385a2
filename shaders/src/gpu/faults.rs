//! Faults made on purpose in the texts of stages, to see that the suite sees them: see
//! [`volact_core::mutation`]. Only built with the feature `mutations`.

use volact_core::mutation;

/// A fault's name, what is written, and what is made of it. A fault may change several places.
const FAULTS: &[(&str, &str, &str)] = &[
    ("opacity_exponent", "volact_depth_of(c.a) / volact_floats(UNIT).x", "volact_depth_of(c.a)"),
    (
        "linear_opacity",
        "    if depth < 0.25 {\n",
        "    if depth >= 0.0 { return vec2<f32>(min(depth, 1.0), max(1.0 - depth, 0.0)); }\n    if depth < 0.25 {\n",
    ),
    ("straight_colour", "(volact_left * part.x) * vec4<f32>(m.color, 1.0)", "vec4<f32>(m.color, volact_left * part.x)"),
    ("half_voxel", "let x = volact_mapped(0u, p);\n    let low", "let x = volact_mapped(0u, p) + 0.5;\n    let low"),
    ("swapped_axes", "let x = volact_mapped(0u, p);\n    let low", "let x = volact_mapped(0u, p).yxz;\n    let low"),
    ("nan_is_a_number", "return (bitcast<u32>(v) & 0x7fffffffu) > 0x7f800000u;", "return false;"),
    ("pixel_corners", "vec2<f32>(pixel) + 0.5 - ", "vec2<f32>(pixel) - "),
    ("anchor_off", "ray.start = volact_frame.start * change;", "ray.start = vec3<f32>(0.0);"),
    ("stepped_table", "return a + ((v - place.x) * place.y) * (b - a);", "return a;"),
    ("eight_bit_target", "= volact_color;\n", "= floor(255.0 * volact_color + 0.5) / 255.0;\n"),
    ("upside_down_colours", "= volact_color;\n", "= volact_color.bgra;\n"),
    ("maximum_from_zero", "select(max(value, v), v, length == 0.0)", "max(value, v)"),
    ("sum_without_unit", "value = value / volact_floats(8u * shape).w;", "value = value * 1.0;"),
    ("average_without_length", "value = value / all.length;", "value = value * 1.0;"),
    ("first_in_last_out", "].y <= line.gap {", "].y <= 3.0e38 {"),
    ("early_termination", "volact_left < volact_frame.termination;", "volact_left < 0.2;"),
    ("uncut_ends", "            let t0 = max(border, a);\n", "            let t0 = border;\n"),
    ("forgotten_clip", "let regions = volact_numbers[8u * shape + 4u].y;", "let regions = 0u;"),
    (
        "second_clip_region",
        "let regions = volact_numbers[8u * shape + 4u].y;",
        "let regions = min(volact_numbers[8u * shape + 4u].y, 1u);",
    ),
    ("thin_slices", ".w & VOLACT_OPAQUE) == 0u {", ".w & VOLACT_OPAQUE) < 9u {"),
    ("overlap_unweighted", "vec4<f32>(m.color * m.extinction, m.extinction)", "vec4<f32>(m.color, m.extinction)"),
    ("forgotten_opaque_depth", "        ray.end = min(ray.end, limit);\n", ""),
    ("forgotten_backdrop", "if volact_frame.limited != 0u { volact_meet(volact_limits[2u * at], limit); }", ""),
    ("forgotten_backdrop", "volact_meet(volact_limits[behind], limit);", ""),
    (
        "forgotten_backdrop",
        "volact_meet(volact_limits[behind], volact_limits[behind + 1u].x);",
        "volact_left = volact_left;",
    ),
    (
        "depth_threshold",
        "let wanted = 1.0 - volact_frame.threshold;",
        "let wanted = 0.9 * (1.0 - volact_frame.threshold);",
    ),
    ("depth_from_the_origin", "-ray.direction, t + volact_frame.depth_shift, value)", "-ray.direction, t, value)"),
    ("gradient_in_voxels", "x * volact_floats(ROW).xyz + y", "x * vec3<f32>(1.0, 0.0, 0.0) + y"),
    ("unrefined_crossings", "round < 4u", "round < 1u"),
    ("uncounted_samples", "volact_samples += 1u;\n", "\n"),
    (
        "unordered",
        "volact_depths[to] = volact_depth;",
        "volact_depths[to] = volact_depth;\n    volact_pixels[to].x += 1e-3 * f32(atomicAdd(&volact_flags[128], 1u) % 7u);",
    ),
    ("missing_cosine", "return (level - volact_levels.y) / volact_levels.x;", "return level - volact_levels.y;"),
];

/// A text with the fault that is made, if one is.
pub fn made(text: String) -> String {
    let active = FAULTS.iter().filter(|(name, ..)| mutation::is(mutation::key(name)));
    active.fold(text, |text, (_, from, to)| text.replace(from, to))
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::FAULTS;

    #[test]
    fn every_fault_changes_a_text_that_ships() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("wgsl/gpu");
        let files = fs::read_dir(folder).unwrap().map(|e| fs::read_to_string(e.unwrap().path()).unwrap());
        let texts: Vec<_> = files.collect();
        let lost: Vec<_> =
            FAULTS.iter().filter(|(_, from, _)| !texts.iter().any(|t| t.contains(from))).map(|f| f.0).collect();
        assert!(lost.is_empty(), "{lost:?}");
    }
}
