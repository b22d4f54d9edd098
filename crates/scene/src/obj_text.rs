//! OBJ text, checked and simplified while `tobj` reads it.
//!
//! `tobj` converts text to numbers and faces, but it has gaps. It reports no lines, and accepts NaN
//! and faces of two corners. It lets faces refer to later vertices, divides by weights, and stops
//! at texture coordinates that it cannot read. It drops the names of materials that it does not
//! find, and copies vertices that two groups share. So it reads through [`CleanObj`], which checks
//! each line and remembers lines and materials. It passes on only `v` with three numbers and `f`
//! with three or more vertices, both in the words of the file.
//!
//! Always true:
//! - What is passed on is finite, within [`MAX_COORDINATE`], and has indices in range at its line.
//! - At most one logical line of it is in memory.
//! - The first error ends the text; [`CleanObj::finish`] returns it.
//! - Statements that a faceted scene does not use are counted, and reported once each.

use crate::SceneError;
use crate::faces::Faces;
use crate::limits::{
    MAX_COORDINATE, MAX_MATERIALS, MAX_MTL_FILES, MAX_NAME_BYTES, MAX_POSITIONS, MAX_TRIANGLES,
};
use crate::text::{LogicalLines, excerpt, keyword, logical_lines, number, without_comment};
use crate::warnings::Warnings;
use std::collections::HashMap;
use std::io::{BufRead, Read};
use std::path::Path;

/// A material as an OBJ file names it.
pub(crate) struct MaterialUse {
    /// `None` for faces before any `usemtl`.
    pub name: Option<String>,
    /// The line of the first `usemtl`, or of the first face without one.
    pub line: usize,
}

/// What a text contains besides numbers and faces.
#[derive(Default)]
pub(crate) struct Checked {
    /// The line of each face, and its material as an index into `uses`.
    pub faces: Faces,
    /// The materials that faces use, in order of first use.
    pub uses: Vec<MaterialUse>,
    /// The text after each `mtllib`, with its line.
    pub libraries: Vec<(usize, String)>,
    pub ignored: Ignored,
}

/// Number of faces that `tobj` gets as one object. It takes over 100 bytes for a face until an
/// object ends. Vertices are shared only within an object, so the number is not smaller.
pub(crate) const FACES_AT_ONCE: usize = 1 << 20;

/// Lines between two reports of progress: some hundredths of a second.
const LINES_BETWEEN_REPORTS: usize = 1 << 16;

/// Ignored details other than whole statements; no keyword contains a space.
const WEIGHT: &str = "v weight";
const COLOUR: &str = "v colour";
/// A polygon that cannot be divided properly.
pub(crate) const CROSSED: &str = "f crossed";

/// How much of an OBJ file has been read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadProgress {
    /// Bytes read.
    pub bytes: u64,
    /// Bytes in the file.
    pub total_bytes: u64,
    /// Triangles read.
    pub triangles: u64,
}

/// The clean text of an OBJ file.
pub(crate) struct CleanObj<'a> {
    path: &'a Path,
    total_bytes: usize,
    lines: LogicalLines<'a>,
    line: usize,
    watch: &'a mut dyn FnMut(LoadProgress),
    unwatched: usize,
    /// The clean line that is being read, and how much of it has been read.
    clean: Vec<u8>,
    taken: usize,
    failed: Option<SceneError>,
    checked: Checked,
    vertices: usize,
    faces_in_hand: usize,
    /// The latest `usemtl`, and its index in `checked.uses` once a face uses it.
    current: Option<String>,
    current_line: usize,
    current_id: Option<u32>,
    ids: HashMap<Option<String>, u32>,
}

