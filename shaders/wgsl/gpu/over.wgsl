// One shape alone that emits and absorbs: its stretches segment by segment.

fn volact_over(shape: u32, ray: VolactRay) {
    let spans = volact_spans(shape, ray);
    for (var i = 0u; i < spans.count; i += 1u) {
        let a = spans.ends[i].x;
        let b = spans.ends[i].y;
        var k = volact_first_segment(a);
        var border = volact_border(k);
        while border < b {
            let t0 = max(border, a);
            k += 1;
            border = volact_border(k);
            let t1 = min(border, b);
            if t1 > t0 {
                let m = volact_shade(shape, volact_sample(shape, ray, 0.5 * (t0 + t1), t1 - t0, 0.0));
                volact_samples += 1u;
                if volact_seen(m) { volact_through(m, t0, t1); }
            }
            if volact_is_done(k) { return; }
        }
    }
}
