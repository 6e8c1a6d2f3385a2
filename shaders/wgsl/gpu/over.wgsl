// One shape alone that emits and absorbs: its stretches segment by segment.

fn volact_over(shape: u32, ray: VolactRay) {
    var rest = volact_whole();
    loop {
        let spans = volact_spans(shape, ray, rest);
        rest = volact_rest;
        if volact_over_spans(shape, ray, spans) || !MESHES || !rest.more { return; }
    }
}

// Whether the ray ends there.
fn volact_over_spans(shape: u32, ray: VolactRay, spans: VolactSpans) -> bool {
    for (var i = 0u; i < spans.count; i += 1u) {
        let a = spans.ends[i].x;
        let b = spans.ends[i].y;
        var k = volact_first_segment(a);
        var border = volact_border(k);
        // Whether it is worth looking how far around everything is empty.
        var look = true;
        while border < b {
            let t0 = max(border, a);
            let from_k = k;
            k += 1;
            border = volact_border(k);
            let t1 = min(border, b);
            if t1 > t0 {
                let middle = 0.5 * (t0 + t1);
                var ahead = middle;
                if look { ahead = volact_ahead(shape, ray, middle); }
                if ahead > middle {
                    k = volact_beyond(k, ahead, b);
                    volact_skipped += u32(k - from_k);
                    border = volact_border(k);
                } else {
                    let m = volact_shade(shape, volact_sample(shape, ray, middle, t1 - t0, 0.0));
                    volact_samples += 1u;
                    look = !(m.extinction > 0.0);
                    if volact_seen(m) { volact_through(m, t0, t1); }
                }
            }
            if volact_is_done(from_k, k) { return true; }
        }
    }
    return false;
}
