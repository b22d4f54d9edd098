//! Errors as people read them.

use std::{error::Error, process::ExitCode};

/// Returns a program's exit status. Prints an error to standard error, after the program's name.
pub fn exit_code(program: &str, result: anyhow::Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{program}: {}", said_once(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}

/// Returns an error and its causes in one line. A cause that the line contains already is left out,
/// because many errors quote their cause.
pub fn said_once(error: &(dyn Error + 'static)) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        if !line.contains(&text) {
            line = format!("{line}: {text}");
        }
        cause = error.source();
    }
    line
}

#[cfg(test)]
mod tests {
    use anyhow::{Context, anyhow};

    use super::*;

    #[test]
    fn a_cause_that_its_error_quotes_is_not_said_again() {
        let quoted = anyhow!("no such file").context("a.holo: opening: no such file");
        assert_eq!(said_once(quoted.as_ref()), "a.holo: opening: no such file");
        let plain = Err::<(), _>(anyhow!("no such file")).context("reading a.toml").unwrap_err();
        assert_eq!(said_once(plain.as_ref()), "reading a.toml: no such file");
    }
}
