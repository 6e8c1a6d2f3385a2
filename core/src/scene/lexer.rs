//! RON's words, with their places in the text.

use super::problem::{Problem, Spot};

/// A word of a text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token {
    /// One of `( ) [ ] { } , :`.
    Punctuation(char),
    /// A name.
    Ident(String),
    /// A string.
    Text(String),
    /// A number, and whether it was written as a whole one.
    Number { value: f64, whole: Option<i64> },
    /// The end of the text.
    End,
}

impl Token {
    /// The word as messages show it.
    pub(crate) fn show(&self) -> String {
        match self {
            Self::Punctuation(c) => format!("`{c}`"),
            Self::Ident(name) => format!("`{name}`"),
            Self::Text(text) => show_text(text),
            Self::Number { whole: Some(v), .. } => v.to_string(),
            Self::Number { value, .. } => format!("{value:?}"),
            Self::End => "the end of the text".into(),
        }
    }
}

/// A string as messages show it: quoted, escaped, not longer than a line.
pub(crate) fn show_text(text: &str) -> String {
    const LONGEST: usize = 60;
    let shown: String = text.chars().take(LONGEST).collect();
    let rest = if shown.len() < text.len() { "…" } else { "" };
    format!("{:?}", shown + rest)
}

/// Reads words one by one.
pub(crate) struct Lexer<'a> {
    rest: &'a str,
    spot: Spot,
}

impl<'a> Lexer<'a> {
    /// Begins at the start of a text; a byte-order mark is skipped.
    pub(crate) fn new(text: &'a str) -> Self {
        Self { rest: text.strip_prefix('\u{feff}').unwrap_or(text), spot: Spot::START }
    }

    /// The next word and where it begins.
    pub(crate) fn next(&mut self) -> Result<(Spot, Token), Problem> {
        self.skip_blank()?;
        let spot = self.spot;
        let Some(c) = self.peek() else { return Ok((spot, Token::End)) };
        let token = match c {
            '(' | ')' | '[' | ']' | '{' | '}' | ',' | ':' => {
                self.bump();
                Token::Punctuation(c)
            }
            '"' => self.string()?,
            'r' if self.rest.starts_with("r\"") || self.rest.starts_with("r#\"") || self.rest.starts_with("r##") => {
                self.raw_string()?
            }
            c if c.is_ascii_digit() || matches!(c, '+' | '-' | '.') => self.number()?,
            c if c.is_alphabetic() || c == '_' => self.ident(),
            c => return Err(Problem::new(Some(spot), "", format!("{c:?}"), "a value, a name or a bracket")),
        };
        Ok((spot, token))
    }

    fn peek(&self) -> Option<char> {
        self.rest.chars().next()
    }

    fn bump(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.rest = &self.rest[c.len_utf8()..];
        if c == '\n' {
            self.spot = Spot { line: self.spot.line.saturating_add(1), column: 1 };
        } else {
            self.spot.column = self.spot.column.saturating_add(1);
        }
        Some(c)
    }

