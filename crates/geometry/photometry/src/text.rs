//! Words and lines of a file, with their numbers.

use crate::PhotometryError;

/// Most bytes of a text that a message repeats.
const EXCERPT: usize = 40;

/// Returns the beginning of a text, for messages.
pub(crate) fn excerpt(text: &str) -> String {
    let mut end = text.len().min(EXCERPT);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text[..end].chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// Reads a number. A comma may stand for its point.
pub(crate) fn parse(text: &str) -> Option<f64> {
    let number = text.parse().ok().or_else(|| text.replace(',', ".").parse().ok());
    number.filter(|number: &f64| number.is_finite())
}

/// A number of a file that must lie in a range.
#[derive(Clone, Copy)]
pub(crate) struct Quantity {
    pub what: &'static str,
    pub range: &'static str,
    pub least: f64,
    pub most: f64,
}

impl Quantity {
    /// Reads it from the text of a line.
    pub(crate) fn read(&self, line: usize, text: &str) -> Result<f64, PhotometryError> {
        let number = parse(text).filter(|number| (self.least..=self.most).contains(number));
        number.ok_or_else(|| PhotometryError::Number {
            line,
            what: self.what,
            found: excerpt(text),
            range: self.range,
        })
    }
}

/// The words of a text that are still to be read, divided by blanks and commas.
pub(crate) struct Words<'a> {
    lines: std::iter::Peekable<std::iter::Enumerate<std::str::Lines<'a>>>,
    rest: &'a str,
    /// The line of the last word, from 1.
    pub line: usize,
}

impl<'a> Words<'a> {
    /// Begins after `skipped` lines.
    pub(crate) fn after(text: &'a str, skipped: usize) -> Words<'a> {
        let mut lines = text.lines().enumerate().peekable();
        while lines.next_if(|(number, _)| *number < skipped).is_some() {}
        Words { lines, rest: "", line: skipped }
    }

    fn next(&mut self, what: &'static str) -> Result<&'a str, PhotometryError> {
        let is_between = |c: char| c.is_whitespace() || c == ',';
        loop {
            self.rest = self.rest.trim_start_matches(is_between);
            if !self.rest.is_empty() {
                let end = self.rest.find(is_between).unwrap_or(self.rest.len());
                let (word, rest) = self.rest.split_at(end);
                self.rest = rest;
                return Ok(word);
            }
            let Some((number, line)) = self.lines.next() else {
                return Err(PhotometryError::Ends { line: self.line, what });
            };
            (self.rest, self.line) = (line, number + 1);
        }
    }

    /// Reads a number.
    pub(crate) fn number(&mut self, quantity: Quantity) -> Result<f64, PhotometryError> {
        let word = self.next(quantity.what)?;
        quantity.read(self.line, word)
    }

    /// Reads `count` numbers.
    pub(crate) fn numbers(
        &mut self,
        count: usize,
        quantity: Quantity,
    ) -> Result<Vec<f64>, PhotometryError> {
        (0..count).map(|_| self.number(quantity)).collect()
    }
}
