//! Control flow by masks against the same written in Rust, sample by sample.

mod common;

use common::{program, refused, shade};
use proptest::prelude::*;
use volact_shaders::eval::Overrun;

/// Evaluates on the samples and compares with a function of one sample.
fn check(text: &str, samples: &[[f32; 6]], truth: impl Fn([f32; 6]) -> [f32; 4]) {
    let program = program(text).unwrap_or_else(|e| panic!("{e}"));
    let found = shade(&program, samples).unwrap();
    for (sample, found) in samples.iter().zip(found) {
        let wanted = truth(*sample);
        assert_eq!(
            found.map(f32::to_bits),
            wanted.map(f32::to_bits),
            "{sample:?}: {found:?}, wanted {wanted:?}\n{text}"
        );
    }
}

/// Samples on a grid of small numbers, so that ways meet and part.
fn grid() -> Vec<[f32; 6]> {
    (0..700).map(|i| [(i % 7) as f32 - 1.0, (i / 7 % 10) as f32, (i / 70) as f32, 0.5, 1.5, -2.0]).collect()
}

#[test]
fn samples_go_different_ways() {
    let text = "fn shade(s: Sample) -> Medium {
        var m: Medium;
        let x = s.position.x;
        if x > 3.0 { m.extinction = 1.0; } else if x > 1.0 { m.extinction = s.position.y; m.color.g = 2.0; }
        else { m.color = vec3(x); }
        m.color.b += 1.0;
        return m;
    }";
    check(text, &grid(), |[x, y, ..]| {
        if x > 3.0 {
            [0.0, 0.0, 1.0, 1.0]
        } else if x > 1.0 {
            [0.0, 2.0, 1.0, y]
        } else {
            [x, x, x + 1.0, 0.0]
        }
    });
}

#[test]
fn early_returns_end_a_function_and_no_more() {
    let text = "fn f(x: f32, y: f32) -> f32 {
        if x < 0.0 { return -1.0; }
        for (var i = 0; i < 10; i++) {
            if f32(i) > x { return f32(i) * 10.0 + y; }
            if f32(i) == y { return 1000.0; }
        }
        return y;
    }
    fn shade(s: Sample) -> Medium {
        let a = f(s.position.x, s.position.y);
        let b = f(s.position.y, s.position.z);
        if a > b { return Medium(vec3(a), b); }
        return Medium(vec3(b), a);
    }";
    fn f(x: f32, y: f32) -> f32 {
        if x < 0.0 {
            return -1.0;
        }
        for i in 0..10 {
            if i as f32 > x {
                return i as f32 * 10.0 + y;
            }
            if i as f32 == y {
                return 1000.0;
            }
        }
        y
    }
    check(text, &grid(), |[x, y, z, ..]| {
        let (a, b) = (f(x, y), f(y, z));
        if a > b { [a, a, a, b] } else { [b, b, b, a] }
    });
}

#[test]
fn loops_break_and_continue_for_each_sample() {
    let text = "fn shade(s: Sample) -> Medium {
        var sum = 0.0;
        var count = 0u;
        for (var i = 0; i < 20; i++) {
            if f32(i) == s.position.x { continue; }
            if f32(i) > s.position.y + 2.0 { break; }
            var j = 0;
            loop {
                if j > i { break; }
                sum += f32(j);
                continuing { j += 2; break if f32(j) > s.position.z; }
            }
            count++;
        }
        var k = s.position.z;
        while k > 0.5 { k = k / 2.0; sum -= k; }
        return Medium(vec3(sum, f32(count), k), 0.0);
    }";
    check(text, &grid(), |[x, y, z, ..]| {
        let (mut sum, mut count) = (0.0f32, 0);
        for i in 0..20 {
            if i as f32 == x {
                continue;
            }
            if i as f32 > y + 2.0 {
                break;
            }
            let mut j = 0;
            loop {
                if j > i {
                    break;
                }
                sum += j as f32;
                j += 2;
                if j as f32 > z {
                    break;
                }
            }
            count += 1;
        }
        let mut k = z;
        while k > 0.5 {
            k /= 2.0;
            sum -= k;
        }
        [sum, count as f32, k, 0.0]
    });
}

