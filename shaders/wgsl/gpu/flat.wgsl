// A shape that is one picture: the highest, the lowest, the mean or the sum of its values along a
// ray, and then its colour, once.

fn volact_flat(shape: u32, ray: VolactRay) -> vec4<f32> {
    let spans = volact_spans(shape, ray);
    if spans.count == 0u { return vec4<f32>(0.0); }
    let kind = volact_numbers[8u * shape + 4u].z;
    var value = 0.0;
    var length = 0.0;
    var inside = 0.0;
    for (var i = 0u; i < spans.count; i += 1u) {
        let a = spans.ends[i].x;
        let b = spans.ends[i].y;
        inside += b - a;
        var k = volact_first_segment(a);
        var border = volact_border(k);
        while border < b {
            let t0 = max(border, a);
            k += 1;
            border = volact_border(k);
            let t1 = min(border, b);
            if t1 > t0 {
                let v = volact_value_of(shape, volact_sample(shape, ray, 0.5 * (t0 + t1), t1 - t0, 0.0));
                volact_samples += 1u;
                if !volact_is_nan(v) {
                    value = volact_reduced(kind, value, length, v, t1 - t0);
                    length += t1 - t0;
                }
            }
        }
    }
    if length == 0.0 { return vec4<f32>(0.0); }
    if kind == VOLACT_AVERAGE { value = value / length; }
    if kind == VOLACT_ADD { value = value / volact_floats(8u * shape).w; }
    return volact_premultiplied(volact_shade(shape, volact_sample(shape, ray, spans.ends[0].x, inside, value)));
}

fn volact_reduced(kind: u32, value: f32, length: f32, v: f32, more: f32) -> f32 {
    switch kind {
        case VOLACT_MAXIMUM: { return select(max(value, v), v, length == 0.0); }
        case VOLACT_MINIMUM: { return select(min(value, v), v, length == 0.0); }
        default: { return fma(v, more, value); }
    }
}
