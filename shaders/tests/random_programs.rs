//! Random programs: what the evaluation makes of them, against an evaluator that goes through the
//! same tree sample by sample.

mod common;

use std::fmt::Write;

use common::{program, shade};
use proptest::prelude::*;
use volact_shaders::eval::Real;

/// Variables of a program.
const VARIABLES: usize = 4;

#[derive(Clone, Debug)]
enum Float {
    Input(usize),
    Variable(usize),
    Constant(i8),
    Unary(usize, Box<Float>),
    Binary(usize, Box<[Float; 2]>),
    Select(Box<Truth>, Box<[Float; 2]>),
    Whole(Box<Int>),
    Element(Box<Int>, Box<[Float; 3]>),
    Call(Box<[Float; 2]>),
}

#[derive(Clone, Debug)]
enum Int {
    Constant(i8),
    Of(Box<Float>),
    Binary(usize, Box<[Int; 2]>),
}

#[derive(Clone, Debug)]
enum Truth {
    Compare(usize, Box<[Float; 2]>),
    Both(Box<[Truth; 2]>),
    Either(Box<[Truth; 2]>),
    Not(Box<Truth>),
}

#[derive(Clone, Debug)]
enum Statement {
    Set(usize, Float),
    If(Truth, Vec<Statement>, Vec<Statement>),
    Repeat(u8, Vec<Statement>),
    Switch(Int, Vec<Vec<Statement>>),
    Break(Truth),
    Continue(Truth),
    Return(Truth),
}

const UNARY: [&str; 8] = ["-", "abs", "floor", "sqrt", "sin", "fract", "sign", "exp2"];
const BINARY: [&str; 8] = ["+", "-", "*", "/", "min", "max", "step", "atan2"];
const WHOLE: [&str; 8] = ["+", "-", "*", "/", "%", "&", "^", "max"];
const COMPARE: [&str; 6] = ["<", "<=", ">", ">=", "==", "!="];

fn infix(text: &mut String, op: &str, a: impl Fn(&mut String), b: impl Fn(&mut String)) {
    let named = op.chars().all(char::is_alphanumeric);
    text.push_str(if named { op } else { "" });
    text.push('(');
    a(text);
    text.push_str(if named { ", " } else { op });
    text.push(' ');
    b(text);
    text.push(')');
}

impl Float {
    fn wgsl(&self, text: &mut String) {
        match self {
            Self::Input(i) => _ = write!(text, "s.{}.{}", ["position", "direction"][i / 3], ["x", "y", "z"][i % 3]),
            Self::Variable(i) => _ = write!(text, "v{i}"),
            // Not constant to the parser, which would refuse to divide by zero.
            Self::Constant(c) => _ = write!(text, "(one * {c}.5)"),
            Self::Unary(op, a) => {
                text.push_str(UNARY[*op]);
                text.push('(');
                a.wgsl(text);
                text.push(')');
            }
            Self::Binary(op, ab) => infix(text, BINARY[*op], |t| ab[0].wgsl(t), |t| ab[1].wgsl(t)),
            Self::Select(c, ab) => {
                text.push_str("select(");
                ab[1].wgsl(text);
                text.push_str(", ");
                ab[0].wgsl(text);
                text.push_str(", ");
                c.wgsl(text);
                text.push(')');
            }
            Self::Whole(a) => {
                text.push_str("f32(");
                a.wgsl(text);
                text.push(')');
            }
            Self::Element(i, abc) => {
                text.push_str("vec3(");
                for (k, a) in abc.iter().enumerate() {
                    text.push_str(if k > 0 { ", " } else { "" });
                    a.wgsl(text);
                }
                text.push_str(")[");
                i.wgsl(text);
                text.push(']');
            }
            Self::Call(ab) => {
                text.push_str("f(");
                ab[0].wgsl(text);
                text.push_str(", ");
                ab[1].wgsl(text);
                text.push(')');
            }
        }
    }

