// A shape that is one picture: the highest, the lowest, the mean or the sum of its values along a
// ray, and then its colour, once.

fn volact_flat(shape: u32, ray: VolactRay) -> vec4<f32> {
    let kind = volact_numbers[8u * shape + 4u].z;
    var all = VolactReduced(0.0, 0.0, 0.0, volact_frame.infinity);
    var rest = volact_whole();
    loop {
        let spans = volact_spans(shape, ray, rest);
        rest = volact_rest;
        all = volact_reduced_spans(shape, ray, spans, all);
        if !MESHES || !rest.more { break; }
    }
    if all.length == 0.0 { return vec4<f32>(0.0); }
    var value = all.value;
    if kind == VOLACT_AVERAGE { value = value / all.length; }
    if kind == VOLACT_ADD { value = value / volact_floats(8u * shape).w; }
    return volact_premultiplied(volact_shade_flat(shape, volact_sample(shape, ray, all.begin, all.inside, value)));
}

// The value of what was seen, the length of that, the length inside, and where that begins.
struct VolactReduced { value: f32, length: f32, inside: f32, begin: f32 }

fn volact_reduced_spans(shape: u32, ray: VolactRay, spans: VolactSpans, before: VolactReduced) -> VolactReduced {
    let kind = volact_numbers[8u * shape + 4u].z;
    var all = before;
    for (var i = 0u; i < spans.count; i += 1u) {
        let a = spans.ends[i].x;
        let b = spans.ends[i].y;
        all.begin = min(all.begin, a);
        all.inside += b - a;
        var k = volact_first_segment(a);
        var border = volact_border(k);
        while border < b {
            let t0 = max(border, a);
            k += 1;
            border = volact_border(k);
            let t1 = min(border, b);
            if t1 > t0 {
                let v = volact_value_flat(shape, volact_sample(shape, ray, 0.5 * (t0 + t1), t1 - t0, 0.0));
                volact_samples += 1u;
                if !volact_is_nan(v) {
                    all.value = volact_reduced(kind, all.value, all.length, v, t1 - t0);
                    all.length += t1 - t0;
                }
            }
        }
    }
    return all;
}

fn volact_reduced(kind: u32, value: f32, length: f32, v: f32, more: f32) -> f32 {
    switch kind {
        case VOLACT_MAXIMUM: { return select(max(value, v), v, length == 0.0); }
        case VOLACT_MINIMUM: { return select(min(value, v), v, length == 0.0); }
        default: { return fma(v, more, value); }
    }
}
