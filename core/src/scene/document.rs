//! A document as a tree in which every node knows its place: what scene and config files are read
//! from.
//!
//! The syntax is RON: structs with or without a name, tuples, lists, maps, strings (raw ones,
//! too), numbers, `true`, `false`, `Some`, `None`, comments, trailing commas. Byte strings,
//! characters and extension attributes are not part of any document here and are refused. A text
//! that is too long, too deep or has too many parts is refused before it is built.

use super::{
    lexer::{Lexer, Token, show_text},
    problem::{Problem, Spot},
};

/// The longest document in bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// How deep brackets may nest.
pub const MAX_DEPTH: usize = 64;
/// The most values that a document may have.
pub const MAX_NODES: usize = 1 << 18;

/// A value and its place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) spot: Spot,
    pub(crate) kind: Kind,
}

/// The kinds of value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    /// `Name(field: value, …)`; the name may be left out.
    Struct { name: String, fields: Vec<(Spot, String, Node)> },
    /// `Name(value, …)`; the name may be left out. A bare `Name` has no items.
    Tuple { name: String, items: Vec<Node> },
    /// `[value, …]`.
    List(Vec<Node>),
    /// `{key: value, …}`.
    Map(Vec<(Node, Node)>),
    /// A string.
    Text(String),
    /// A number, and its exact value where it was written as a whole one.
    Number { value: f64, whole: Option<i64> },
    /// `true` or `false`.
    Bool(bool),
}

impl Node {
    /// The value as messages show it.
    pub(crate) fn show(&self) -> String {
        let several = |n: usize, one: &str, many: &str| if n == 1 { format!("1 {one}") } else { format!("{n} {many}") };
        match &self.kind {
            Kind::Struct { name, .. } if name.is_empty() => "a struct without a name".into(),
            Kind::Struct { name, .. } => format!("`{name}(…)`"),
            Kind::Tuple { name, items } if name.is_empty() => {
                format!("a tuple of {}", several(items.len(), "value", "values"))
            }
            Kind::Tuple { name, items } if items.is_empty() => format!("`{name}`"),
            Kind::Tuple { name, .. } => format!("`{name}(…)`"),
            Kind::List(items) => format!("a list of {}", several(items.len(), "value", "values")),
            Kind::Map(entries) => format!("a map of {}", several(entries.len(), "entry", "entries")),
            Kind::Text(text) => show_text(text),
            Kind::Number { whole: Some(v), .. } => v.to_string(),
            Kind::Number { value, .. } => format!("{value:?}"),
            Kind::Bool(v) => v.to_string(),
        }
    }

    /// The inside of `Some(…)`; `None` for `None`; itself for everything else.
    pub(crate) fn present(&self) -> Option<&Self> {
        match &self.kind {
            Kind::Tuple { name, items } if name == "None" && items.is_empty() => None,
            Kind::Tuple { name, items } if name == "Some" && items.len() == 1 => items[0].present(),
            _ => Some(self),
        }
    }
}

/// Reads a whole text.
pub(crate) fn parse(text: &str) -> Result<Node, Problem> {
    if text.len() > MAX_BYTES {
        let (found, wanted) = (format!("{} bytes", text.len()), format!("at most {MAX_BYTES} bytes"));
        return Err(Problem::new(Some(Spot::START), "", found, wanted));
    }
    let mut parser = Parser { lexer: Lexer::new(text), ahead: (Spot::START, Token::End), nodes: 0 };
    parser.advance()?;
    let root = parser.value(0)?;
    match parser.ahead.1 {
        Token::End => Ok(root),
        _ => Err(parser.unexpected("the end of the text")),
    }
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    ahead: (Spot, Token),
    nodes: usize,
}

