//! What a shader may not have, found in its words before a parser sees it.
//!
//! All of these come at once, each with its place. What is refused here, and why, stands in
//! `docs/shaders.md` under "What is refused".

use volact_core::names::nearest;

use crate::{
    error::SourceError,
    signatures::{FRAMEWORK, RESERVED_PREFIX},
    tokens::{Kind, Token, tokens},
};

/// The longest text in bytes.
pub const MAX_TEXT: usize = 64 << 10;
/// How deep brackets may nest.
pub const MAX_DEPTH: usize = 64;
/// The most operators in a row, without a bracket or comma between.
pub const MAX_CHAIN: usize = 512;
/// The most `else` in a shader.
pub const MAX_ELSE: usize = 256;
/// Errors listed of one text.
const MAX_ERRORS: usize = 50;

/// Built-in functions and types that a shading function has no use for, by how they begin.
const REFUSED: &[(&[&str], &str)] = &[
    (&["texture", "sampler"], "textures are read through the functions of volume and table parameters"),
    (&["atomic"], "samples share no memory"),
    (&["dpdx", "dpdy", "fwidth"], "a sample has no neighbours on the screen"),
    (&["storageBarrier", "textureBarrier", "workgroupBarrier", "workgroupUniformLoad"], "samples share no memory"),
    (&["subgroup", "quadBroadcast", "quadSwap"], "samples share no group"),
    (
        &["pack2x", "pack4x", "unpack2x", "unpack4x", "dot4I8", "dot4U8", "quantizeToF16"],
        "packed numbers are not supported",
    ),
    (&["arrayLength", "binding_array"], "arrays have a fixed length"),
    (&["RayDesc", "RayIntersection", "acceleration_structure", "ray_query", "rayQuery", "coop"], "not supported"),
];

/// Types of other widths than 32 bits.
const WIDTHS: &[&str] = &["f16", "f64", "i16", "u16", "i64", "u64"];

/// Everything in a text that is refused. `taken` are the names of parameters' functions, with the
/// parameter's name.
pub fn refuse(text: &str, taken: &[(String, String)]) -> Vec<SourceError> {
    if text.len() > MAX_TEXT {
        let message = format!("{} bytes of text, wanted at most {MAX_TEXT}", text.len());
        return vec![SourceError::whole(message)];
    }
    let tokens = tokens(text);
    let mut errors = Vec::new();
    for (i, token) in tokens.iter().enumerate() {
        let before = i.checked_sub(1).map(|i| &tokens[i]);
        let word = &text[token.range.clone()];
        errors.extend(match token.kind {
            Kind::Sign('@') => attribute(text, token, tokens.get(i + 1)),
            Kind::Word if before.is_some_and(|t| t.is('.') || t.is('@')) => None,
            Kind::Word => global(token, word, tokens.get(i + 1), tokens.get(i + 2), text)
                .or_else(|| unsupported(token, word))
                .or_else(|| declared(text, &tokens, i).and_then(|global| name(token, word, global, taken))),
            _ => None,
        });
    }
    errors.extend(size(&tokens, text));
    errors.truncate(MAX_ERRORS);
    errors
}

/// What may not stand outside functions.
fn global(token: &Token, word: &str, next: Option<&Token>, after: Option<&Token>, text: &str) -> Option<SourceError> {
    let at = |message: &str| Some(SourceError::at(token.range.clone(), message));
    let space = || after.filter(|_| next.is_some_and(|n| n.is('<'))).map_or("", |t| &text[t.range.clone()]);
    match word {
        "discard" => at("`discard`: a sample is left out by an extinction of 0"),
        _ if token.depth > 0 => None,
        "enable" | "requires" | "diagnostic" => {
            at(&format!("directive `{word}`: a shader is plain WGSL without extensions"))
        }
        "override" => at("`override`: a parameter of the declaration does this, as a function of its name"),
        "var" => match space() {
            "private" => at("a private variable: nothing is kept from sample to sample"),
            "workgroup" => at("a workgroup variable: samples share no memory"),
            _ => at("a binding: data comes through the functions of declared parameters"),
        },
        _ => None,
    }
}

fn attribute(text: &str, token: &Token, next: Option<&Token>) -> Option<SourceError> {
    let name = next.filter(|t| t.kind == Kind::Word)?;
    let range = token.range.start..name.range.end;
    let message = match &text[name.range.clone()] {
        "must_use" => return None,
        word @ ("vertex" | "fragment" | "compute" | "workgroup_size" | "mesh" | "task") => {
            format!("`@{word}`: a shader has no entry point of its own; the framework calls `shade`")
        }
        word @ ("group" | "binding") => {
            format!("`@{word}`: a binding; data comes through the functions of declared parameters")
        }
        word => format!("attribute `@{word}` has no meaning in a shader"),
    };
    Some(SourceError::at(range, message))
}

fn unsupported(token: &Token, word: &str) -> Option<SourceError> {
    let refused = |why: &str| Some(SourceError::at(token.range.clone(), format!("`{word}` is not for shaders: {why}")));
    if let Some((_, why)) =
        REFUSED.iter().find(|(begin, _)| begin.iter().any(|b| word.starts_with(b)) && built_in(word))
    {
        return refused(why);
    }
    let half = (word.starts_with("vec") || word.starts_with("mat")) && word.ends_with('h') && word.len() <= 7;
    if WIDTHS.contains(&word) || (half && word.contains(|c: char| c.is_ascii_digit())) {
        return refused("numbers are f32, i32, u32 or bool");
    }
    None
}

