// No surface ends a ray.

fn volact_first_surface(ray: VolactRay) -> vec4<f32> { return vec4<f32>(0.0, 0.0, 0.0, volact_frame.infinity); }