    fn take(&mut self, wanted: impl Fn(char) -> bool) -> &'a str {
        let all = self.rest;
        while self.peek().is_some_and(&wanted) {
            self.bump();
        }
        &all[..all.len() - self.rest.len()]
    }

    /// Skips white space and comments; block comments nest, as in RON.
    fn skip_blank(&mut self) -> Result<(), Problem> {
        loop {
            self.take(char::is_whitespace);
            if self.rest.starts_with("//") {
                self.take(|c| c != '\n');
            } else if self.rest.starts_with("/*") {
                self.block_comment()?;
            } else {
                return Ok(());
            }
        }
    }

    fn block_comment(&mut self) -> Result<(), Problem> {
        let start = self.spot;
        let mut open = 0usize;
        loop {
            if self.rest.starts_with("/*") {
                open += 1;
                self.bump();
            } else if self.rest.starts_with("*/") {
                open -= 1;
                self.bump();
            }
            if self.bump().is_none() {
                return Err(Problem::new(Some(start), "", "a comment without an end", "`*/`"));
            }
            if open == 0 {
                return Ok(());
            }
        }
    }

    fn ident(&mut self) -> Token {
        Token::Ident(self.take(|c| c.is_alphanumeric() || c == '_').to_owned())
    }

    fn string(&mut self) -> Result<Token, Problem> {
        let start = self.spot;
        self.bump();
        let mut text = String::new();
        loop {
            match self.bump() {
                Some('"') => return Ok(Token::Text(text)),
                Some('\\') => text.extend(self.escape()?),
                Some(c) => text.push(c),
                None => return Err(unclosed(start)),
            }
        }
    }

    /// What follows a backslash; `None` for a line break that is taken away with its indentation.
    fn escape(&mut self) -> Result<Option<char>, Problem> {
        let spot = self.spot;
        let c = self.bump();
        Ok(Some(match c {
            Some('n') => '\n',
            Some('r') => '\r',
            Some('t') => '\t',
            Some('0') => '\0',
            Some(c @ ('\\' | '"' | '\'')) => c,
            Some('x') => {
                let digits = self.rest.get(..2).filter(|d| d.chars().all(|c| c.is_ascii_hexdigit()));
                let code = digits.and_then(|d| u8::from_str_radix(d, 16).ok()).filter(u8::is_ascii);
                let c = code.ok_or_else(|| Problem::new(Some(spot), "", "`\\x`", "two hexadecimal digits up to 7F"))?;
                self.bump();
                self.bump();
                char::from(c)
            }
            Some('u') => self.unicode(spot)?,
            other => {
                let found = other.map_or("the end of the text".into(), |c| format!("`\\{}`", c.escape_debug()));
                return Err(Problem::new(Some(spot), "", found, "an escape: \\n \\r \\t \\0 \\\\ \\\" \\xHH \\u{H…}"));
            }
        }))
    }

    fn unicode(&mut self, spot: Spot) -> Result<char, Problem> {
        let wrong = || Problem::new(Some(spot), "", "`\\u`", "a character's number in braces, like \\u{b0}");
        if self.bump() != Some('{') {
            return Err(wrong());
        }
        let digits = self.take(|c| c.is_ascii_hexdigit());
        let code = u32::from_str_radix(digits, 16).ok().and_then(char::from_u32);
        if self.bump() != Some('}') {
            return Err(wrong());
        }
        code.ok_or_else(wrong)
    }

    fn raw_string(&mut self) -> Result<Token, Problem> {
        let start = self.spot;
        self.bump();
        let fence = self.take(|c| c == '#').len();
        if self.bump() != Some('"') {
            return Err(Problem::new(Some(start), "", "`r#`", "a raw string like r#\"…\"#"));
        }
        let end = format!("\"{}", "#".repeat(fence));
        let Some(length) = self.rest.find(&end) else { return Err(unclosed(start)) };
        let text = self.rest[..length].to_owned();
        let stop = self.rest.len() - length - end.len();
        while self.rest.len() > stop {
            self.bump();
        }
        Ok(Token::Text(text))
    }

    /// Decimal, `0x`, `0o` and `0b` numbers with `_` between digits.
    fn number(&mut self) -> Result<Token, Problem> {
        let start = self.spot;
        let mut word = self.take(|c| matches!(c, '+' | '-')).to_owned();
        loop {
            word.push_str(self.take(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '.')));
            let exponent = !radix(&word).1 && word.ends_with(['e', 'E']);
            if !(exponent && self.peek().is_some_and(|c| matches!(c, '+' | '-'))) {
                break;
            }
            word.extend(self.bump());
        }
        let wanted = "a number";
        read_number(&word).ok_or_else(|| Problem::new(Some(start), "", show_text(&word).replace('"', "`"), wanted))
    }
}

fn unclosed(start: Spot) -> Problem {
    Problem::new(Some(start), "", "a string without an end", "a closing quotation mark")
}

/// Digits after sign and prefix, and whether they are of another base than ten.
fn radix(word: &str) -> ((u32, &str), bool) {
    let digits = word.trim_start_matches(['+', '-']);
    for (prefix, base) in [("0x", 16), ("0o", 8), ("0b", 2)] {
        if let Some(rest) = digits.strip_prefix(prefix) {
            return ((base, rest), true);
        }
    }
    ((10, digits), false)
}

fn read_number(word: &str) -> Option<Token> {
    let sign = match word.strip_suffix(word.trim_start_matches(['+', '-']))? {
        "" | "+" => "",
        "-" => "-",
        _ => return None,
    };
    let ((base, digits), based) = radix(word);
    // As RON has it: underscores come after a digit or an exponent's letter, not after a point.
    if digits.starts_with('_') || digits.contains("._") {
        return None;
    }
    if !based && (digits == "inf" || digits == "NaN") {
        return Some(Token::Number { value: format!("{sign}{digits}").parse().ok()?, whole: None });
    }
    let digits = digits.replace('_', "");
    if !based && !digits.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return None;
    }
    let whole = i64::from_str_radix(&format!("{sign}{digits}"), base).ok();
    let value = match (whole, based) {
        (Some(v), _) => v as f64,
        (None, true) => return None,
        (None, false) => format!("{sign}{digits}").parse().ok()?,
    };
    Some(Token::Number { value, whole })
}
