// A volume that was left out: nothing is anywhere.

fn volact_value(p: vec3<f32>) -> f32 { return volact_frame.infinity - volact_frame.infinity; }
fn volact_components(p: vec3<f32>) -> vec4<f32> { return vec4<f32>(0.0); }
fn volact_normalized(p: vec3<f32>) -> f32 { return volact_value(p); }
fn volact_color(p: vec3<f32>) -> vec4<f32> { return vec4<f32>(0.0); }
fn volact_gradient(p: vec3<f32>) -> vec3<f32> { return vec3<f32>(0.0); }
fn volact_nearest(p: vec3<f32>) -> f32 { return volact_value(p); }
fn volact_coordinates(p: vec3<f32>) -> vec3<f32> { return vec3<f32>(0.0); }
fn volact_inside(p: vec3<f32>) -> bool { return false; }
fn volact_spacing() -> f32 { return 0.0; }
