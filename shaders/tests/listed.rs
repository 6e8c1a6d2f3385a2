//! The built-in functions that `docs/shaders.md` lists: those to use are evaluated, each against a number
//! found by other means, and those refused are refused.

mod common;

use std::collections::BTreeSet;

use common::{program, refused, shade};

const TEXT: &str = include_str!("../../docs/shaders.md");

/// A call of each function where a is 0.5, b is 2 and c is −0.75, and its value: by the definition in the
/// WGSL specification, as numbers that are known, or by identities.
const USABLE: &[(&str, &str, f64)] = &[
    ("abs", "abs(c)", 0.75),
    ("acos", "acos(a)", std::f64::consts::FRAC_PI_3),
    ("acosh", "acosh(b)", 1.316_957_896_924_816_6),
    ("all", "select(0.0, 1.0, all(vec2(a < b, b < a)))", 0.0),
    ("any", "select(0.0, 1.0, any(vec2(a < b, b < a)))", 1.0),
    ("asin", "asin(a)", std::f64::consts::FRAC_PI_6),
    ("asinh", "asinh(-c)", std::f64::consts::LN_2),
    ("atan", "atan(b * a)", std::f64::consts::FRAC_PI_4),
    ("atan2", "atan2(b, -b)", 3.0 * std::f64::consts::FRAC_PI_4),
    ("atanh", "atanh(a)", 0.549_306_144_334_054_8),
    ("bitcast", "f32(bitcast<u32>(f32(i32(b))) >> 23u)", 128.0),
    ("ceil", "ceil(c)", 0.0),
    ("clamp", "clamp(c, a, b)", 0.5),
    ("cos", "cos(a * 2.0943951)", 0.5),
    ("cosh", "cosh(a * 1.3862944)", 1.25),
    ("countLeadingZeros", "f32(countLeadingZeros(u32(b)))", 30.0),
    ("countOneBits", "f32(countOneBits(u32(b) + 5u))", 3.0),
    ("countTrailingZeros", "f32(countTrailingZeros(u32(b) * 4u))", 3.0),
    ("cross", "cross(vec3(a, b, 0.0), vec3(1.0, 0.0, 0.0)).z", -2.0),
    ("degrees", "degrees(a * 6.2831855)", 180.0),
    ("determinant", "determinant(mat2x2(a, b, c, 4.0))", 3.5),
    ("distance", "distance(vec2(a, 2.0 * b), vec2(a + 3.0, 0.0))", 5.0),
    ("dot", "dot(vec2(a, b), vec2(4.0, c))", 0.5),
    ("exp", "exp(b * 0.34657359)", 2.0),
    ("exp2", "exp2(b)", 4.0),
    ("extractBits", "f32(extractBits(u32(b) + 44u, 2u, 3u))", 3.0),
    ("faceForward", "faceForward(vec2(a, b), vec2(b, a), vec2(b, a)).x", -0.5),
    ("firstLeadingBit", "f32(firstLeadingBit(u32(b) + 44u))", 5.0),
    ("firstTrailingBit", "f32(firstTrailingBit(u32(b) + 46u))", 4.0),
    ("floor", "floor(c)", -1.0),
    ("fma", "fma(a, b, c)", 0.25),
    ("fract", "fract(c)", 0.25),
    ("frexp", "frexp(b * 3.0).fract + f32(frexp(b * 3.0).exp)", 3.75),
    ("insertBits", "f32(insertBits(u32(b), 5u, 3u, 4u))", 42.0),
    ("inverseSqrt", "inverseSqrt(b + b)", 0.5),
    ("ldexp", "ldexp(c, i32(b))", -3.0),
    ("length", "length(vec2(3.0 * a, b))", 2.5),
    ("log", "log(b)", std::f64::consts::LN_2),
    ("log2", "log2(a)", -1.0),
    ("max", "max(a, c)", 0.5),
    ("min", "min(a, c)", -0.75),
    ("mix", "mix(a, b, 0.25)", 0.875),
    ("modf", "modf(c - 1.0).fract * 2.0 + modf(c - 1.0).whole", -2.5),
    ("normalize", "normalize(vec2(3.0 * a, b)).y", 0.8),
    ("pow", "pow(b, 3.0)", 8.0),
    ("radians", "radians(b * 90.0)", std::f64::consts::PI),
    ("reflect", "reflect(vec2(a, b), vec2(0.0, 1.0)).y", -2.0),
    ("refract", "refract(vec2(0.0, c / 0.75), vec2(0.0, 1.0), a).y", -1.0),
    ("reverseBits", "f32(reverseBits(u32(b)) >> 24u)", 64.0),
    ("round", "round(a + b)", 2.0),
    ("saturate", "saturate(b)", 1.0),
    ("select", "select(a, b, c < a)", 2.0),
    ("sign", "sign(c)", -1.0),
    ("sin", "sin(a * 1.0471976)", 0.5),
    ("sinh", "sinh(a * 1.3862944)", 0.75),
    ("smoothstep", "smoothstep(0.0, b, a)", 0.15625),
    ("sqrt", "sqrt(b * 2.0)", 2.0),
    ("step", "step(a, c)", 0.0),
    ("tan", "tan(a * 1.5707964)", 1.0),
    ("tanh", "tanh(a * 1.0986123)", 0.5),
    ("transpose", "transpose(mat2x2(a, b, c, 4.0))[0].y", -0.75),
    ("trunc", "trunc(c)", 0.0),
];

