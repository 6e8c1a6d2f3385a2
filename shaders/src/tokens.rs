//! Words, numbers and signs of a WGSL text with their places: as much syntax as the refusals need
//! that must come before a parser sees the text.

use std::ops::Range;

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A name or keyword.
    Word,
    /// A number.
    Number,
    /// Any other character.
    Sign(char),
}

/// A token.
#[derive(Clone, Debug, PartialEq)]
pub struct Token {
    /// What it is.
    pub kind: Kind,
    /// Its bytes in the text.
    pub range: Range<usize>,
    /// How many braces are open around it.
    pub depth: usize,
}

impl Token {
    /// Whether it is this sign.
    pub fn is(&self, sign: char) -> bool {
        self.kind == Kind::Sign(sign)
    }
}

/// All tokens of a text; comments and blanks are left out.
pub fn tokens(text: &str) -> Vec<Token> {
    let mut list = Vec::new();
    let (mut at, mut depth) = (0, 0usize);
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let (kind, length) = if rest.starts_with("//") || rest.starts_with("/*") {
            (None, comment(rest))
        } else if c.is_whitespace() {
            (None, c.len_utf8())
        } else if c.is_ascii_digit() || (c == '.' && rest[1..].starts_with(|c: char| c.is_ascii_digit())) {
            (Some(Kind::Number), number(rest))
        } else if word(c) {
            (Some(Kind::Word), rest.find(|c| !word(c)).unwrap_or(rest.len()))
        } else {
            (Some(Kind::Sign(c)), c.len_utf8())
        };
        depth -= usize::from(c == '}' && kind.is_some() && depth > 0);
        list.extend(kind.map(|kind| Token { kind, range: at..at + length, depth }));
        depth += usize::from(c == '{' && kind.is_some());
        at += length;
    }
    list
}

fn word(c: char) -> bool {
    c == '_' || c.is_alphanumeric()
}

/// Length of a number; `1e-5` is one, `1-5` is not.
fn number(rest: &str) -> usize {
    let hexadecimal = rest.starts_with("0x") || rest.starts_with("0X");
    let mut before = ' ';
    let part = |c: char| {
        let exponent = if hexadecimal { matches!(before, 'p' | 'P') } else { matches!(before, 'e' | 'E') };
        before = c;
        c.is_ascii_alphanumeric() || c == '.' || (exponent && matches!(c, '+' | '-'))
    };
    let mut part = part;
    rest.find(|c| !part(c)).unwrap_or(rest.len())
}

/// Length of a comment; block comments nest.
fn comment(rest: &str) -> usize {
    if rest.starts_with("//") {
        return rest.find('\n').unwrap_or(rest.len());
    }
    let (mut at, mut open) = (2, 1);
    while open > 0 {
        let next = ["/*", "*/"].iter().filter_map(|s| rest[at..].find(s).map(|i| (i, *s))).min();
        match next {
            Some((i, sign)) => {
                at += i + 2;
                open = if sign == "/*" { open + 1 } else { open - 1 };
            }
            None => return rest.len(),
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<&str> {
        tokens(text).into_iter().map(|t| &text[t.range]).collect()
    }

    #[test]
    fn comments_are_left_out() {
        assert_eq!(words("a/* b /* c */ d */e // f\n g /* h"), ["a", "e", "g"]);
    }

    #[test]
    fn numbers_are_whole() {
        assert_eq!(words("x1+1.5e-3f-0x1p+2+.5-1"), ["x1", "+", "1.5e-3f", "-", "0x1p+2", "+", ".5", "-", "1"]);
    }

    #[test]
    fn depth_counts_braces() {
        let depths: Vec<_> = tokens("a{b{}c}d}e").iter().map(|t| t.depth).collect();
        assert_eq!(depths, [0, 0, 1, 1, 1, 1, 0, 0, 0, 0]);
    }
}
