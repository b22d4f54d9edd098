//! OBJ text, checked and simplified while `tobj` reads it.
//!
//! `tobj` converts text to numbers and faces, but it has gaps. It reports no lines, and accepts NaN
//! and faces of two corners. It lets faces refer to later vertices, and stops at weights of zero
//! and at texture coordinates that it cannot read. It drops the names of materials that it does not
//! find, and copies vertices that two groups share. So it reads through [`CleanObj`], which checks
//! each line and remembers lines and materials. It passes on only `v` with three numbers or a
//! weight, and `f` with three or more vertices.
//!
//! Invariants:
//! - Coordinates that are passed on are finite and within [`MAX_COORDINATE`], also over their
//!   weight, and indices are in range at their line.
//! - A vertex that cannot be read keeps its number; faces that name it are left out.
//! - Faces that name vertices of later lines are passed on at the end of the text.
//! - At most one other logical line is in memory.
//! - Statements that are left out or ignored are counted, and reported once for each kind with the
//!   first line.
//! - Only a limit of [`crate::limits`] is an error. It ends the text; [`CleanObj::finish`] returns
//!   it.

use crate::SceneError;
use crate::limits::{
    MAX_COORDINATE, MAX_CORNERS, MAX_MATERIALS, MAX_MTL_FILES, MAX_NAME_BYTES, MAX_POSITIONS,
    MAX_TRIANGLES,
};
use crate::model::LoadProgress;
use crate::obj_checked::{Checked, MaterialUse, NO_COLOUR, NONE};
use crate::obj_ignored::{
    BAD_ATTRIBUTE, BAD_CORNER, BAD_VERTEX, FEW_CORNERS, MANY_CORNERS, NO_LIBRARY, NO_VERTEX,
    SPOILT_VERTEX, WEIGHT,
};
use crate::text::{
    LogicalLines, excerpt, keyword, logical_lines, loose_number, number, without_comment,
};
use glam::Vec3;
use std::collections::{HashMap, HashSet};
use std::io::{BufRead, Read, Write};
use std::path::Path;

/// Number of faces that `tobj` gets as one object. It takes over 100 bytes for a face until an
/// object ends. Vertices are shared only within an object, so the number is not smaller.
pub(crate) const FACES_AT_ONCE: usize = 1 << 20;

/// Lines between two reports of progress: some hundredths of a second.
const LINES_BETWEEN_REPORTS: usize = 1 << 16;

/// A corner of a face.
#[derive(Clone, Copy)]
struct Corner {
    /// The number of its vertex, from 1.
    vertex: usize,
    /// Texture coordinate and normal; from 0, or [`NONE`]. They may be on later lines.
    attributes: [u32; 2],
}