impl Parser<'_> {
    /// Gives the word ahead and reads the next one.
    fn advance(&mut self) -> Result<(Spot, Token), Problem> {
        let next = self.lexer.next()?;
        Ok(std::mem::replace(&mut self.ahead, next))
    }

    fn at(&self, c: char) -> bool {
        self.ahead.1 == Token::Punctuation(c)
    }

    fn unexpected(&self, wanted: &str) -> Problem {
        Problem::new(Some(self.ahead.0), "", self.ahead.1.show(), wanted)
    }

    fn expect(&mut self, c: char, wanted: &str) -> Result<(), Problem> {
        if !self.at(c) {
            return Err(self.unexpected(wanted));
        }
        self.advance().map(|_| ())
    }

    fn value(&mut self, depth: usize) -> Result<Node, Problem> {
        let spot = self.ahead.0;
        self.nodes += 1;
        if depth > MAX_DEPTH || self.nodes > MAX_NODES {
            let (found, wanted) = if depth > MAX_DEPTH {
                (format!("brackets {depth} deep"), format!("at most {MAX_DEPTH}"))
            } else {
                (format!("more than {MAX_NODES} values"), "fewer; large tables belong into files".into())
            };
            return Err(Problem::new(Some(spot), "", found, wanted));
        }
        let kind = match &self.ahead.1 {
            Token::Ident(_) => return self.named(spot, depth),
            Token::Punctuation('(') => self.parenthesis(String::new(), depth)?,
            Token::Punctuation('[') => {
                self.advance()?;
                Kind::List(self.sequence(']', |p| p.value(depth + 1))?)
            }
            Token::Punctuation('{') => {
                self.advance()?;
                Kind::Map(self.sequence('}', |p| p.entry(depth + 1))?)
            }
            Token::Text(_) | Token::Number { .. } => match self.advance()?.1 {
                Token::Text(text) => Kind::Text(text),
                Token::Number { value, whole } => Kind::Number { value, whole },
                _ => unreachable!("the word ahead was a string or a number"),
            },
            _ => return Err(self.unexpected("a value")),
        };
        Ok(Node { spot, kind })
    }

    /// A value that begins with a name.
    fn named(&mut self, spot: Spot, depth: usize) -> Result<Node, Problem> {
        let (_, Token::Ident(name)) = self.advance()? else { unreachable!("the word ahead was a name") };
        let kind = match name.as_str() {
            "true" => Kind::Bool(true),
            "false" => Kind::Bool(false),
            "inf" => Kind::Number { value: f64::INFINITY, whole: None },
            "NaN" => Kind::Number { value: f64::NAN, whole: None },
            _ if self.at('(') => self.parenthesis(name, depth)?,
            _ => Kind::Tuple { name, items: Vec::new() },
        };
        Ok(Node { spot, kind })
    }

    /// A struct or a tuple: what follows the first name decides.
    fn parenthesis(&mut self, name: String, depth: usize) -> Result<Kind, Problem> {
        self.advance()?;
        if !matches!(self.ahead.1, Token::Ident(_)) {
            let items = self.sequence(')', |p| p.value(depth + 1))?;
            return Ok(Kind::Tuple { name, items });
        }
        let first = self.value(depth + 1)?;
        let field = match &first.kind {
            Kind::Tuple { name, items } if items.is_empty() && self.at(':') => name.clone(),
            _ => {
                let mut items = vec![first];
                if !self.at(')') {
                    self.expect(',', "`,` or `)`")?;
                    items.extend(self.sequence(')', |p| p.value(depth + 1))?);
                } else {
                    self.advance()?;
                }
                return Ok(Kind::Tuple { name, items });
            }
        };
        self.advance()?;
        let mut fields = vec![(first.spot, field, self.value(depth + 1)?)];
        if !self.at(')') {
            self.expect(',', "`,` or `)`")?;
            fields.extend(self.sequence(')', |p| p.field(depth + 1))?);
        } else {
            self.advance()?;
        }
        Ok(Kind::Struct { name, fields })
    }

    fn field(&mut self, depth: usize) -> Result<(Spot, String, Node), Problem> {
        if !matches!(self.ahead.1, Token::Ident(_)) {
            return Err(self.unexpected("a field's name"));
        }
        let (spot, Token::Ident(name)) = self.advance()? else { unreachable!("the word ahead was a name") };
        self.expect(':', "`:`")?;
        Ok((spot, name, self.value(depth)?))
    }

    fn entry(&mut self, depth: usize) -> Result<(Node, Node), Problem> {
        let key = self.value(depth)?;
        self.expect(':', "`:`")?;
        Ok((key, self.value(depth)?))
    }

    /// Items up to a closing bracket, with commas between; one may trail.
    fn sequence<T>(
        &mut self,
        end: char,
        mut item: impl FnMut(&mut Self) -> Result<T, Problem>,
    ) -> Result<Vec<T>, Problem> {
        let mut items = Vec::new();
        loop {
            if self.at(end) {
                self.advance()?;
                return Ok(items);
            }
            items.push(item(self)?);
            if !self.at(end) {
                self.expect(',', &format!("`,` or `{end}`"))?;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SAMPLE: &str = r##"// a comment
Scene(version: 1, /* block /* nested */ */ data: {"a": (file: r#"x"y"#, options: {}), },
  shapes: [ (name: "a\n\u{b0}", t: Some((1, -2.5e-3, 0x1F, inf)), n: None, v: View("iso"), k: Nearest, b: true) ],
)"##;

    #[test]
    fn every_node_knows_its_place() {
        let root = parse(SAMPLE).unwrap();
        let Kind::Struct { name, fields } = root.kind else { panic!("a struct") };
        assert_eq!((name.as_str(), root.spot), ("Scene", Spot { line: 2, column: 1 }));
        let places: Vec<_> = fields.iter().map(|(spot, name, node)| (name.as_str(), *spot, node.spot.column)).collect();
        let expected = [("version", 2, 7, 16), ("data", 2, 44, 50), ("shapes", 3, 3, 11)];
        assert_eq!(places, expected.map(|(n, line, column, value)| (n, Spot { line, column }, value)));
    }

    #[test]
    fn syntax_errors_say_what_was_wanted() {
        let error = |text: &str| parse(text).unwrap_err().to_string();
        assert_eq!(error("(a: 1"), "1:6: found the end of the text, wanted `,` or `)`");
        assert_eq!(error("(a: 1 b: 2)"), "1:7: found `b`, wanted `,` or `)`");
        assert_eq!(error("(a: 1, 2)"), "1:8: found 2, wanted a field's name");
        assert_eq!(error("[1, 2]]"), "1:7: found `]`, wanted the end of the text");
        assert_eq!(error("[1,\n \"x]"), "2:2: found a string without an end, wanted a closing quotation mark");
        assert_eq!(error("{\"a\" 1}"), "1:6: found 1, wanted `:`");
        assert_eq!(error("[1.2.3]"), "1:2: found `1.2.3`, wanted a number");
        assert_eq!(error("[2._5]"), "1:2: found `2._5`, wanted a number");
        assert_eq!(error("[-in_f]"), "1:2: found `-in_f`, wanted a number");
        assert_eq!(error("/* x"), "1:1: found a comment without an end, wanted `*/`");
        assert_eq!(error(""), "1:1: found the end of the text, wanted a value");
        assert_eq!(error("[%]"), "1:2: found '%', wanted a value, a name or a bracket");
    }

    #[test]
    fn hostile_texts_end_in_errors() {
        let error = |text: String| parse(&text).unwrap_err().to_string();
        assert_eq!(error("[".repeat(100_000)), "1:66: found brackets 65 deep, wanted at most 64");
        assert_eq!(error("a(".repeat(100_000)), "1:131: found brackets 65 deep, wanted at most 64");
        assert!(error("[0],".repeat(MAX_BYTES)).contains("wanted at most 1048576 bytes"));
        assert!(error(format!("[{}]", "0,".repeat(MAX_NODES))).contains("more than 262144 values"));
        assert!(error("/*".repeat(200_000)).contains("a comment without an end"));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        /// What is accepted here is RON: the `ron` crate accepts it, too, whatever was changed.
        /// (What `Some` and `None` take is not a question of syntax here.)
        #[test]
        fn accepted_texts_are_ron(at in 0..SAMPLE.len(), cut in 0usize..6, insert in "[()\\[\\]{},:a1.\"#rx\\-_eE/* ]{0,4}") {
            let sample = SAMPLE.replace("Some", "Same").replace("None", "Nine");
            let end = (at + cut).min(sample.len());
            let text = format!("{}{insert}{}", &sample[..at], &sample[end..]);
            if parse(&text).is_ok() {
                let judged = ron::from_str::<serde::de::IgnoredAny>(&text);
                prop_assert!(judged.is_ok(), "{text}\n{:?}", judged.err());
            }
        }

        #[test]
        fn any_text_ends(text in ".{0,200}") {
            _ = parse(&text);
        }
    }
}
