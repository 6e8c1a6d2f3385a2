// Shapes that are all blocks.

// What the clips leave of a ray inside a shape, in order, all at once.
fn volact_spans(shape: u32, ray: VolactRay, rest: VolactRest) -> VolactSpans { return volact_block_spans(shape, ray); }

// Whether a place on a ray is inside a shape, whose stretches are all known.
fn volact_within(shape: u32, ray: VolactRay, known: VolactSpans, t: f32) -> bool { return volact_held(known, t); }

fn volact_carry(shape: u32, p: vec3<f32>) {}