#[test]
fn all_functions_listed_as_usable_are_evaluated() {
    let (_, rest) = TEXT.split_once("and these built-in functions:\n\n`").expect("the list");
    let listed: BTreeSet<&str> = rest.split('`').next().expect("its end").split_whitespace().collect();
    let here: BTreeSet<&str> = USABLE.iter().map(|(name, ..)| *name).collect();
    assert_eq!(listed, here);
    for (name, call, wanted) in USABLE {
        assert!(call.contains(&format!("{name}(")) || call.contains(&format!("{name}<")), "{call}");
        let text = format!(
            "fn shade(s: Sample) -> Medium {{
                let a = s.position.x; let b = s.position.y; let c = s.position.z;
                return Medium(vec3(0.0), {call});
            }}"
        );
        let program = program(&text).unwrap_or_else(|error| panic!("{call}: {error}"));
        // Numbers in the text are of single precision in both.
        let single = shade::<f32>(&program, &[[0.5, 2.0, -0.75, 0.0, 0.0, 1.0]]).unwrap()[0][3];
        let double = shade::<f64>(&program, &[[0.5, 2.0, -0.75, 0.0, 0.0, 1.0]]).unwrap()[0][3];
        assert!((f64::from(single) - wanted).abs() < 1e-6 * wanted.abs().max(1.0), "{call}: {single}, not {wanted}");
        assert!((double - wanted).abs() < 3e-7 * wanted.abs().max(1.0), "{call}: {double}, not {wanted}");
    }
}

/// What the row of refused functions lists, in its order, with texts that use it.
const REFUSED: &[(&str, &[&str])] = &[
    ("textures and samplers", &["fn f(t: texture_2d<f32>) {}", "fn f(s: sampler) {}", "fn f() { textureLoad(t); }"]),
    ("atomics", &["struct S { a: atomic<u32> }", "fn f() { atomicLoad(p); }"]),
    ("barriers", &["fn f() { workgroupBarrier(); }", "fn f() { textureBarrier(); }"]),
    (
        "subgroup and quad functions",
        &["fn f(x: f32) -> f32 { return subgroupAdd(x); }", "fn f(x: f32) -> f32 { return quadSwapX(x); }"],
    ),
    ("derivatives", &["dpdx", "dpdy", "dpdxCoarse", "dpdyFine", "fwidth", "fwidthFine"]),
    ("`discard`", &["fn f() { discard; }"]),
    ("`arrayLength`", &["fn f(x: ptr<function, array<f32, 4>>) -> u32 { return arrayLength(x); }"]),
    ("ray queries", &["fn f(q: ray_query) {}"]),
    ("`pack…`", &["fn f(x: vec2<f32>) -> u32 { return pack2x16float(x); }"]),
    ("`unpack…`", &["fn f(x: u32) -> vec4<f32> { return unpack4x8snorm(x); }"]),
    ("`dot4…`", &["fn f(x: u32) -> u32 { return dot4U8Packed(x, x); }"]),
    ("`quantizeToF16`", &["quantizeToF16"]),
    ("types other than 32 bits wide", &["fn f(x: f16) {}", "fn f(x: f64) {}", "fn f(x: i64) {}", "fn f(x: u64) {}"]),
];

#[test]
fn all_that_is_listed_as_refused_is_refused() {
    let row = TEXT.lines().find(|line| line.starts_with("| textures and samplers")).expect("the row");
    let listed = row.trim_start_matches("| ").split(" | ").next().expect("its first column").replace("; ", ", ");
    assert_eq!(listed.split(", ").collect::<Vec<_>>(), REFUSED.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    let shade = "fn shade(s: Sample) -> Medium { return Medium(); }";
    assert!(program(shade).is_ok());
    for (what, texts) in REFUSED {
        for text in *texts {
            // A name alone is a function of one number.
            let alone = format!("fn f(x: f32) -> f32 {{ return {text}(x); }}");
            let text = if text.contains(' ') { *text } else { &alone };
            let error = refused(&format!("{text}\n{shade}"));
            assert!(error.starts_with("test.wgsl:1:"), "{what}: {error}");
        }
    }
}
