//! Every operation against plain Rust, in `f32` and `f64`, on random numbers with all the odd ones.

mod common;

use common::{program, shade};
use proptest::prelude::*;
use volact_shaders::eval::Real;

/// Bits of a result; all NaN are one.
fn bits<F: Real>(x: F) -> u64 {
    if x.to_f64().is_nan() { u64::MAX } else { x.bits() }
}

/// Floats with the odd ones among them.
fn odd() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -20f32..20.0,
        1 => any::<f32>(),
        1 => prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, 0.5, 2.5, -2.5, f32::NAN, f32::INFINITY,
            f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, 1e-40, 4294967296.0, 2147483648.0]),
    ]
}

type Six = [f64; 6];

/// A float expression of a, b, c in WGSL and in Rust, for both types.
macro_rules! floats {
    ($([$wgsl:literal, |$a:ident, $b:ident, $c:ident| $rust:expr]),* $(,)?) => {
        const FLOATS: &[(&str, fn(f32, f32, f32) -> f32, fn(f64, f64, f64) -> f64)] = &[$(
            ($wgsl, { fn f($a: f32, $b: f32, $c: f32) -> f32 { _ = ($a, $b, $c); $rust } f },
                { fn f($a: f64, $b: f64, $c: f64) -> f64 { _ = ($a, $b, $c); $rust } f })
        ),*];
    };
}

