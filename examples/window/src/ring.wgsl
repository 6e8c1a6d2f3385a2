// A flat ring around the scene: the application's own, opaque geometry.

struct Numbers {
    world_to_clip: mat4x4<f32>,
    // The middle in world space, and the number of pieces.
    center: vec4<f32>,
    // Inner and outer radius.
    radii: vec4<f32>,
}

@group(0) @binding(0) var<uniform> numbers: Numbers;

struct Corner {
    @builtin(position) place: vec4<f32>,
    @location(0) piece: f32,
}

// A strip of corners, inner and outer by turns.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
    let piece = f32(index / 2u);
    let angle = 6.2831853 * piece / numbers.center.w;
    let radius = select(numbers.radii.x, numbers.radii.y, index % 2u == 1u);
    let place = numbers.center.xyz + radius * vec3<f32>(cos(angle), sin(angle), 0.0);
    return Corner(numbers.world_to_clip * vec4<f32>(place, 1.0), piece);
}

@fragment
fn color(corner: Corner) -> @location(0) vec4<f32> {
    let dark = (u32(corner.piece) / 4u) % 2u == 0u;
    return vec4<f32>(select(vec3<f32>(0.75, 0.72, 0.65), vec3<f32>(0.20, 0.42, 0.55), dark), 1.0);
}
