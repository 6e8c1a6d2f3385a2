//! Decoders of what a part of a file holds: compressed bytes, numbers as text, hexadecimal digits.

use std::io::{self, BufRead, Read};

use volact_core::ScalarType;

use crate::payload::Encoding;

/// A decoder over encoded bytes.
pub(crate) fn decoder(encoding: Encoding, input: impl BufRead + Send + 'static) -> Box<dyn Read + Send> {
    match encoding {
        Encoding::Raw => Box::new(input),
        Encoding::Gzip => Box::new(flate2::bufread::MultiGzDecoder::new(input)),
        Encoding::Zlib => Box::new(flate2::bufread::ZlibDecoder::new(input)),
        Encoding::Bzip2 => Box::new(bzip2::bufread::MultiBzDecoder::new(input)),
        Encoding::Ascii(scalar) => Box::new(AsciiNumbers { input, scalar, count: 0, pending: Vec::new() }),
        Encoding::Hex => Box::new(HexBytes { input }),
    }
}

/// Numbers as text, separated by white space or commas, as native bytes.
struct AsciiNumbers<R> {
    input: R,
    scalar: ScalarType,
    count: u64,
    pending: Vec<u8>,
}

impl<R: BufRead> AsciiNumbers<R> {
    fn next_word(&mut self) -> io::Result<Option<String>> {
        let mut word = String::new();
        while let Some(&byte) = self.input.fill_buf()?.first() {
            self.input.consume(1);
            if !(byte.is_ascii_whitespace() || byte == b',') {
                word.push(char::from(byte));
                if word.len() > 64 {
                    return Err(bad_number(self.count, &word, "a number of at most 64 characters"));
                }
            } else if !word.is_empty() {
                break;
            }
        }
        Ok((!word.is_empty()).then_some(word))
    }
}

fn bad_number(index: u64, word: &str, wanted: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("number {index} is {word:?}, wanted {wanted}"))
}

/// Appends a number given as text to `out` in native byte order.
pub(crate) fn parse_number(word: &str, scalar: ScalarType, out: &mut Vec<u8>) -> bool {
    macro_rules! put {
        ($t:ty) => {
            word.parse::<$t>().map(|v| out.extend_from_slice(&v.to_ne_bytes())).is_ok()
        };
    }
    match scalar {
        ScalarType::U8 => put!(u8),
        ScalarType::I8 => put!(i8),
        ScalarType::U16 => put!(u16),
        ScalarType::I16 => put!(i16),
        ScalarType::U32 => put!(u32),
        ScalarType::I32 => put!(i32),
        ScalarType::F16 => word.parse().map(|v| out.extend_from_slice(&half::f16::from_f64(v).to_ne_bytes())).is_ok(),
        ScalarType::F32 => put!(f32),
        ScalarType::F64 => put!(f64),
    }
}

impl<R: BufRead> Read for AsciiNumbers<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.pending.len() < out.len().min(4096) {
            let Some(word) = self.next_word()? else { break };
            if !parse_number(&word, self.scalar, &mut self.pending) {
                return Err(bad_number(self.count, &word, &format!("a number of type {}", self.scalar)));
            }
            self.count += 1;
        }
        let n = self.pending.len().min(out.len());
        out[..n].copy_from_slice(&self.pending[..n]);
        self.pending.drain(..n);
        Ok(n)
    }
}

/// Bytes as pairs of hexadecimal digits, white space between them left out.
struct HexBytes<R> {
    input: R,
}

impl<R: BufRead> HexBytes<R> {
    fn digit(&mut self) -> io::Result<Option<u8>> {
        loop {
            let Some(&byte) = self.input.fill_buf()?.first() else { return Ok(None) };
            self.input.consume(1);
            match char::from(byte).to_digit(16) {
                Some(digit) => return Ok(Some(digit as u8)),
                None if byte.is_ascii_whitespace() => {}
                None => {
                    let message = format!("{:?} is no hexadecimal digit", char::from(byte));
                    return Err(io::Error::new(io::ErrorKind::InvalidData, message));
                }
            }
        }
    }
}

impl<R: BufRead> Read for HexBytes<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        for (n, byte) in out.iter_mut().enumerate() {
            let Some(high) = self.digit()? else { return Ok(n) };
            let Some(low) = self.digit()? else { return Err(io::ErrorKind::UnexpectedEof.into()) };
            *byte = high << 4 | low;
        }
        Ok(out.len())
    }
}
