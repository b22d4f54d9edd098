//! Counts the parts of an OBJ file that are left out or ignored, by kind.

use std::collections::HashMap;
use std::path::Path;

use crate::text::excerpt;
use crate::warnings::Warnings;

/// Kinds of statements that are left out; no keyword contains a space.
pub(crate) const BAD_VERTEX: &str = "v bad";
pub(crate) const BAD_ATTRIBUTE: &str = "vt or vn bad";
pub(crate) const BAD_CORNER: &str = "f corner";
pub(crate) const FEW_CORNERS: &str = "f few";
pub(crate) const MANY_CORNERS: &str = "f many";
pub(crate) const NO_VERTEX: &str = "f vertex";
pub(crate) const SPOILT_VERTEX: &str = "f spoilt";
pub(crate) const NO_LIBRARY: &str = "mtllib none";
/// Ignored details other than whole statements.
pub(crate) const WEIGHT: &str = "v weight";
/// A polygon that cannot be divided properly.
pub(crate) const CROSSED: &str = "f crossed";

/// Statements that are ignored or left out: how many of each kind, and where the first is.
#[derive(Default)]
pub(crate) struct Ignored {
    kinds: HashMap<String, IgnoredStatement>,
}

struct IgnoredStatement {
    line: usize,
    count: usize,
    /// The problem of the first one, for people.
    example: Option<String>,
}

impl Ignored {
    /// Most kinds that are named. A file that is no OBJ file may have any number of keywords.
    const MAX_KINDS: usize = 32;

    /// Counts a statement of a kind that is ignored.
    pub(crate) fn count(&mut self, kind: &str, line: usize) {
        // No allocation for known kinds: there are as many normals as vertices.
        if let Some(known) = self.kinds.get_mut(kind) {
            known.count += 1;
        } else if self.kinds.len() < Self::MAX_KINDS || kind == CROSSED {
            self.kinds.insert(kind.to_owned(), IgnoredStatement { line, count: 1, example: None });
        }
    }

    /// Counts a statement that is left out. `example` says what is wrong with the first one.
    pub(crate) fn example(
        &mut self,
        kind: &'static str,
        line: usize,
        example: impl FnOnce() -> String,
    ) {
        match self.kinds.get_mut(kind) {
            Some(known) => known.count += 1,
            None => {
                let kind_of_first = IgnoredStatement { line, count: 1, example: Some(example()) };
                self.kinds.insert(kind.to_owned(), kind_of_first);
            }
        }
    }

    /// Returns the problem of the first statement that was left out, and its line.
    pub(crate) fn first_left_out(&self) -> Option<(usize, &str)> {
        let examples = self.kinds.values().filter_map(|k| Some((k.line, k.example.as_deref()?)));
        examples.min()
    }

    /// Returns whether there were lines or points.
    pub(crate) fn has_lines(&self) -> bool {
        self.kinds.contains_key("l")
    }

    pub(crate) fn warn(self, path: &Path, warnings: &mut Warnings) {
        let mut kinds: Vec<_> = self.kinds.into_iter().collect();
        kinds.sort_by(|a, b| (a.1.line, &a.0).cmp(&(b.1.line, &b.0)));
        for (kind, IgnoredStatement { line, count, example }) in kinds {
            let why = match (kind.as_str(), example) {
                (_, Some(example)) => example + "; it is left out",
                ("l", _) => "lines and points (`l`, `p`) are ignored".to_owned(),
                (WEIGHT, _) => "a weight of `v` that is 0 or no number is ignored".to_owned(),
                (CROSSED, _) => {
                    "a polygon crosses itself or is very long: its triangles may overlap".to_owned()
                }
                _ => format!("`{}` is unknown and ignored", excerpt(&kind)),
            };
            let lines = if count == 1 { String::new() } else { format!(" ({count} lines)") };
            warnings.push(path, Some(line), format!("{why}{lines}"));
        }
    }
}
