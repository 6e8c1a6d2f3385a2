// The ray through a pixel.

struct VolactRay {
    // Its place at t = 0, from the anchor.
    start: vec3<f32>,
    direction: vec3<f32>,
    begin: f32,
    end: f32,
}

// The ray through a pixel's centre. In perspective the anchor ray has the direction q of length 1, and
// that of another is (q + e)/|q + e|. Its difference to q, times the anchor's distance, is where the
// ray is at t = 0: computed as a difference it keeps its digits however far the eye is away.
fn volact_ray(pixel: vec2<u32>) -> VolactRay {
    let at = vec2<f32>(pixel) + 0.5 - volact_frame.anchor;
    let e = at.x * volact_frame.dx + at.y * volact_frame.dy;
    var ray = VolactRay(e, volact_frame.toward, 0.0, 0.0);
    if volact_frame.perspective != 0.0 {
        let more = 2.0 * dot(volact_frame.toward, e) + dot(e, e);
        let size = sqrt(1.0 + more);
        let change = e / size - volact_frame.toward * (more / (size * (1.0 + size)));
        ray.start = volact_frame.start * change;
        ray.direction = volact_frame.toward + change;
    }
    let slope = dot(volact_frame.axis, ray.direction);
    let place = dot(volact_frame.axis, ray.start);
    ray.begin = max((volact_frame.near - place) / slope, volact_frame.first);
    ray.end = (volact_frame.far - place) / slope;
    return ray;
}