/// A face that names vertices of later lines.
struct LaterFace {
    line: usize,
    material: u32,
    group: u32,
    corners: Vec<Corner>,
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
    /// Numbers, from 1, of vertices that could not be read.
    spoilt: HashSet<usize>,
    /// Faces that name vertices of later lines.
    later: Vec<LaterFace>,
    faces_in_hand: usize,
    /// Reused for all faces, because allocating takes longer than reading most of them.
    corners: Vec<Corner>,
    /// Number of corners passed on.
    corner_count: usize,
    /// The latest `s`.
    group: u32,
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
            spoilt: HashSet::new(),
            later: Vec::new(),
            faces_in_hand: 0,
            corners: Vec::new(),
            corner_count: 0,
            group: 0,
            current: None,
            current_line: 0,
            current_id: None,
            ids: HashMap::new(),
        }
    }

    /// Returns the other contents of the text, or the error that ended it.
    pub(crate) fn finish(self) -> Result<Checked, SceneError> {
        match self.failed {
            Some(error) => Err(error),
            None => {
                let mut checked = self.checked;
                if !checked.corners.is_empty() {
                    checked.corners.resize(self.corner_count, [NONE; 2]);
                }
                if !checked.groups.is_empty() {
                    checked.groups.resize(checked.faces.triangles(), 0);
                }
                if !checked.colours.is_empty() {
                    checked.colours.resize(checked.vertices, NO_COLOUR);
                    checked.coloured.resize(self.corner_count, 0);
                }
                Ok(checked)
            }
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

    /// Checks a statement, and writes it to `clean` if it is passed on.
    fn statement(&mut self, content: &str) -> Result<(), SceneError> {
        let (keyword, rest) = keyword(content);
        match keyword {
            "v" => self.vertex(without_comment(rest)),
            "f" | "fo" => self.face(without_comment(rest)),
            "usemtl" => self.use_material(rest),
            "mtllib" => self.library(rest),
            "vt" => self.texture_coordinate(without_comment(rest)),
            "vn" => self.normal(without_comment(rest)),
            "s" => {
                self.group = without_comment(rest).parse().unwrap_or(0);
                Ok(())
            }
            "g" | "o" | "mg" => Ok(()),
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

    /// Passes on a vertex. One that cannot be read is passed on as zero, to keep its number.
    fn vertex(&mut self, rest: &str) -> Result<(), SceneError> {
        if self.checked.vertices == MAX_POSITIONS {
            return Err(self.limit("vertices", MAX_POSITIONS));
        }
        self.checked.vertices += 1;
        self.clean.push(b'v');
        let mut found = 0;
        // A weight follows the coordinates, or a colour with or without opacity.
        let mut more = ["1"; 3];
        for token in rest.split_ascii_whitespace() {
            match found {
                0..=2 if is_plainly_small(token.as_bytes()) => self.pass_on(token),
                0..=2 => match loose_number(token).filter(|n| n.abs() <= MAX_COORDINATE) {
                    Some(number) => self.pass_on(&number.to_string()),
                    None => break,
                },
                3..=5 => more[found - 3] = token,
                _ => {}
            }
            found += 1;
        }
        if found < 3 {
            self.clean.clear();
            self.clean.extend_from_slice(b"v 0 0 0");
            self.spoilt.insert(self.checked.vertices);
            self.checked.ignored.example(BAD_VERTEX, self.line, || {
                format!("`v` takes three numbers of at most 1e12, found `{}`", excerpt(rest))
            });
        } else if found == 4 && number(more[0]) != Some(1.0) {
            let largest = rest.split_ascii_whitespace().take(3).filter_map(loose_number);
            let largest = largest.map(f64::abs).fold(0.0, f64::max);
            let fits = |weight: &f64| *weight != 0.0 && largest <= MAX_COORDINATE * weight.abs();
            match number(more[0]).filter(fits) {
                // The coordinates are homogeneous. `tobj` divides by the weight.
                Some(weight) => self.pass_on(&weight.to_string()),
                None => self.checked.ignored.count(WEIGHT, self.line),
            }
        } else if found > 5 {
            let Checked { colours, vertices, .. } = &mut self.checked;
            colours.resize(*vertices - 1, NO_COLOUR);
            colours.push(more.map(|token| single(token).unwrap_or(1.0)));
        }
        self.clean.push(b'\n');
        Ok(())
    }

    /// Remembers `vt`. One that cannot be read keeps its number.
    fn texture_coordinate(&mut self, rest: &str) -> Result<(), SceneError> {
        if self.checked.texcoords.len() == MAX_POSITIONS {
            return Err(self.limit("texture coordinates", MAX_POSITIONS));
        }
        let mut numbers = rest.split_ascii_whitespace().map(single);
        let pair = match (numbers.next(), numbers.next()) {
            (Some(Some(u)), Some(Some(v))) => [u, v],
            (Some(Some(u)), None) => [u, 0.0],
            _ => self.bad_attribute("vt", rest, [0.0; 2]),
        };
        self.checked.texcoords.push(pair);
        Ok(())
    }

    /// Remembers `vn`. One that cannot be read keeps its number.
    fn normal(&mut self, rest: &str) -> Result<(), SceneError> {
        if self.checked.normals.len() == MAX_POSITIONS {
            return Err(self.limit("normals", MAX_POSITIONS));
        }
        let mut numbers = rest.split_ascii_whitespace().map(single);
        let normal = match [numbers.next(), numbers.next(), numbers.next()] {
            [Some(Some(x)), Some(Some(y)), Some(Some(z))] => Vec3::new(x, y, z),
            _ => self.bad_attribute("vn", rest, Vec3::ZERO),
        };
        self.checked.normals.push(normal);
        Ok(())
    }

    fn bad_attribute<T>(&mut self, keyword: &str, rest: &str, instead: T) -> T {
        self.checked.ignored.example(BAD_ATTRIBUTE, self.line, || {
            format!("`{keyword}` takes finite numbers, found `{}`", excerpt(rest))
        });
        instead
    }

    /// Passes on a face, or remembers it if it names vertices of later lines.
    fn face(&mut self, rest: &str) -> Result<(), SceneError> {
        let mut corners = std::mem::take(&mut self.corners);
        corners.clear();
        let mut is_well_formed = true;
        for token in rest.split_ascii_whitespace().take(MAX_CORNERS + 1) {
            let Some(corner) = self.corner(token) else {
                is_well_formed = false;
                break;
            };
            corners.push(corner);
        }
        if !is_well_formed {
            self.checked.faces_left_out += 1;
        } else if corners.len() < 3 {
            self.leave_out(FEW_CORNERS, self.line, || {
                format!("`f` takes at least three corners, found {}", corners.len())
            });
        } else if corners.len() > MAX_CORNERS {
            self.leave_out(MANY_CORNERS, self.line, || {
                format!("`f` takes at most {MAX_CORNERS} corners")
            });
        } else if corners.iter().any(|corner| corner.vertex > self.checked.vertices) {
            let (line, material, group) = (self.line, self.material_id()?, self.group);
            self.later.push(LaterFace { line, material, group, corners: corners.clone() });
        } else {
            let material = self.material_id()?;
            self.pass_on_face(&corners, self.line, material, self.group)?;
        }
        self.corners = corners;
        Ok(())
    }

    /// Passes on a face whose vertices have all been passed on.
    fn pass_on_face(
        &mut self,
        corners: &[Corner],
        line: usize,
        material: u32,
        group: u32,
    ) -> Result<(), SceneError> {
        if let Some(corner) = corners.iter().find(|corner| self.spoilt.contains(&corner.vertex)) {
            self.leave_out(SPOILT_VERTEX, line, || {
                format!("`f` names vertex {}, which could not be read", corner.vertex)
            });
            return Ok(());
        }
        let triangles = corners.len() - 2;
        if triangles > MAX_TRIANGLES - self.checked.faces.triangles() {
            return Err(self.limit("triangles", MAX_TRIANGLES));
        }
        if self.faces_in_hand == FACES_AT_ONCE {
            self.faces_in_hand = 0;
            self.clean.extend_from_slice(b"o\n");
        }
        self.faces_in_hand += 1;
        self.clean.push(b'f');
        for corner in corners {
            // Writing to a vector cannot fail.
            let _ = write!(self.clean, " {}", corner.vertex);
        }
        self.clean.push(b'\n');
        self.remember_attributes(corners, group);
        self.checked.faces.push(triangles, line, material);
        Ok(())
    }

    /// Stores the other attributes of a face's corners. Files without anything pay nothing.
    fn remember_attributes(&mut self, corners: &[Corner], group: u32) {
        let Checked { corners: known, groups, faces, colours, coloured, .. } = &mut self.checked;
        if corners.iter().any(|corner| corner.attributes != [NONE; 2]) {
            known.resize(self.corner_count, [NONE; 2]);
            known.extend(corners.iter().map(|corner| corner.attributes));
        }
        if !colours.is_empty() {
            // Before the first colour, corners are stored as vertex 0, because their colours do not
            // exist.
            coloured.resize(self.corner_count, 0);
            coloured.extend(corners.iter().map(|corner| corner.vertex as u32 - 1));
        }
        self.corner_count += corners.len();
        if group != 0 {
            groups.resize(faces.triangles(), 0);
            groups.extend(std::iter::repeat_n(group, corners.len() - 2));
        }
    }

    /// Passes on the faces that named vertices of later lines, now that all lines are known.
    fn pass_on_later(&mut self) -> Result<(), SceneError> {
        for LaterFace { line, material, group, corners } in std::mem::take(&mut self.later) {
            let count = self.checked.vertices;
            match corners.iter().find(|corner| corner.vertex > count) {
                Some(corner) => self.leave_out(NO_VERTEX, line, || {
                    format!("`f` names vertex {}, but there are {count}", corner.vertex)
                }),
                None => self.pass_on_face(&corners, line, material, group)?,
            }
        }
        Ok(())
    }

    fn pass_on(&mut self, token: &str) {
        self.clean.push(b' ');
        self.clean.extend_from_slice(token.as_bytes());
    }

    fn leave_out(&mut self, kind: &'static str, line: usize, example: impl FnOnce() -> String) {
        self.checked.faces_left_out += 1;
        self.checked.ignored.example(kind, line, example);
    }

    /// Returns a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`. Returns `None`, and counts it, if the
    /// corner is impossible. An impossible texture coordinate or normal is left out.
    fn corner(&mut self, token: &str) -> Option<Corner> {
        let mut parts = token.split('/');
        let index = |part: Option<&str>| match part {
            None | Some("") => Some(None),
            Some(part) => part.parse::<i64>().ok().map(Some),
        };
        let read = [index(parts.next()), index(parts.next()), index(parts.next())];
        let [Some(Some(index)), Some(texture), Some(normal)] = read else {
            return self.bad_corner(token);
        };
        if parts.next().is_some() {
            return self.bad_corner(token);
        }
        // Negative indices count back from the latest (-1).
        let from_latest = |index: i64, count: usize| match index {
            ..0 => count as i64 + 1 + index.max(i64::MIN / 2),
            _ => index,
        };
        let count = self.checked.vertices;
        let vertex = from_latest(index, count);
        if vertex < 1 {
            self.checked.ignored.example(NO_VERTEX, self.line, || {
                format!("`f` names vertex {index} after {count} (the first is 1)")
            });
            return None;
        }
        let attribute = |index: Option<i64>, count: usize| {
            let number = index.map_or(0, |index| from_latest(index, count));
            u32::try_from(number - 1).unwrap_or(NONE)
        };
        let texture = attribute(texture, self.checked.texcoords.len());
        let normal = attribute(normal, self.checked.normals.len());
        Some(Corner { vertex: vertex as usize, attributes: [texture, normal] })
    }

    fn bad_corner<T>(&mut self, token: &str) -> Option<T> {
        self.checked.ignored.example(BAD_CORNER, self.line, || {
            format!("`f` takes corners as v, v/vt, v//vn or v/vt/vn, found `{}`", excerpt(token))
        });
        None
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
            let text = || "`mtllib` names no file".to_owned();
            self.checked.ignored.example(NO_LIBRARY, self.line, text);
            return Ok(());
        }
        if self.checked.libraries.len() == MAX_MTL_FILES {
            return Err(self.limit("`mtllib` lines", MAX_MTL_FILES));
        }
        self.checked.libraries.push((self.line, names.to_owned()));
        Ok(())
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
            let done = match self.lines.next() {
                Some((line, content)) => {
                    self.line = line;
                    self.unwatched += 1;
                    if self.unwatched == LINES_BETWEEN_REPORTS {
                        self.report();
                    }
                    self.statement(&content)
                }
                None if self.later.is_empty() => break,
                None => self.pass_on_later(),
            };
            if let Err(error) = done {
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

/// Returns a finite number.
fn single(token: &str) -> Option<f32> {
    loose_number(token).map(|number| number as f32).filter(|number| number.is_finite())
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