    fn value<F: Real>(&self, s: &[F; 6], v: &[F]) -> F {
        match self {
            Self::Input(i) => s[*i],
            Self::Variable(i) => v[*i],
            Self::Constant(c) => F::from_f64(if *c < 0 { f64::from(*c) - 0.5 } else { f64::from(*c) + 0.5 }),
            Self::Unary(op, a) => {
                let x = a.value(s, v);
                match UNARY[*op] {
                    "-" => -x,
                    "abs" => x.abs(),
                    "floor" => x.floor(),
                    "sqrt" => x.sqrt(),
                    "sin" => x.sin(),
                    "fract" => x - x.floor(),
                    "exp2" => x.exp2(),
                    _ if x > F::from_f64(0.0) => F::from_f64(1.0),
                    _ if x < F::from_f64(0.0) => F::from_f64(-1.0),
                    _ => x,
                }
            }
            Self::Binary(op, ab) => {
                let (x, y) = (ab[0].value(s, v), ab[1].value(s, v));
                match BINARY[*op] {
                    "+" => x + y,
                    "-" => x - y,
                    "*" => x * y,
                    "/" => x / y,
                    "min" => {
                        if y < x {
                            y
                        } else {
                            x
                        }
                    }
                    "max" => {
                        if x < y {
                            y
                        } else {
                            x
                        }
                    }
                    "step" => F::from_f64(if x <= y { 1.0 } else { 0.0 }),
                    _ => x.atan2(y),
                }
            }
            Self::Select(c, ab) => {
                if c.value(s, v) {
                    ab[0].value(s, v)
                } else {
                    ab[1].value(s, v)
                }
            }
            Self::Whole(a) => F::from_i32(a.value(s, v)),
            Self::Element(i, abc) => abc[(i.value(s, v) as u32).min(2) as usize].value(s, v),
            Self::Call(ab) => called(ab[0].value(s, v), ab[1].value(s, v)),
        }
    }
}

/// A function with an early return and a loop, that programs call.
const CALLED: &str = "fn f(a: f32, b: f32) -> f32 {
    var x = a;
    if a < b { return a * 0.5; }
    for (var i = 0; i < 3; i++) { x = x * 0.5 + b; if x > 9.0 { return x - f32(i); } }
    return x;
}
";

fn called<F: Real>(a: F, b: F) -> F {
    let half = F::from_f64(0.5);
    if a < b {
        return a * half;
    }
    let mut x = a;
    for i in 0..3 {
        x = x * half + b;
        if x > F::from_f64(9.0) {
            return x - F::from_i32(i);
        }
    }
    x
}

impl Int {
    fn wgsl(&self, text: &mut String) {
        match self {
            Self::Constant(c) => _ = write!(text, "(whole * {c})"),
            Self::Of(a) => {
                text.push_str("i32(");
                a.wgsl(text);
                text.push(')');
            }
            Self::Binary(op, ab) => infix(text, WHOLE[*op], |t| ab[0].wgsl(t), |t| ab[1].wgsl(t)),
        }
    }

    fn value<F: Real>(&self, s: &[F; 6], v: &[F]) -> i32 {
        match self {
            Self::Constant(c) => i32::from(*c),
            Self::Of(a) => a.value(s, v).to_i32(),
            Self::Binary(op, ab) => {
                let (x, y) = (ab[0].value(s, v), ab[1].value(s, v));
                match WHOLE[*op] {
                    "+" => x.wrapping_add(y),
                    "-" => x.wrapping_sub(y),
                    "*" => x.wrapping_mul(y),
                    "/" => x.checked_div(y).unwrap_or(x),
                    "%" => x.checked_rem(y).unwrap_or(0),
                    "&" => x & y,
                    "^" => x ^ y,
                    _ => x.max(y),
                }
            }
        }
    }
}

impl Truth {
    fn wgsl(&self, text: &mut String) {
        match self {
            Self::Compare(op, ab) => infix(text, COMPARE[*op], |t| ab[0].wgsl(t), |t| ab[1].wgsl(t)),
            Self::Both(ab) => infix(text, "&&", |t| ab[0].wgsl(t), |t| ab[1].wgsl(t)),
            Self::Either(ab) => infix(text, "|", |t| ab[0].wgsl(t), |t| ab[1].wgsl(t)),
            Self::Not(a) => {
                text.push('!');
                a.wgsl(text);
            }
        }
    }

