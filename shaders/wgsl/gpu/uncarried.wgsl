// Meshes whose cells carry nothing.

fn volact_carry(shape: u32, p: vec3<f32>) {}

fn volact_overlapping(shape: u32, begin: f32, end: f32, gap: f32) {}
