//! Command lines on standard input.

use std::{io::IsTerminal, thread};

use super::parse;
use crate::Inputs;

/// Passes lines from standard input to the stage until the input ends. Errors in a line are printed
/// on standard error.
pub fn follow_standard_input(inputs: Inputs) {
    if is_in_background() {
        return;
    }
    // A thread, because reading standard input cannot be cancelled. It ends with the program.
    thread::spawn(move || {
        for line in std::io::stdin().lines() {
            let Ok(line) = line else { return };
            if line.trim().is_empty() {
                continue;
            }
            let sent = parse(&line).map(|input| inputs.send(0, 0, input));
            match sent {
                Ok(true) => {}
                Ok(false) => eprintln!("too many lines at once: `{line}` was lost"),
                Err(error) => eprintln!("{error}"),
            }
        }
    });
}

/// Returns whether a shell runs this program in the background, because then reading the terminal
/// would stop it.
#[cfg(unix)]
fn is_in_background() -> bool {
    let input = std::io::stdin();
    input.is_terminal()
        && rustix::termios::tcgetpgrp(&input).is_ok_and(|front| front != rustix::process::getpgrp())
}

#[cfg(not(unix))]
fn is_in_background() -> bool {
    false
}
