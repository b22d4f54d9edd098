//! Results on standard output.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write, stdout};
use std::process::exit;

/// Prints results. If the reader has closed the pipe, as in `holodeck info … | head -3`, this ends
/// the process with status 0. If results cannot be written for another reason, it prints the reason
/// and ends the process with status 1.
pub fn print(results: Arguments<'_>) {
    let mut output = stdout().lock();
    match output.write_fmt(results).and_then(|()| output.flush()) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => exit(0),
        Err(error) => {
            eprintln!("standard output: {error}");
            exit(1)
        }
    }
}

/// Prints a line of results. See [`print()`].
#[macro_export]
macro_rules! print_line {
    ($($text:tt)*) => {
        $crate::print(format_args!("{}\n", format_args!($($text)*)))
    };
}
