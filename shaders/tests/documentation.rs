//! `docs/shaders.md` says what the code does.

use volact_core::{Compositing, Declaration, ParameterDecl, ParameterType, ShaderFile, ShaderText, parameter::Kind};
use volact_shaders::{
    signatures::{SIGNATURES, prelude},
    source::with_source,
};

const TEXT: &str = include_str!("../../docs/shaders.md");

/// The table of functions; with `VOLACT_BLESS` set, what should stand there is printed.
#[test]
fn all_functions_of_parameters_are_listed() {
    let rows: Vec<String> = SIGNATURES
        .iter()
        .map(|s| {
            let of = s.of.map_or("any that is neither required nor has a default".into(), |kind| kind.to_string());
            let text: String = s.text.split_whitespace().collect::<Vec<_>>().join(" ");
            format!("| {of} | `NAME{}({}) -> {}` | {text} |", s.ending, s.arguments, s.result)
        })
        .collect();
    if std::env::var_os("VOLACT_BLESS").is_some() {
        println!("{}", rows.join("\n"));
    }
    for row in rows {
        assert!(TEXT.contains(&row), "docs/shaders.md lacks\n{row}");
    }
}

#[test]
fn the_example_is_right() {
    let block = |language: &str| {
        let (_, rest) = TEXT.split_once(&format!("```{language}\n")).unwrap();
        rest.split_once("```").unwrap().0
    };
    let file = ShaderFile::parse("glow", block("ron")).unwrap();
    let source = ShaderText { file: "glow.wgsl".into(), text: block("wgsl").into() };
    with_source(&file, "glow.ron", source).unwrap_or_else(|error| panic!("{error}"));
}

/// The members of `Sample` and `Medium` in the prelude are those that the text shows.
#[test]
fn the_structs_are_shown_as_they_are() {
    let declaration = Declaration::new(Kind::Shader, "x", "0", "x")
        .with(ParameterDecl::new("unit_distance", ParameterType::Float, "u").required());
    for line in prelude(&declaration, Compositing::Over).lines().filter(|line| line.starts_with("struct")) {
        let members = line.split(['{', '}']).nth(1).unwrap();
        let (mut depth, mut member) = (0, String::new());
        for c in members.chars().chain([',']) {
            depth += i32::from(c == '<') - i32::from(c == '>');
            if c == ',' && depth == 0 {
                assert!(TEXT.contains(&format!("    {},", member.trim())), "{member}");
                member.clear();
            } else {
                member.push(c);
            }
        }
    }
}
