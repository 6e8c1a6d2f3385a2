// Nothing is known of what can be skipped of a ray.

fn volact_ahead(shape: u32, ray: VolactRay, t: f32) -> f32 { return t; }
