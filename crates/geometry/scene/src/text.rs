//! Text files as logical lines, for both OBJ and MTL.
//!
//! A logical line is never empty. It has no byte order mark, no line end, no surrounding spaces,
//! and no continuation. Its number is that of its first physical line, counted from 1.

use crate::SceneError;
use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads a text file of at most `limit` bytes: UTF-8, or UTF-16 with or without a byte order mark.
/// Bytes that are neither (such as old comments) become U+FFFD.
pub(crate) fn read_text(path: &Path, limit: u64) -> Result<String, SceneError> {
    let io = |source| SceneError::Io { path: path.to_owned(), source };
    let file = File::open(path).map_err(io)?;
    let announced = file.metadata().map_err(io)?.len();
    let too_large = || SceneError::FileTooLarge { path: path.to_owned(), limit };
    if announced > limit {
        return Err(too_large());
    }
    let mut bytes = Vec::with_capacity(announced as usize + 1);
    // A pipe states no length, and a file may grow, so the limit applies to what is read.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > limit {
        return Err(too_large());
    }
    if let Some(text) = utf16(&bytes) {
        return Ok(text);
    }
    Ok(String::from_utf8(bytes)
        .unwrap_or_else(|bad| String::from_utf8_lossy(bad.as_bytes()).into_owned()))
}

/// Returns how two bytes make a unit of UTF-16, if the text is UTF-16.
fn utf16_unit(bytes: &[u8]) -> Option<fn([u8; 2]) -> u16> {
    match *bytes {
        [0xff, 0xfe, ..] => Some(u16::from_le_bytes),
        [0xfe, 0xff, ..] => Some(u16::from_be_bytes),
        // Without a mark: plain text in UTF-8 has no zero bytes.
        [a, 0, b, 0, ..] if a != 0 && b != 0 => Some(u16::from_le_bytes),
        [0, a, 0, b, ..] if a != 0 && b != 0 => Some(u16::from_be_bytes),
        _ => None,
    }
}

/// Iterates over the logical lines of `text` with their numbers.
pub(crate) fn logical_lines(text: &str) -> LogicalLines<'_> {
    LogicalLines { rest: text.strip_prefix('\u{feff}').unwrap_or(text), line: 0 }
}

pub(crate) struct LogicalLines<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> LogicalLines<'a> {
    /// Returns the number of bytes that are still to be read.
    pub(crate) fn left(&self) -> usize {
        self.rest.len()
    }

    /// Returns the next physical line; it may end with LF, CR LF or CR.
    fn physical(&mut self) -> Option<&'a str> {
        if self.rest.is_empty() {
            return None;
        }
        self.line += 1;
        let bytes = self.rest.as_bytes();
        let end = bytes.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(bytes.len());
        let after =
            if bytes[end..].starts_with(b"\r\n") { end + 2 } else { (end + 1).min(bytes.len()) };
        let line = &self.rest[..end];
        self.rest = &self.rest[after..];
        Some(line.trim_ascii())
    }
}

impl<'a> Iterator for LogicalLines<'a> {
    type Item = (usize, Cow<'a, str>);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let first = self.physical()?;
            let number = self.line;
            if first.is_empty() || first.starts_with('#') {
                continue;
            }
            let Some(mut head) = continued(first) else {
                return Some((number, Cow::Borrowed(first)));
            };
            let mut whole = String::new();
            loop {
                whole.push_str(head);
                whole.push(' ');
                let next = self.physical().unwrap_or("");
                match continued(next) {
                    Some(more) => head = more,
                    None => {
                        whole.push_str(next);
                        break;
                    }
                }
            }
            if !whole.trim_ascii().is_empty() {
                return Some((number, Cow::Owned(whole.trim_ascii().to_owned())));
            }
        }
    }
}

/// Returns the text before a backslash that continues the line. A comment does not continue: "#
/// C:\models\" is common.
fn continued(line: &str) -> Option<&str> {
    line.strip_suffix('\\').filter(|head| !head.contains('#'))
}

/// Returns the keyword of a line, and the rest.
pub(crate) fn keyword(line: &str) -> (&str, &str) {
    match line.split_once(|c: char| c.is_ascii_whitespace()) {
        Some((keyword, rest)) => (keyword, rest.trim_ascii_start()),
        None => (line, ""),
    }
}

/// Returns the text before a comment.
pub(crate) fn without_comment(text: &str) -> &str {
    text.split_once('#').map_or(text, |(before, _)| before.trim_ascii_end())
}

/// Returns a name without its comment. Names may contain "#" ("Material #25"), so a comment after a
/// name begins with " # ".
pub(crate) fn name_without_comment(name: &str) -> &str {
    name.split_once(" # ").map_or(name, |(before, _)| before.trim_ascii_end())
}

