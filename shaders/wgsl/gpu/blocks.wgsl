// Shapes that are all blocks.

// What the clips leave of a ray inside a shape, in order, all at once.
fn volact_spans(shape: u32, ray: VolactRay, rest: VolactRest) -> VolactSpans {
    return volact_clipped(shape, ray, volact_block_span(shape, ray));
}

// Whether a place on a ray is inside a shape.
fn volact_within(shape: u32, ray: VolactRay, t: f32) -> bool {
    return volact_held(volact_spans(shape, ray, volact_whole()), t);
}

fn volact_carry(shape: u32, p: vec3<f32>) {}
