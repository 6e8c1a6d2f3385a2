// The lattice along rays: where segment k begins. All shapes composited in depth are swept together, all
// the way.

fn volact_border(k: i32) -> f32 { return fma(f32(k), volact_frame.step, f32(k) * volact_frame.step_rest); }

fn volact_first_segment(t: f32) -> i32 { return i32(floor(t / volact_frame.step)); }

// The shapes that are swept: the first, and the one after the last.
fn volact_swept() -> vec2<u32> { return vec2<u32>(0u, DEEP); }

// Whether a place without length belongs to the part of the ray that is swept.
fn volact_holds(t: f32) -> bool { return true; }