impl<'a> CleanObj<'a> {
    /// Nothing is read yet; `path` is for messages.
    pub(crate) fn new(
        path: &'a Path,
        text: &'a str,
        watch: &'a mut dyn FnMut(LoadProgress),
    ) -> CleanObj<'a> {
        CleanObj {
            path,
            total_bytes: text.len(),
            lines: logical_lines(text),
            line: 0,
            watch,
            unwatched: 0,
            clean: Vec::new(),
            taken: 0,
            failed: None,
            checked: Checked::default(),
            vertices: 0,
            faces_in_hand: 0,
            current: None,
            current_line: 0,
            current_id: None,
            ids: HashMap::new(),
        }
    }

    /// Returns what else the text contained, or the error that ended it.
    pub(crate) fn finish(self) -> Result<Checked, SceneError> {
        match self.failed {
            Some(error) => Err(error),
            None => Ok(self.checked),
        }
    }

    /// Reports how much has been read.
    fn report(&mut self) {
        self.unwatched = 0;
        (self.watch)(LoadProgress {
            bytes: (self.total_bytes - self.lines.left()) as u64,
            total_bytes: self.total_bytes as u64,
            triangles: self.checked.faces.triangles() as u64,
        });
    }

    /// Checks a statement, and writes what is passed on to `clean`.
    fn statement(&mut self, content: &str) -> Result<(), SceneError> {
        let (keyword, rest) = keyword(content);
        match keyword {
            "v" => self.vertex(without_comment(rest)),
            "f" | "fo" => self.face(without_comment(rest)),
            "usemtl" => self.use_material(rest),
            "mtllib" => self.library(rest),
            "g" | "o" | "s" | "mg" => Ok(()),
            "l" | "p" => {
                self.checked.ignored.count("l", self.line);
                Ok(())
            }
            _ => {
                self.checked.ignored.count(without_comment(keyword), self.line);
                Ok(())
            }
        }
    }

    fn vertex(&mut self, rest: &str) -> Result<(), SceneError> {
        self.clean.push(b'v');
        let mut found = 0;
        let mut fourth = "1";
        for token in rest.split_ascii_whitespace() {
            if !is_coordinate(token) {
                return Err(self.bad_value("v", "finite numbers of at most 1e12", token));
            }
            match found {
                0..=2 => self.pass_on(token),
                3 => fourth = token,
                _ => {}
            }
            found += 1;
        }
        match found {
            3 => {}
            4 if number(fourth) == Some(1.0) => {}
            4 => self.checked.ignored.count(WEIGHT, self.line),
            6 | 7 => self.checked.ignored.count(COLOUR, self.line),
            _ => return Err(self.bad_count("v", "three numbers", found)),
        }
        if self.vertices == MAX_POSITIONS {
            return Err(self.limit("vertices", MAX_POSITIONS));
        }
        self.vertices += 1;
        self.clean.push(b'\n');
        Ok(())
    }

    fn face(&mut self, rest: &str) -> Result<(), SceneError> {
        if self.faces_in_hand == FACES_AT_ONCE {
            self.faces_in_hand = 0;
            self.clean.extend_from_slice(b"o\n");
        }
        self.faces_in_hand += 1;
        self.clean.push(b'f');
        let mut n = 0;
        for token in rest.split_ascii_whitespace() {
            let vertex = self.corner(token)?;
            self.pass_on(vertex);
            n += 1;
        }
        if n < 3 {
            return Err(self.bad_count("f", "at least three corners", n));
        }
        if n - 2 > MAX_TRIANGLES - self.checked.faces.triangles() {
            return Err(self.limit("triangles", MAX_TRIANGLES));
        }
        let material = self.material_id()?;
        self.checked.faces.push(n - 2, self.line, material);
        self.clean.push(b'\n');
        Ok(())
    }

    fn pass_on(&mut self, token: &str) {
        self.clean.push(b' ');
        self.clean.extend_from_slice(token.as_bytes());
    }

    /// Returns the vertex, as written, of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`. Only the form
    /// of the others is checked.
    fn corner<'t>(&self, token: &'t str) -> Result<&'t str, SceneError> {
        let mut parts = token.split('/');
        let bad = || self.bad_value("f", "corners as v, v/vt, v//vn or v/vt/vn", token);
        let vertex = parts.next().unwrap_or("");
        let index: i64 = vertex.parse().map_err(|_| bad())?;
        let (texture, normal) = (parts.next().unwrap_or(""), parts.next().unwrap_or(""));
        let well_formed = |part: &str| part.is_empty() || part.parse::<i64>().is_ok();
        if parts.next().is_some() || !well_formed(texture) || !well_formed(normal) {
            return Err(bad());
        }
        // Negative indices count back from the latest vertex (-1), as in `tobj`.
        let count = self.vertices;
        if index == 0 || index.unsigned_abs() > count as u64 {
            return Err(SceneError::VertexIndex {
                path: self.path.to_owned(),
                line: self.line,
                index,
                count,
            });
        }
        Ok(vertex)
    }

    fn use_material(&mut self, name: &str) -> Result<(), SceneError> {
        if name.len() > MAX_NAME_BYTES {
            return Err(self.limit("bytes in a name", MAX_NAME_BYTES));
        }
        self.current = Some(name.to_owned());
        self.current_line = self.line;
        self.current_id = None;
        Ok(())
    }

    fn material_id(&mut self) -> Result<u32, SceneError> {
        if let Some(id) = self.current_id {
            return Ok(id);
        }
        let id = match self.ids.get(&self.current) {
            Some(&id) => id,
            None => {
                let uses = &mut self.checked.uses;
                if uses.len() == MAX_MATERIALS {
                    return Err(self.limit("materials", MAX_MATERIALS));
                }
                let id = uses.len() as u32;
                let line = if self.current.is_some() { self.current_line } else { self.line };
                uses.push(MaterialUse { name: self.current.clone(), line });
                self.ids.insert(self.current.clone(), id);
                id
            }
        };
        self.current_id = Some(id);
        Ok(id)
    }

    fn library(&mut self, names: &str) -> Result<(), SceneError> {
        if names.is_empty() {
            return Err(self.bad_count("mtllib", "the name of a file", 0));
        }
        if self.checked.libraries.len() == MAX_MTL_FILES {
            return Err(self.limit("`mtllib` lines", MAX_MTL_FILES));
        }
        self.checked.libraries.push((self.line, names.to_owned()));
        Ok(())
    }

    fn bad_value(&self, keyword: &str, expected: &'static str, found: &str) -> SceneError {
        let (path, keyword) = (self.path.to_owned(), keyword.to_owned());
        SceneError::Value { path, line: self.line, keyword, expected, found: excerpt(found) }
    }

    fn bad_count(&self, keyword: &str, expected: &'static str, found: usize) -> SceneError {
        let (path, keyword) = (self.path.to_owned(), keyword.to_owned());
        SceneError::Count { path, line: self.line, keyword, expected, found }
    }

    fn limit(&self, what: &'static str, limit: usize) -> SceneError {
        SceneError::FileLimit { path: self.path.to_owned(), line: self.line, what, limit }
    }
}