#[test]
fn switches_take_their_case() {
    let text = "fn f(x: i32, y: i32) -> i32 {
        var r = 0;
        for (var i = 0; i < 6; i++) {
            switch x + i {
                case 0, 3: { r += 1; }
                case 1: { if y > 4 { break; } r += 10; }
                case 2: { continue; }
                case 5: { if y == 7 { return -5; } r += 100; }
                default: { r += 1000; }
            }
            r += 10000;
        }
        return r;
    }
    fn shade(s: Sample) -> Medium {
        return Medium(vec3(f32(f(i32(s.position.x), i32(s.position.y)))), 0.0);
    }";
    fn f(x: i32, y: i32) -> i32 {
        let mut r = 0;
        for i in 0..6 {
            match x + i {
                0 | 3 => r += 1,
                1 => {
                    if y <= 4 {
                        r += 10
                    }
                }
                2 => continue,
                5 => {
                    if y == 7 {
                        return -5;
                    }
                    r += 100
                }
                _ => r += 1000,
            }
            r += 10000;
        }
        r
    }
    check(text, &grid(), |[x, y, ..]| {
        let r = f(x as i32, y as i32) as f32;
        [r, r, r, 0.0]
    });
}

#[test]
fn indices_stay_inside() {
    let text = "const weights = array(1.0, 2.0, 4.0);
    fn shade(s: Sample) -> Medium {
        var a: array<vec2<f32>, 3>;
        let i = i32(s.position.x);
        a[i].y = 5.0;
        a[i + 1] = vec2(7.0, 8.0);
        var v = vec3(1.0, 2.0, 3.0);
        v[i] += 10.0;
        let c = v;
        let m = mat2x2(1.0, 2.0, 3.0, 4.0);
        return Medium(vec3(a[0].y + 10.0 * a[1].x + 100.0 * a[2].y, weights[i], c[i] + v.z), m[i][i + 1]);
    }";
    check(text, &grid(), |[x, ..]| {
        let i = x as i32;
        // A negative index is beyond the end, like all that are no index.
        let at = |i: i32, n: usize| if i < 0 { n - 1 } else { (i as usize).min(n - 1) };
        let mut a = [[0f32; 2]; 3];
        a[at(i, 3)][1] = 5.0;
        a[at(i + 1, 3)] = [7.0, 8.0];
        let mut v = [1f32, 2.0, 3.0];
        v[at(i, 3)] += 10.0;
        let m = [[1.0, 2.0], [3.0, 4.0f32]];
        let sum = a[0][1] + 10.0 * a[1][0] + 100.0 * a[2][1];
        [sum, [1.0, 2.0, 4.0][at(i, 3)], v[at(i, 3)] + v[2], m[at(i, 2)][at(i + 1, 2)]]
    });
}

#[test]
fn pointers_change_what_they_point_to() {
    let text =
        "fn add(p: ptr<function, vec3<f32>>, x: f32) -> f32 { (*p).y += x; let old = (*p).x; (*p).x = x; return old; }
    fn shade(s: Sample) -> Medium {
        var v = s.position;
        let before = v;
        if v.z > 3.0 { let old = add(&v, 2.0); v.z = old; }
        return Medium(v, before.y);
    }";
    check(text, &grid(), |[x, y, z, ..]| if z > 3.0 { [2.0, y + 2.0, x, y] } else { [x, y, z, y] });
}

#[test]
fn what_is_not_evaluated_has_no_effect() {
    let text = "var_";
    assert!(refused(text).contains("test.wgsl:1:1"));
    let text = "fn touch(p: ptr<function, f32>) -> bool { *p += 1.0; return true; }
    fn shade(s: Sample) -> Medium {
        var n = 0.0;
        let a = s.position.x > 2.0 && touch(&n);
        let b = s.position.y > 2.0 || touch(&n);
        return Medium(vec3(n, f32(a), f32(b)), 0.0);
    }";
    check(text, &grid(), |[x, y, ..]| {
        let n = f32::from(u8::from(x > 2.0)) + f32::from(u8::from(y <= 2.0));
        [n, f32::from(u8::from(x > 2.0)), 1.0, 0.0]
    });
}