/// Whether WGSL or naga has something of that name.
pub fn built_in(word: &str) -> bool {
    let more = ["RayDesc", "RayIntersection", "acceleration_structure", "ray_query", "binding_array"];
    let alias = word
        .strip_suffix(['f', 'i', 'u', 'h'])
        .is_some_and(|stem| stem.len() <= 6 && (stem.starts_with("vec") || stem.starts_with("mat")) && built_in(stem));
    naga::keywords::wgsl::BUILTIN_IDENTIFIERS.contains(&word)
        || more.contains(&word)
        || word.starts_with("rayQuery")
        || word.starts_with("coop")
        || alias
}

/// Whether the word at `i` is the name of something declared there, and whether that is global.
fn declared(text: &str, tokens: &[Token], i: usize) -> Option<bool> {
    let global = tokens[i].depth == 0;
    let mut at = i.checked_sub(1)?;
    // Past the address space of `var<…>`; other `>` end arrows, types and comparisons.
    if tokens[at].is('>') {
        let open = tokens[..at].iter().rposition(|t| t.kind != Kind::Word && !t.is(','))?;
        at = open.checked_sub(1).filter(|_| tokens[open].is('<'))?;
        return (&text[tokens[at].range.clone()] == "var").then_some(global);
    }
    match &text[tokens[at].range.clone()] {
        "fn" | "struct" | "alias" => Some(true),
        "let" | "var" | "const" => Some(global),
        // An argument of a function: `name:` outside of braces.
        "(" | "," if global && tokens.get(i + 1).is_some_and(|t| t.is(':')) => Some(false),
        _ => None,
    }
}

fn name(token: &Token, word: &str, global: bool, taken: &[(String, String)]) -> Option<SourceError> {
    let at = |message: String| Some(SourceError::at(token.range.clone(), message));
    if let Some((_, parameter)) = taken.iter().find(|(name, _)| name == word) {
        return at(format!("`{word}` would hide the function of that name of the parameter `{parameter}`"));
    }
    if FRAMEWORK.contains(&word) {
        return at(format!("`{word}` would hide what the framework calls so"));
    }
    if word.starts_with(RESERVED_PREFIX) {
        return at(format!("`{word}`: names that begin with `{RESERVED_PREFIX}` are the framework's"));
    }
    if global && built_in(word) {
        return at(format!("`{word}` would hide what WGSL itself calls so"));
    }
    None
}

/// Texts on which a parser would nest too deep.
fn size(tokens: &[Token], text: &str) -> Option<SourceError> {
    let mut chains = vec![0usize];
    let mut other = 0;
    for token in tokens {
        match token.kind {
            Kind::Sign('(' | '[' | '{') => {
                *chains.last_mut()? += 1;
                chains.push(0);
            }
            Kind::Sign(')' | ']' | '}') if chains.len() > 1 => _ = chains.pop(),
            Kind::Sign(',' | ';' | '}') => *chains.last_mut()? = 0,
            Kind::Sign(_) => *chains.last_mut()? += 1,
            Kind::Word if &text[token.range.clone()] == "else" => other += 1,
            _ => {}
        }
        if token.is('}') {
            *chains.last_mut()? = 0;
        }
        let at = |message: String| Some(SourceError::at(token.range.clone(), message));
        if chains.len() > MAX_DEPTH {
            return at(format!("brackets nest deeper than {MAX_DEPTH}"));
        }
        if chains.last().is_some_and(|n| *n > MAX_CHAIN) {
            return at(format!("more than {MAX_CHAIN} operators in a row; use a few `let`"));
        }
        if other > MAX_ELSE {
            return at(format!("more than {MAX_ELSE} `else`"));
        }
    }
    None
}

/// Why a parameter's function cannot have a name, if so.
pub fn bad_name(name: &str) -> Option<String> {
    let first = |c: char| c == '_' || c.is_ascii_alphabetic();
    if !name.starts_with(first) || !name.chars().all(|c| first(c) || c.is_ascii_digit()) {
        return Some("a WGSL identifier: letters, digits and '_', not beginning with a digit".into());
    }
    if name == "_" || name.starts_with("__") {
        return Some("a WGSL identifier: neither `_` alone nor two at the beginning".into());
    }
    if naga::keywords::wgsl::RESERVED.contains(&name) {
        return Some(format!("another name: `{name}` is a reserved word of WGSL"));
    }
    if built_in(name) {
        return Some(format!("another name: `{name}` is a built-in function or type of WGSL"));
    }
    if FRAMEWORK.contains(&name) || ["shade", "shade_segment", "value"].contains(&name) {
        return Some(format!("another name: `{name}` is a name of the framework"));
    }
    name.starts_with(RESERVED_PREFIX).then(|| format!("another name: `{RESERVED_PREFIX}…` are the framework's"))
}

/// The functions that a text declares, with the places of their names.
pub fn functions(text: &str) -> Vec<(&str, std::ops::Range<usize>)> {
    let tokens = tokens(text);
    let declared = tokens.windows(2).filter(|w| &text[w[0].range.clone()] == "fn" && w[1].kind == Kind::Word);
    declared.map(|w| (&text[w[1].range.clone()], w[1].range.clone())).collect()
}

/// Whether a text declares a function of that name, or of one so near that it may be meant.
pub fn has_function_like(text: &str, name: &str) -> bool {
    nearest(name, functions(text).iter().map(|(own, _)| *own)).is_some()
}

/// The error of a function that must be there and is not.
pub fn missing(text: &str, function: &str, signature: &str) -> SourceError {
    let functions = functions(text);
    let message = format!("no function `{function}`, wanted `{signature}`");
    let near = nearest(function, functions.iter().map(|(name, _)| *name));
    match near.and_then(|near| functions.iter().find(|(name, _)| *name == near)) {
        Some((near, range)) => SourceError::at(range.clone(), format!("{message}; is it `{near}`?")),
        None => SourceError::whole(message),
    }
}