    fn value<F: Real>(&self, s: &[F; 6], v: &[F]) -> bool {
        match self {
            Self::Compare(op, ab) => {
                let (x, y) = (ab[0].value(s, v), ab[1].value(s, v));
                match COMPARE[*op] {
                    "<" => x < y,
                    "<=" => x <= y,
                    ">" => x > y,
                    ">=" => x >= y,
                    "==" => x == y,
                    _ => x != y,
                }
            }
            Self::Both(ab) => ab[0].value(s, v) && ab[1].value(s, v),
            Self::Either(ab) => ab[0].value(s, v) || ab[1].value(s, v),
            Self::Not(a) => !a.value(s, v),
        }
    }
}

/// How a statement ends.
#[derive(PartialEq)]
enum End {
    Next,
    Break,
    Continue,
    Return,
}

fn wgsl(statements: &[Statement], depth: usize, in_loop: bool, text: &mut String) {
    let condition = |text: &mut String, c: &Truth, then: &str| {
        text.push_str("if ");
        c.wgsl(text);
        _ = writeln!(text, " {{ {then}; }}");
    };
    for statement in statements {
        match statement {
            Statement::Set(i, value) => {
                _ = write!(text, "v{i} = ");
                value.wgsl(text);
                text.push_str(";\n");
            }
            Statement::If(c, yes, no) => {
                text.push_str("if ");
                c.wgsl(text);
                text.push_str(" {\n");
                wgsl(yes, depth + 1, in_loop, text);
                text.push_str("} else {\n");
                wgsl(no, depth + 1, in_loop, text);
                text.push_str("}\n");
            }
            Statement::Repeat(count, body) => {
                _ = writeln!(text, "for (var i{depth} = 0; i{depth} < {count}; i{depth}++) {{");
                wgsl(body, depth + 1, true, text);
                text.push_str("}\n");
            }
            Statement::Switch(of, cases) => {
                text.push_str("switch ");
                of.wgsl(text);
                text.push_str(" {\n");
                for (i, case) in cases.iter().enumerate() {
                    _ = writeln!(text, "{} {{", if i == 0 { "default:".into() } else { format!("case {i}, -{i}:") });
                    wgsl(case, depth + 1, in_loop, text);
                    text.push_str("}\n");
                }
                text.push_str("}\n");
            }
            Statement::Break(c) if in_loop => condition(text, c, "break"),
            Statement::Continue(c) if in_loop => condition(text, c, "continue"),
            Statement::Break(_) | Statement::Continue(_) => {}
            Statement::Return(c) => condition(text, c, "return Medium(vec3(v0, v1, v2), -1.0)"),
        }
    }
}

fn run<F: Real>(statements: &[Statement], s: &[F; 6], v: &mut [F], in_loop: bool) -> End {
    for statement in statements {
        let end = match statement {
            Statement::Set(i, value) => {
                v[*i] = value.value(s, v);
                End::Next
            }
            Statement::If(c, yes, no) => run(if c.value(s, v) { yes } else { no }, s, v, in_loop),
            Statement::Repeat(count, body) => {
                let mut end = End::Next;
                for _ in 0..*count {
                    match run(body, s, v, true) {
                        End::Break => break,
                        End::Return => {
                            end = End::Return;
                            break;
                        }
                        End::Next | End::Continue => {}
                    }
                }
                end
            }
            Statement::Switch(of, cases) => {
                let of = of.value(s, v).unsigned_abs() as usize;
                match run(&cases[if of < cases.len() { of } else { 0 }], s, v, in_loop) {
                    End::Break => End::Next,
                    other => other,
                }
            }
            Statement::Break(c) if in_loop && c.value(s, v) => End::Break,
            Statement::Continue(c) if in_loop && c.value(s, v) => End::Continue,
            Statement::Return(c) if c.value(s, v) => End::Return,
            _ => End::Next,
        };
        if end != End::Next {
            return end;
        }
    }
    End::Next
}