impl BufRead for CleanObj<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        while self.taken == self.clean.len() && self.failed.is_none() {
            self.clean.clear();
            self.taken = 0;
            let Some((line, content)) = self.lines.next() else { break };
            self.line = line;
            self.unwatched += 1;
            if self.unwatched == LINES_BETWEEN_REPORTS {
                self.report();
            }
            if let Err(error) = self.statement(&content) {
                self.clean.clear();
                self.failed = Some(error);
            }
        }
        Ok(&self.clean[self.taken..])
    }

    fn consume(&mut self, bytes: usize) {
        self.taken += bytes;
    }
}

impl Read for CleanObj<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.fill_buf()?.read(buffer)?;
        self.consume(read);
        Ok(read)
    }
}

/// Returns whether a token is a finite number of at most [`MAX_COORDINATE`]. Most are plain
/// decimals, which are recognised without parsing.
fn is_coordinate(token: &str) -> bool {
    is_plainly_small(token.as_bytes())
        || number(token).is_some_and(|value| value.abs() <= MAX_COORDINATE)
}

/// Returns whether a token is a decimal without exponent with one to twelve digits before the
/// point: at most 1e12.
fn is_plainly_small(token: &[u8]) -> bool {
    let unsigned = token.strip_prefix(b"-").unwrap_or(token);
    let whole = unsigned.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let fraction = &unsigned[whole..];
    let fraction = fraction.strip_prefix(b".").unwrap_or(fraction);
    (1..=12).contains(&whole) && fraction.iter().all(u8::is_ascii_digit)
}

/// Ignored statements: how many of each, and where the first is.
#[derive(Default)]
pub(crate) struct Ignored {
    kinds: HashMap<String, (usize, usize)>,
}

impl Ignored {
    /// Most kinds that are named. A file that is no OBJ file may have any number of keywords.
    const MAX_KINDS: usize = 32;

    pub(crate) fn count(&mut self, kind: &str, line: usize) {
        // No allocation for known kinds: there are as many normals as vertices.
        if let Some((_, count)) = self.kinds.get_mut(kind) {
            *count += 1;
        } else if self.kinds.len() < Self::MAX_KINDS || kind == CROSSED {
            self.kinds.insert(kind.to_owned(), (line, 1));
        }
    }

    pub(crate) fn warn(self, path: &Path, warnings: &mut Warnings) {
        let mut kinds: Vec<_> = self.kinds.into_iter().collect();
        kinds.sort_by_key(|(_, (line, _))| *line);
        for (kind, (line, count)) in kinds {
            let why = match kind.as_str() {
                "vn" => "`vn` is ignored: surfaces are faceted, as modelled".to_owned(),
                "vt" => "`vt` is ignored: there are no textures".to_owned(),
                "l" => "lines and points (`l`, `p`) are ignored".to_owned(),
                WEIGHT => "the weight of `v` is ignored".to_owned(),
                COLOUR => "colours of vertices are ignored".to_owned(),
                CROSSED => {
                    "a polygon crosses itself or is very long: its triangles may overlap".to_owned()
                }
                _ => format!("`{}` is unknown and ignored", excerpt(&kind)),
            };
            let lines = if count == 1 { String::new() } else { format!(" ({count} lines)") };
            warnings.push(path, Some(line), format!("{why}{lines}"));
        }
    }
}