floats![
    ["-a", |a, b, c| -a],
    ["a + b", |a, b, c| a + b],
    ["a - b", |a, b, c| a - b],
    ["a * b", |a, b, c| a * b],
    ["a / b", |a, b, c| a / b],
    ["a % b", |a, b, c| a % b],
    ["abs(a)", |a, b, c| a.abs()],
    ["floor(a)", |a, b, c| a.floor()],
    ["ceil(a)", |a, b, c| a.ceil()],
    ["trunc(a)", |a, b, c| a.trunc()],
    ["round(a)", |a, b, c| a.round_ties_even()],
    ["fract(a)", |a, b, c| a - a.floor()],
    ["sqrt(a)", |a, b, c| a.sqrt()],
    ["inverseSqrt(a)", |a, b, c| 1.0 / a.sqrt()],
    ["sin(a)", |a, b, c| a.sin()],
    ["cos(a)", |a, b, c| a.cos()],
    ["tan(a)", |a, b, c| a.tan()],
    ["asin(a)", |a, b, c| a.asin()],
    ["acos(a)", |a, b, c| a.acos()],
    ["atan(a)", |a, b, c| a.atan()],
    ["sinh(a)", |a, b, c| a.sinh()],
    ["cosh(a)", |a, b, c| a.cosh()],
    ["tanh(a)", |a, b, c| a.tanh()],
    ["asinh(a)", |a, b, c| a.asinh()],
    ["acosh(a)", |a, b, c| a.acosh()],
    ["atanh(a)", |a, b, c| a.atanh()],
    ["exp(a)", |a, b, c| a.exp()],
    ["exp2(a)", |a, b, c| a.exp2()],
    ["log(a)", |a, b, c| a.ln()],
    ["log2(a)", |a, b, c| a.log2()],
    ["sign(a)", |a, b, c| if a > 0.0 {
        1.0
    } else if a < 0.0 {
        -1.0
    } else {
        a
    }],
    ["saturate(a)", |a, b, c| {
        let x = if a < 0.0 { 0.0 } else { a };
        if 1.0 < x { 1.0 } else { x }
    }],
    ["min(a, b)", |a, b, c| if b < a { b } else { a }],
    ["max(a, b)", |a, b, c| if a < b { b } else { a }],
    ["pow(a, b)", |a, b, c| a.powf(b)],
    ["atan2(a, b)", |a, b, c| a.atan2(b)],
    ["step(a, b)", |a, b, c| if a <= b { 1.0 } else { 0.0 }],
    ["clamp(a, b, c)", |a, b, c| {
        let x = if a < b { b } else { a };
        if c < x { c } else { x }
    }],
    ["fma(a, b, c)", |a, b, c| a.mul_add(b, c)],
    ["mix(a, b, c)", |a, b, c| a * (1.0 - c) + b * c],
    ["smoothstep(a, b, c)", |a, b, c| {
        let t = (c - a) / (b - a);
        let t = if t < 0.0 { 0.0 } else { t };
        let t = if 1.0 < t { 1.0 } else { t };
        t * t * (3.0 - 2.0 * t)
    }],
    ["dot(vec3(a, b, c), vec3(b, c, a))", |a, b, c| a * b + b * c + c * a],
    ["length(vec2(a, b))", |a, b, c| (a * a + b * b).sqrt()],
    ["distance(vec2(a, b), vec2(c, a))", |a, b, c| ((a - c) * (a - c) + (b - a) * (b - a)).sqrt()],
    ["length(a)", |a, b, c| a.abs()],
    ["normalize(vec3(a, b, c)).y", |a, b, c| b / (a * a + b * b + c * c).sqrt()],
    ["cross(vec3(a, b, c), vec3(c, a, b)).x", |a, b, c| b * b - c * a],
    ["cross(vec3(a, b, c), vec3(c, a, b)).y", |a, b, c| c * c - a * b],
    ["reflect(vec2(a, b), vec2(c, a)).y", |a, b, c| b - 2.0 * (c * a + a * b) * a],
    ["faceForward(vec2(a, b), vec2(b, c), vec2(c, a)).x", |a, b, c| if b * c + c * a < 0.0 { a } else { -a }],
    ["refract(vec2(a, b), vec2(b, c), 0.5).x", |a, b, c| {
        let d = b * a + c * b;
        let k = 1.0 - 0.5 * 0.5 * (1.0 - d * d);
        if k < 0.0 { 0.0 } else { 0.5 * a - (0.5 * d + k.sqrt()) * b }
    }],
    ["(mat2x2(a, b, c, a) * vec2(b, c)).y", |a, b, c| b * b + a * c],
    ["(vec3(a, b, c) * mat2x3(a, b, c, c, b, a)).y", |a, b, c| a * c + b * b + c * a],
    ["(mat2x2(a, b, c, a) * mat2x2(b, c, a, b))[1][0]", |a, b, c| a * a + c * b],
    ["(mat2x2(a, b, c, a) * c)[1][0]", |a, b, c| c * c],
    ["(mat2x2(a, b, c, a) + mat2x2(b, c, a, b))[0][1]", |a, b, c| b + c],
    ["transpose(mat2x3(a, b, c, c, b, a))[2][0]", |a, b, c| c],
    ["transpose(mat2x3(a, b, c, a, b, b))[1][1]", |a, b, c| b],
    ["determinant(mat2x2(a, b, c, a))", |a, b, c| a * a - c * b],
    ["modf(a).whole", |a, b, c| a.trunc()],
    ["modf(a).fract", |a, b, c| a - a.trunc()],
    ["select(a, b, c < a)", |a, b, c| if c < a { b } else { a }],
    ["select(vec2(a), vec2(b), vec2((c < a), (c >= b))).y", |a, b, c| if c >= b { b } else { a }],
    ["f32(a == b)", |a, b, c| if a == b { 1.0 } else { 0.0 }],
    ["f32(a != b)", |a, b, c| if a != b { 1.0 } else { 0.0 }],
    ["f32(a <= b)", |a, b, c| if a <= b { 1.0 } else { 0.0 }],
    ["f32(a > b)", |a, b, c| if a > b { 1.0 } else { 0.0 }],
    ["f32(a >= b)", |a, b, c| if a >= b { 1.0 } else { 0.0 }],
    ["f32(all(vec3(a, b, c) < vec3(b, c, a + 9.0)))", |a, b, c| if a < b && b < c && c < a + 9.0 { 1.0 } else { 0.0 }],
    ["f32(any(vec2(a, b) < vec2(b, c)))", |a, b, c| if a < b || b < c { 1.0 } else { 0.0 }],
    ["f32(bool(a))", |a, b, c| if a != 0.0 { 1.0 } else { 0.0 }],
    ["f32(i32(a))", |a, b, c| (a as i32) as _],
    ["f32(u32(a))", |a, b, c| (a as u32) as _],
    ["vec4(a, b, c, a).zyx.x", |a, b, c| c],
];

fn main_expression(wgsl: &str) -> String {
    format!(
        "fn shade(s: Sample) -> Medium {{ let a = s.position.x; let b = s.position.y; let c = s.position.z;
        let d = s.direction.x; let e = s.direction.y; let f = s.direction.z;
        let i = i32(a); let j = i32(b); let u = u32(a); let w = u32(b); let k = u32(c);
        return Medium(vec3({wgsl}), 0.0); }}"
    )
}

fn evaluate<F: Real>(wgsl: &str, samples: &[Six]) -> Vec<F> {
    let text = main_expression(wgsl);
    let program = program(&text).unwrap_or_else(|error| panic!("{error}"));
    let samples: Vec<[F; 6]> = samples.iter().map(|s| s.map(F::from_f64)).collect();
    shade::<F>(&program, &samples).unwrap().into_iter().map(|m| m[0]).collect()
}

