//! What can be wrong with a scene, and what is only worth saying.

use std::fmt;
use std::path::PathBuf;

/// Why a scene could not be read, made or unpacked.
///
/// Lines count from 1. `found` holds at most a few dozen characters of the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is larger than is read.
    #[error("{path}: the file is larger than {limit} bytes")]
    FileTooLarge {
        /// The file.
        path: PathBuf,
        /// The limit of [`crate::limits`] in bytes.
        limit: u64,
    },
    /// A statement has a wrong number of values.
    #[error("{path}:{line}: `{keyword}` takes {expected}, found {found}")]
    Count {
        /// The file.
        path: PathBuf,
        /// The line.
        line: usize,
        /// The statement.
        keyword: String,
        /// What it takes, in words.
        expected: &'static str,
        /// How many there are.
        found: usize,
    },
    /// A value is not a finite number (or integer) of reasonable size.
    #[error("{path}:{line}: `{keyword}` takes {expected}, found `{found}`")]
    Value {
        /// The file.
        path: PathBuf,
        /// The line.
        line: usize,
        /// The statement.
        keyword: String,
        /// What it takes, in words.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// A face names a vertex that is not there.
    #[error(
        "{path}:{line}: `f` names vertex {index}, but {count} are defined before this line (the first is 1)"
    )]
    VertexIndex {
        /// The file.
        path: PathBuf,
        /// The line.
        line: usize,
        /// The index as written: 0, too large, or negative beyond the first.
        index: i64,
        /// How many vertices there are by then.
        count: usize,
    },
    /// An MTL file sets a property before it names a material.
    #[error("{path}:{line}: `{keyword}` comes before any `newmtl`")]
    BeforeNewmtl {
        /// The file.
        path: PathBuf,
        /// The line.
        line: usize,
        /// The statement.
        keyword: String,
    },
    /// A file holds more of something than a scene may.
    #[error("{path}:{line}: more than {limit} {what}")]
    FileLimit {
        /// The file.
        path: PathBuf,
        /// The line where it is too much.
        line: usize,
        /// Of what.
        what: &'static str,
        /// The limit of [`crate::limits`].
        limit: usize,
    },
    /// `tobj` refuses a file that our checks let through.
    #[error("{path}: {source}")]
    Parser {
        /// The file.
        path: PathBuf,
        /// What `tobj` says.
        source: tobj::LoadError,
    },
    /// A file has no triangle with an area.
    #[error("{path}: no triangle with an area in it")]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A scene would hold more of something than it may.
    #[error("{count} {what} are more than the limit of {limit}")]
    Limit {
        /// Of what.
        what: &'static str,
        /// How many.
        count: u64,
        /// The limit of [`crate::limits`].
        limit: u64,
    },
    /// The origin is not finite or too far away.
    #[error("the origin is not finite or beyond {} units", crate::limits::MAX_COORDINATE)]
    Origin,
    /// A position is not finite or too far away.
    #[error("position {0} is not finite or beyond {limit} units", limit = crate::limits::MAX_COORDINATE)]
    Position(usize),
    /// A triangle names a position that is not there.
    #[error("triangle {triangle} names position {index} of {count}")]
    PositionIndex {
        /// The triangle.
        triangle: usize,
        /// The position it names.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// A triangle names a material that is not there.
    #[error("triangle {triangle} names material {index} of {count}")]
    MaterialIndex {
        /// The triangle.
        triangle: usize,
        /// The material it names.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// There is not one material id for each triangle.
    #[error("{triangles} triangles have {material_ids} material ids")]
    MaterialIdCount {
        /// Triangles.
        triangles: usize,
        /// Material ids.
        material_ids: usize,
    },
    /// A triangle has no area (by `f64` arithmetic on its `f32` corners), so no normal.
    #[error("triangle {0} has no area")]
    NoArea(usize),
    /// A material has an impossible value.
    #[error("material `{name}`: {problem}")]
    Material {
        /// The material.
        name: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// The sky's radiance is negative, not finite or too large.
    #[error("the sky's radiance must be finite numbers from 0 to {}", crate::limits::MAX_RADIANCE)]
    Sky,
    /// The bytes are not a packed scene.
    #[error("not a packed scene: {0}")]
    Packed(#[from] PackedError),
}

/// Why bytes are not a packed scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PackedError {
    /// They do not begin as one.
    #[error("it does not begin with the magic bytes")]
    Magic,
    /// They are of a version that this program does not know.
    #[error("its version is {0}, this program reads {known}", known = crate::VERSION)]
    Version(u32),
    /// The length differs from what the header says.
    #[error("{found} bytes, its header says {expected}")]
    Length {
        /// Bytes that the header asks for.
        expected: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// Bytes that must be zero are not.
    #[error("reserved bytes are not zero")]
    Reserved,
    /// The bytes of the materials are malformed.
    #[error("material {0} is malformed")]
    Material(usize),
}

/// Something in a file that is not, or not exactly, in the scene. Displayed as `path:line: text`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1, where it is first; `None` if it is about the whole file.
    pub line: Option<usize>,
    /// What is not as the file says, and what is done instead.
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
