//! Why a photometric file is of no use.

use thiserror::Error;

/// Why a photometric file is of no use. Lines count from 1.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PhotometryError {
    /// The file is too long.
    #[error(
        "the file has {0} bytes; photometric files have at most {most}",
        most = crate::MAX_PHOTOMETRY_BYTES
    )]
    TooLong(u64),
    /// The file has another format.
    #[error(
        "this is no photometric file: IES files have a line `TILT=`, and EULUMDAT files have the \
         symmetry 0 to 4 in line 3"
    )]
    Foreign,
    /// The file ends too early.
    #[error("the file ends at line {line}, before its {what}; download it again")]
    Ends {
        /// The last line.
        line: usize,
        /// What is missing.
        what: &'static str,
    },
    /// A word is no number of its range.
    #[error("line {line}: {what} is `{found}`, but must be {range}")]
    Number {
        /// The line.
        line: usize,
        /// What it states.
        what: &'static str,
        /// Its text.
        found: String,
        /// What is possible.
        range: &'static str,
    },
    /// There is too much of something.
    #[error("line {line}: {found} {what}; at most {most} are read")]
    Limit {
        /// The line.
        line: usize,
        /// What is counted.
        what: &'static str,
        /// Its number.
        found: usize,
        /// The limit.
        most: usize,
    },
    /// Angles do not ascend, or have another range.
    #[error("line {line}: {what} angles {problem}")]
    Angles {
        /// The line.
        line: usize,
        /// Which ones.
        what: &'static str,
        /// What is wrong.
        problem: String,
    },
}