#[test]
fn arithmetic_is_that_of_the_machine() {
    let numbers = [0.0, -0.0, 1.5, -2.5, 1e30, 1e-30, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 3.0];
    let samples: Vec<Six> =
        (0..1000).map(|i| [numbers[i % 10], numbers[i / 10 % 10], numbers[i / 100], 0.0, 0.0, 0.0]).collect();
    for (wgsl, single, double) in FLOATS {
        for (s, found) in samples.iter().zip(evaluate::<f32>(wgsl, &samples)) {
            let wanted = single(s[0] as f32, s[1] as f32, s[2] as f32);
            assert_eq!(bits(found), bits(wanted), "{wgsl} of {s:?}: {found}, wanted {wanted}");
        }
        for (s, found) in samples.iter().zip(evaluate::<f64>(wgsl, &samples)) {
            assert_eq!(bits(found), bits(double(s[0], s[1], s[2])), "{wgsl} of {s:?}");
        }
    }
}

/// Integer expressions in WGSL, and in Rust of the same i, j (signed) and u, w, k (unsigned).
type Integers = (&'static str, fn(i32, i32, u32, u32, u32) -> u32);

const INTEGERS: &[Integers] = &[
    ("u32(i + j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.wrapping_add(j) as u32
    }),
    ("u32(i - j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.wrapping_sub(j) as u32
    }),
    ("u32(i * j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.wrapping_mul(j) as u32
    }),
    ("u32(i / j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.checked_div(j).unwrap_or(i) as u32
    }),
    ("u32(i % j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.checked_rem(j).unwrap_or(0) as u32
    }),
    ("u / w", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.checked_div(w).unwrap_or(u)
    }),
    ("u % w", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.checked_rem(w).unwrap_or(0)
    }),
    ("u * w", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.wrapping_mul(w)
    }),
    ("u - w", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.wrapping_sub(w)
    }),
    ("u & w", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u & w
    }),
    ("u | w", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u | w
    }),
    ("u ^ w", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u ^ w
    }),
    ("~u", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        !u
    }),
    ("u32(-i)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.wrapping_neg() as u32
    }),
    ("u << k", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u << (k % 32)
    }),
    ("u >> k", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u >> (k % 32)
    }),
    ("u32(i >> k)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        (i >> (k % 32)) as u32
    }),
    ("u32(min(i, j))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.min(j) as u32
    }),
    ("u32(max(i, j))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.max(j) as u32
    }),
    ("min(u, w)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.min(w)
    }),
    ("max(u, w)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.max(w)
    }),
    ("u32(clamp(i, j, 7))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.max(j).min(7) as u32
    }),
    ("clamp(u, w, k)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.max(w).min(k)
    }),
    ("u32(abs(i))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.wrapping_abs() as u32
    }),
    ("u32(sign(i))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.signum() as u32
    }),
    ("u32(i < j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(i < j)
    }),
    ("u32(i >= j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(i >= j)
    }),
    ("u32(u < w)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(u < w)
    }),
    ("u32(u >= w)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(u >= w)
    }),
    ("u32(i == j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(i == j)
    }),
    ("u32(u != w)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(u != w)
    }),
    ("countOneBits(u)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.count_ones()
    }),
    ("countLeadingZeros(u)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.leading_zeros()
    }),
    ("countTrailingZeros(u)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.trailing_zeros()
    }),
    ("reverseBits(u)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u.reverse_bits()
    }),
    ("firstTrailingBit(u)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        if u == 0 { u32::MAX } else { u.trailing_zeros() }
    }),
    ("firstLeadingBit(u)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        if u == 0 { u32::MAX } else { 31 - u.leading_zeros() }
    }),
    ("u32(firstLeadingBit(i))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        (0..32).rev().find(|b| (i >> b) & 1 != i32::from(i < 0)).unwrap_or(u32::MAX)
    }),
    ("extractBits(u, w, k)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        (0..k.min(32)).filter(|b| w.saturating_add(*b) < 32).map(|b| ((u >> (w + b)) & 1) << b).sum()
    }),
    ("insertBits(u, 21u, w, k)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        (0..32u32)
            .map(
                |b| if b >= w && b - w < k { ((21u32.checked_shr(b - w).unwrap_or(0)) & 1) << b } else { u & (1 << b) },
            )
            .sum()
    }),
    ("u32(dot(vec2(i, j), vec2(j, i)))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i.wrapping_mul(j).wrapping_mul(2) as u32
    }),
    ("bitcast<u32>(i)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        i as u32
    }),
    ("u32(bool(u) && i > j)", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(u != 0 && i > j)
    }),
    ("u32(!(u > w))", |i, j, u, w, k| {
        _ = (i, j, u, w, k);
        u32::from(u <= w)
    }),
];

