//! Text files as logical lines, for both OBJ and MTL.
//!
//! A logical line is never empty. It has no byte order mark, no line end, no surrounding spaces,
//! and no continuation. Its number is that of its first physical line, counted from 1.

use crate::SceneError;
use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads a text file of at most `limit` bytes. Bytes that are not UTF-8 (such as old comments)
/// become U+FFFD.
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
    Ok(String::from_utf8(bytes)
        .unwrap_or_else(|bad| String::from_utf8_lossy(bad.as_bytes()).into_owned()))
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

/// Returns at most the first few dozen characters of a text, for messages.
pub(crate) fn excerpt(text: &str) -> String {
    const SHOWN: usize = 40;
    if text.chars().nth(SHOWN).is_none() {
        return text.to_owned();
    }
    text.chars().take(SHOWN).chain(['…']).collect()
}

#[cfg(test)]
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
