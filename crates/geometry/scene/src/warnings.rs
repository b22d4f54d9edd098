//! Warnings about a file: parts that the scene does not represent, and what replaces them.

use crate::limits::MAX_WARNINGS;
use std::fmt;
use std::path::{Path, PathBuf};

/// Something in a file that the scene does not represent exactly. Displayed as `path:line: text`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file.
    pub path: PathBuf,
    /// The first line concerned, counted from 1; `None` if it is about the whole file.
    pub line: Option<usize>,
    /// The difference from the file, and what is done instead.
    pub text: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.path.display(), self.text),
            None => write!(f, "{}: {}", self.path.display(), self.text),
        }
    }
}

/// Collects at most [`MAX_WARNINGS`] warnings.
#[derive(Default)]
pub(crate) struct Warnings {
    listed: Vec<Warning>,
    more: usize,
}

impl Warnings {
    pub(crate) fn push(&mut self, path: &Path, line: Option<usize>, text: String) {
        if self.listed.len() < MAX_WARNINGS {
            self.listed.push(Warning { path: path.to_owned(), line, text });
        } else {
            self.more += 1;
        }
    }

    pub(crate) fn finish(mut self, path: &Path) -> Vec<Warning> {
        if self.more > 0 {
            let text = format!("{} more warnings", self.more);
            self.listed.push(Warning { path: path.to_owned(), line: None, text });
        }
        self.listed
    }
}
