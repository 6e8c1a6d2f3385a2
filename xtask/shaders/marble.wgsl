// Value noise (K. Perlin, "An image synthesizer", SIGGRAPH 1985, with values instead of gradients).
fn hash(c: vec3<i32>) -> f32 {
    let h = u32(c.x) * 374761393u + u32(c.y) * 668265263u + u32(c.z) * 2147483647u;
    let k = (h ^ (h >> 13u)) * 1274126177u;
    return f32(k ^ (k >> 16u)) / 4294967296.0;
}

fn noise(p: vec3<f32>) -> f32 {
    let c = vec3<i32>(floor(p));
    let t = smoothstep(vec3(0.0), vec3(1.0), fract(p));
    var sum = 0.0;
    for (var i = 0; i < 8; i++) {
        let corner = vec3(i & 1, (i >> 1) & 1, i >> 2);
        let w = select(vec3(1.0) - t, t, corner == vec3(1));
        sum += w.x * w.y * w.z * hash(c + corner);
    }
    return sum;
}

fn shade(s: Sample) -> Medium {
    var sum = 0.0;
    var scale = 1.0;
    for (var i = 0; i < octaves(); i++) {
        sum += (noise(s.position * (0.05 * scale)) - 0.5) / scale;
        scale *= 2.0;
    }
    return lookup_table(volume(s.position) + strength() * sum);
}