fn float() -> BoxedStrategy<Float> {
    let leaf = prop_oneof![
        (0..6usize).prop_map(Float::Input),
        (0..VARIABLES).prop_map(Float::Variable),
        (-9i8..9).prop_map(Float::Constant),
    ];
    leaf.prop_recursive(3, 12, 3, |inner| {
        let pair = || [inner.clone(), inner.clone()];
        prop_oneof![
            2 => (0..8usize, inner.clone()).prop_map(|(op, a)| Float::Unary(op, a.into())),
            6 => (0..8usize, pair()).prop_map(|(op, ab)| Float::Binary(op, ab.into())),
            1 => (0..6usize, pair(), pair()).prop_map(|(op, c, ab)| {
                Float::Select(Truth::Compare(op, c.into()).into(), ab.into())
            }),
            1 => (0..8usize, pair()).prop_map(|(op, [a, b])| {
                Float::Whole(Int::Binary(op, [Int::Of(a.into()), Int::Of(b.into())].into()).into())
            }),
            1 => (inner.clone(), [inner.clone(), inner.clone(), inner.clone()])
                .prop_map(|(i, abc)| Float::Element(Int::Of(i.into()).into(), abc.into())),
            1 => pair().prop_map(|ab| Float::Call(ab.into())),
        ]
    })
    .boxed()
}

fn truth() -> BoxedStrategy<Truth> {
    let leaf = (0..6usize, [float(), float()]).prop_map(|(op, ab)| Truth::Compare(op, ab.into()));
    leaf.prop_recursive(2, 4, 2, |inner| {
        let pair = || [inner.clone(), inner.clone()];
        prop_oneof![
            pair().prop_map(|ab| Truth::Both(ab.into())),
            pair().prop_map(|ab| Truth::Either(ab.into())),
            inner.clone().prop_map(|a| Truth::Not(a.into())),
        ]
    })
    .boxed()
}

fn statements() -> BoxedStrategy<Vec<Statement>> {
    let leaf = prop_oneof![
        8 => (0..VARIABLES, float()).prop_map(|(i, value)| Statement::Set(i, value)),
        1 => truth().prop_map(Statement::Break),
        1 => truth().prop_map(Statement::Continue),
        1 => truth().prop_map(Statement::Return),
    ];
    let one = leaf.prop_recursive(3, 24, 4, |inner| {
        let some = || prop::collection::vec(inner.clone(), 0..4);
        let whole = prop_oneof![(-2i8..4).prop_map(Int::Constant), float().prop_map(|a| Int::Of(a.into())),];
        prop_oneof![
            2 => (truth(), some(), some()).prop_map(|(c, yes, no)| Statement::If(c, yes, no)),
            2 => (1u8..5, some()).prop_map(|(count, body)| Statement::Repeat(count, body)),
            1 => (whole, prop::collection::vec(some(), 1..4)).prop_map(|(of, cases)| Statement::Switch(of, cases)),
        ]
    });
    prop::collection::vec(one, 1..6).boxed()
}

fn check<F: Real>(body: &[Statement], text: &str, samples: &[[f64; 6]]) -> Result<(), TestCaseError> {
    let program = program(text).map_err(|error| TestCaseError::fail(format!("{error}")))?;
    let samples: Vec<[F; 6]> = samples.iter().map(|s| s.map(F::from_f64)).collect();
    let found = shade(&program, &samples).unwrap();
    for (s, found) in samples.iter().zip(found) {
        let mut v = vec![F::from_f64(0.0); VARIABLES];
        let end = run(body, s, &mut v, false);
        v[3] = if end == End::Return { F::from_f64(-1.0) } else { v[3] };
        for (found, wanted) in found.iter().zip(&v) {
            let same = found.bits() == wanted.bits() || (found.to_f64().is_nan() && wanted.to_f64().is_nan());
            prop_assert!(same, "{:?}: {:?}, wanted {:?}\n{}", s, found, v, text);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, max_shrink_iters: 2000, ..ProptestConfig::default() })]
    #[test]
    fn random_programs_give_what_their_tree_gives(
        body in statements(),
        samples in prop::collection::vec(prop::array::uniform6(prop_oneof![
            3 => (-20i32..20).prop_map(|x| f64::from(x) / 4.0),
            1 => (-9f32..9.0).prop_map(f64::from),
        ]), 1..40),
    ) {
        let mut text = format!("{CALLED}fn shade(s: Sample) -> Medium {{\nvar one = 1.0; var whole = 1;\n");
        (0..VARIABLES).for_each(|i| text.push_str(&format!("var v{i} = 0.0;\n")));
        wgsl(&body, 0, false, &mut text);
        text.push_str("return Medium(vec3(v0, v1, v2), v3);\n}\n");
        check::<f32>(&body, &text, &samples)?;
        check::<f64>(&body, &text, &samples)?;
    }
}