/// Parses a finite number.
pub(crate) fn number(token: &str) -> Option<f64> {
    token.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Parses a finite number that some exporters write, but Rust does not accept. Examples are
/// `3.1+e2` (the sign before the exponent), `1.5d3` (Fortran), `1,5` (a decimal comma) and `1.5f`.
pub(crate) fn loose_number(token: &str) -> Option<f64> {
    if let Some(number) = number(token) {
        return Some(number);
    }
    if !token.is_ascii() || token.len() > 64 {
        return None;
    }
    let mut plain = token.to_ascii_lowercase().replace(',', ".").replace('d', "e");
    for sign in ["+e", "-e"] {
        if let Some((whole, exponent)) = plain.split_once(sign) {
            plain = format!("{whole}e{}{exponent}", &sign[..1]);
        }
    }
    let plain = plain.strip_suffix('f').unwrap_or(&plain);
    let looks_numeric = plain.bytes().all(|b| b.is_ascii_digit() || b"+-.e".contains(&b));
    number(plain).filter(|_| looks_numeric)
}

/// Returns at most the first few dozen characters of a text, for messages.
pub(crate) fn excerpt(text: &str) -> String {
    const SHOWN: usize = 40;
    if text.chars().nth(SHOWN).is_none() {
        return printable(text);
    }
    printable(text).chars().take(SHOWN).chain(['…']).collect()
}

/// Returns a text without characters that would move the cursor, change colours or turn the order
/// of letters on a terminal. It is no longer than before.
pub(crate) fn printable(text: &str) -> String {
    let character = |c: char| match c {
        '\t' | '\n' | '\r' => ' ',
        '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => '?',
        c if c.is_control() => '?',
        c => c,
    };
    text.chars().map(character).collect()
}

/// Returns the text of bytes in UTF-16, if they are that.
pub(crate) fn utf16(bytes: &[u8]) -> Option<String> {
    let unit = utf16_unit(bytes)?;
    let (pairs, _) = bytes.as_chunks::<2>();
    let units = char::decode_utf16(pairs.iter().map(|pair| unit(*pair)));
    Some(units.map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER)).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<(usize, String)> {
        logical_lines(text).map(|(line, text)| (line, text.into_owned())).collect()
    }

    #[test]
    fn line_ends_comments_spaces_and_the_byte_order_mark_are_removed() {
        let expected = vec![(2, "v 1 2 3".to_owned()), (4, "f 1 2 3".to_owned())];
        for end in ["\n", "\r\n", "\r"] {
            let text = ["\u{feff}# a comment", "  v 1 2 3\t ", "", "f 1 2 3"].join(end);
            assert_eq!(lines(&text), expected);
            assert_eq!(lines(&(text + end)), expected);
        }
    }

    #[test]
    fn texts_for_people_do_not_steer_a_terminal() {
        assert_eq!(printable("a\u{1b}[31mb\n\u{202e}é"), "a?[31mb ?é");
        assert_eq!(excerpt("\0"), "?");
        assert_eq!(excerpt(&"ab".repeat(40)).chars().count(), 41);
    }

    #[test]
    fn numbers_are_read_as_exporters_write_them() {
        for (token, value) in [
            ("3.1+e2", 310.0),
            ("3.1-e2", 0.031),
            ("1.5d3", 1500.0),
            ("1,5", 1.5),
            ("1.5f", 1.5),
            ("+2", 2.0),
            (".5", 0.5),
        ] {
            assert_eq!(loose_number(token), Some(value), "{token}");
        }
        for token in ["nan", "inf", "1e999", "x", "", "1.#IND", "1,2,3", "--1", "infinity"] {
            assert_eq!(loose_number(token), None, "{token}");
        }
    }

    #[test]
    fn utf16_is_read_in_either_order_with_and_without_a_mark() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t");
        let text = "v 1 2 3\nusemtl grün";
        for big in [false, true] {
            for mark in ["", "\u{feff}"] {
                let units = (mark.to_owned() + text).encode_utf16().collect::<Vec<_>>();
                let bytes = |unit: &u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
                std::fs::write(&path, units.iter().flat_map(bytes).collect::<Vec<u8>>()).unwrap();
                let read = read_text(&path, 1000).unwrap();
                assert_eq!(read.strip_prefix(mark), Some(text));
            }
        }
    }

    #[test]
    fn a_backslash_continues_a_line_but_not_a_comment() {
        assert_eq!(
            lines("f 1 \\\n 2 \\\r\n 3\nv"),
            [(1, "f 1  2  3".to_owned()), (4, "v".to_owned())]
        );
        assert_eq!(lines("# C:\\\nv\nf \\"), [(2, "v".to_owned()), (3, "f".to_owned())]);
        assert_eq!(lines("v 1 # C:\\\nv"), [(1, "v 1 # C:\\".to_owned()), (2, "v".to_owned())]);
        assert_eq!(lines("\\\n\\\n\n\\"), []);
    }
}