#[test]
fn a_loop_without_end_is_an_error_that_names_shader_and_budget() {
    let text =
        "fn shade(s: Sample) -> Medium { var x = 0.0; loop { x += s.position.x; } return Medium(vec3(x), 0.0); }";
    let Ok(endless) = program(text) else { panic!("accepted by naga") };
    let error = shade(&endless, &[[1f32; 6]; 3]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "shader \"test\": the loops of one sample go round more than 65536 times; the shader may never end"
    );
    // Also where nothing comes of it, and where only one sample does not end.
    let text = "fn shade(s: Sample) -> Medium { while s.position.x > 5.0 { } return Medium(); }";
    let one = program(text).unwrap();
    let mut samples = vec![[0f32; 6]; 100];
    assert!(shade(&one, &samples).is_ok());
    samples[77][0] = 6.0;
    assert!(matches!(shade(&one, &samples), Err(Overrun::Loops { budget: 65_536, .. })));
}

/// The budget is a sample's own: what others do does not count, nor how many they are.
#[test]
fn the_budget_is_of_one_sample() {
    let text = "fn shade(s: Sample) -> Medium {
        var n = 0;
        for (var k = 0; k < 3; k++) { if f32(k) == s.position.x { for (var i = 0; i < 40000; i++) { n++; } } }
        return Medium(vec3(f32(n)), 0.0);
    }";
    let each = program(text).unwrap();
    let samples: Vec<[f32; 6]> = (0..9).map(|i| [(i % 3) as f32, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    assert!(shade(&each, &samples).unwrap().iter().all(|m| m[0] == 40000.0));
    let both = program(&text.replace("f32(k) == s.position.x", "k < 2")).unwrap();
    assert!(shade(&both, &samples).is_err());
}

#[test]
fn too_much_code_is_refused() {
    let mut text = String::from("fn g0(x: f32) -> f32 { return sin(x) + 1.0; }\n");
    for i in 1..20 {
        let before = i - 1;
        text += &format!("fn g{i}(x: f32) -> f32 {{ return g{before}(x) * g{before}(x + 1.0); }}\n");
    }
    text += "fn shade(s: Sample) -> Medium { return Medium(vec3(g19(s.position.x)), 0.0); }";
    let error = refused(&text);
    assert!(error.contains("with all functions inlined, more than 65536 instructions"), "{error}");
}

/// Thousands of loops, all inlined: large, but within bounds and soon ready.
#[test]
fn many_loops_are_lowered() {
    let mut text =
        String::from("fn g0(x: f32) -> f32 { var y = x; for (var i = 0; i < 2; i++) { y += 1.0; } return y; }\n");
    for i in 1..12 {
        let before = i - 1;
        text += &format!("fn g{i}(x: f32) -> f32 {{ return g{before}(g{before}(x)); }}\n");
    }
    text += "fn shade(s: Sample) -> Medium { return Medium(vec3(g11(s.position.x)), 0.0); }";
    check(&text, &grid()[..3], |[x, ..]| [x + 4096.0, x + 4096.0, x + 4096.0, 0.0]);
}

proptest! {
    /// Batches of any length give what single samples give.
    #[test]
    fn neighbours_do_not_matter(seed in any::<u64>(), length in 1usize..600) {
        let text = "fn shade(s: Sample) -> Medium {
            var x = s.position.x;
            var n = 0.0;
            loop {
                if x < 1.5 { if n > 4.0 { return Medium(vec3(x), n); } break; }
                if fract(x) > 0.5 { x = x * 1.5 + 1.0; } else { x = floor(x / 2.0) + 0.6 * s.position.y; n += 1.0; }
                n += 1.0;
                if n > 30.0 { break; }
            }
            return Medium(vec3(x, n, s.position.z), 1.0);
        }";
        let mut state = seed;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let samples: Vec<[f64; 6]> = (0..length).map(|_| std::array::from_fn(|_| random() * 9.0)).collect();
        let program = program(text).unwrap();
        let together = shade(&program, &samples).unwrap();
        let step = length / 7 + 1;
        for (i, sample) in samples.iter().enumerate().step_by(step) {
            prop_assert_eq!(together[i], shade(&program, &[*sample]).unwrap()[0]);
        }
    }
}