/// Whole numbers that `f32` holds, so that they come in as they are.
fn whole() -> impl Strategy<Value = f32> {
    prop_oneof![
        (-40i32..40).prop_map(|x| x as f32),
        any::<i32>().prop_map(|x| x as f32),
        any::<u32>().prop_map(|x| x as f32),
        prop::sample::select(vec![0.0, 31.0, 32.0, 33.0, -1.0, 2147483648.0, -2147483648.0, 4294967040.0]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn floats_are_as_in_rust(samples in prop::collection::vec([odd(), odd(), odd()], 40)) {
        let samples: Vec<Six> = samples.iter().map(|[a, b, c]| [(*a).into(), (*b).into(), (*c).into(), 0.0, 0.0, 0.0]).collect();
        for (wgsl, single, double) in FLOATS {
            for (s, found) in samples.iter().zip(evaluate::<f32>(wgsl, &samples)) {
                let wanted = single(s[0] as f32, s[1] as f32, s[2] as f32);
                prop_assert_eq!(bits(found), bits(wanted), "{} of {:?}: {}, wanted {}", wgsl, s, found, wanted);
            }
            for (s, found) in samples.iter().zip(evaluate::<f64>(wgsl, &samples)) {
                let wanted = double(s[0], s[1], s[2]);
                prop_assert_eq!(bits(found), bits(wanted), "{} of {:?}: {}, wanted {}", wgsl, s, found, wanted);
            }
        }
    }

    #[test]
    fn integers_are_as_in_wgsl(samples in prop::collection::vec([whole(), whole(), whole()], 60)) {
        let samples: Vec<Six> = samples.iter().map(|[a, b, c]| [(*a).into(), (*b).into(), (*c).into(), 0.0, 0.0, 0.0]).collect();
        for (wgsl, rust) in INTEGERS {
            for (s, found) in samples.iter().zip(evaluate::<f64>(&format!("f32({wgsl})"), &samples)) {
                let [a, b, c, ..] = *s;
                let wanted = rust(a as i32, b as i32, a as u32, b as u32, c as u32);
                prop_assert_eq!(found, f64::from(wanted), "{} of {:?}", wgsl, s);
            }
        }
    }
}

#[test]
fn numbers_are_taken_apart_and_put_together() {
    let samples: Vec<Six> = (0..200).map(|i| [(f64::from(i) - 100.0) * 1.37e3, 3.0, 0.0, 0.0, 0.0, 0.0]).collect();
    for (s, found) in samples.iter().zip(evaluate::<f32>("ldexp(frexp(a).fract, frexp(a).exp + 3)", &samples)) {
        assert_eq!(found, s[0] as f32 * 8.0);
    }
    for (s, found) in samples.iter().zip(evaluate::<f64>("bitcast<f32>(bitcast<u32>(a))", &samples)) {
        assert_eq!(found, f64::from(s[0] as f32));
    }
    for (s, found) in samples.iter().zip(evaluate::<f64>("degrees(radians(a))", &samples)) {
        assert!((found - s[0]).abs() <= 1e-9, "{found} {s:?}");
    }
}

#[test]
fn determinants_are_sums_of_products() {
    let samples: Vec<Six> = (0..50).map(|i| [0.3 * f64::from(i), 1.0 - f64::from(i), 2.5, 0.7, -1.1, 3.0]).collect();
    for (s, found) in samples.iter().zip(evaluate::<f64>("determinant(mat3x3(a, b, c, d, e, f, b, f, a))", &samples)) {
        let [a, b, c, d, e, f] = s.map(f64::from);
        let wanted = a * (e * a - f * f) - d * (b * a - f * c) + b * (b * f - e * c);
        assert!((found - wanted).abs() <= 1e-9 * (1.0 + wanted.abs()), "{found} {wanted}");
    }
    // A matrix with a known one: of its rows one is doubled, two are exchanged.
    let text = "determinant(mat4x4(0.0, 1.0, 0.0, 0.0, a, 0.0, 0.0, 0.0, 0.0, b, 2.0, 0.0, c, d, e, 1.0))";
    for (s, found) in samples.iter().zip(evaluate::<f64>(text, &samples)) {
        assert!((found + 2.0 * s[0]).abs() <= 1e-12 * (1.0 + s[0].abs()), "{found} {s:?}");
    }
}
