//! Scripts: lines of `SECONDS COMMAND`, with seconds since the last `view` line or the start.

use std::{
    path::{Path, PathBuf},
    sync::mpsc,
};

use anyhow::{Context, Result, bail};
use holo_picture::{Format, ViewSpec};
use holo_session::{LightChange, ObjectOrder};

/// The names of the parts of drivers that can be switched.
type Switches = &'static [&'static str];

/// A command of a script.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Changes the view; options that are not given keep their values.
    View(Box<ViewSpec>),
    /// Writes the picture in its current state.
    Picture(PathBuf),
    /// Reports what a pixel shows: column and row, from the left and the top.
    Probe(u32, u32),
    /// Switches parts of the driver on or off.
    Switch {
        /// Their names.
        parts: Vec<&'static str>,
        /// True to switch them on.
        on: bool,
    },
    /// Carries an object into the scene, or changes one.
    Object(ObjectOrder),
    /// Goes on with the scene in another light.
    Light(LightChange),
    /// Ends the session.
    Quit,
}

/// A command and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct ScriptStep {
    /// Seconds since the last `view` command or the start; `None` means at once.
    pub seconds: Option<f64>,
    /// The command.
    pub command: Command,
}

/// The source of a session's steps.
#[derive(Debug)]
pub enum Script {
    /// All steps, known from the start.
    Steps(std::vec::IntoIter<ScriptStep>),
    /// Steps typed while the session runs.
    Typed(mpsc::Receiver<Result<ScriptStep>>),
}

/// Seconds must be less than this, about 30 years, so that adding them to a clock cannot overflow.
const MAX_SECONDS: f64 = 1e9;

/// Longest script, bytes. A larger file is probably not a script.
const MAX_BYTES: u64 = 16 << 20;

impl Script {
    /// Reads a script file, or follows standard input for `-`. `switches` names the parts of
    /// drivers that can be switched.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is wrong (named as `file:line`).
    pub fn open(path: &Path, switches: Switches) -> Result<Script> {
        if path == Path::new("-") {
            return Ok(Script::typed(switches));
        }
        let name = path.display();
        let length = std::fs::metadata(path).with_context(|| format!("reading {name}"))?.len();
        if length > MAX_BYTES {
            bail!("{name} is {length} bytes long: not a script");
        }
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {name}"))?;
        Ok(Script::Steps(parse(&text, &name.to_string(), switches)?.into_iter()))
    }

    /// Returns a script that only waits.
    pub fn wait(seconds: f64) -> Script {
        Script::Steps(
            vec![ScriptStep { seconds: Some(seconds), command: Command::Quit }].into_iter(),
        )
    }

    fn typed(switches: Switches) -> Script {
        let (sender, receiver) = mpsc::channel();
        // A thread, because reading standard input cannot be cancelled.
        std::thread::spawn(move || {
            for line in std::io::stdin().lines() {
                let step = line.map_err(Into::into).and_then(|line| parse_line(&line, switches));
                if step.transpose().is_some_and(|step| sender.send(step).is_err()) {
                    return;
                }
            }
        });
        Script::Typed(receiver)
    }

    /// Returns the script's duration in seconds; 0 if the script is typed.
    pub fn duration(&self) -> f64 {
        let Script::Steps(steps) = self else { return 0.0 };
        let (mut before, mut since_view) = (0.0, 0.0f64);
        for step in steps.as_slice() {
            since_view = since_view.max(step.seconds.unwrap_or(0.0));
            if matches!(step.command, Command::View(_)) {
                before += std::mem::take(&mut since_view);
            }
        }
        before + since_view
    }

    /// Returns the next step, if it is known already.
    pub fn next_step(&mut self) -> Result<Next> {
        match self {
            Script::Steps(steps) => Ok(steps.next().map_or(Next::End, Next::Step)),
            Script::Typed(steps) => match steps.try_recv() {
                Ok(step) => Ok(Next::Step(step?)),
                Err(mpsc::TryRecvError::Empty) => Ok(Next::NotYet),
                Err(mpsc::TryRecvError::Disconnected) => Ok(Next::End),
            },
        }
    }
}

/// The state of a script.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// The next step.
    Step(ScriptStep),
    /// Nothing has been typed yet.
    NotYet,
    /// The script has ended.
    End,
}

fn parse(text: &str, name: &str, switches: Switches) -> Result<Vec<ScriptStep>> {
    let mut steps = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        if let Some(step) =
            parse_line(line, switches).with_context(|| format!("{name}:{number}"))?
        {
            steps.push(step);
        }
    }
    Ok(steps)
}

fn parse_line(line: &str, switches: Switches) -> Result<Option<ScriptStep>> {
    let line = line.split('#').next().unwrap_or_default().trim();
    if line.is_empty() {
        return Ok(None);
    }
    let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let (seconds, line) = match first.parse::<f64>() {
        Ok(seconds) if (0.0..MAX_SECONDS).contains(&seconds) => (Some(seconds), rest.trim()),
        Ok(_) => bail!("`{first}` is not a time: write seconds from 0 to 999999999"),
        Err(_) => (None, line),
    };
    let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = rest.trim();
    let command = match word {
        "view" => {
            let mut spec = ViewSpec::default();
            spec.apply_line(rest)?;
            Command::View(Box::new(spec))
        }
        "picture" if !rest.is_empty() => {
            if Format::of_path(Path::new(rest)).is_none() {
                bail!("pictures are written as .exr, .hdr, .pfm or .png, not as `{rest}`");
            }
            Command::Picture(rest.into())
        }
        "picture" => bail!("`picture` takes the name of a file, such as `picture a.pfm`"),
        "probe" => match pixel(rest) {
            Some((column, row)) => Command::Probe(column, row),
            None => bail!("`probe` takes a column and a row, such as `probe 320 240`"),
        },
        "with" | "without" => {
            Command::Switch { parts: parts(word, rest, switches)?, on: word == "with" }
        }
        "object" => Command::Object(ObjectOrder::parse(rest).map_err(anyhow::Error::msg)?),
        "sky" => Command::Light(LightChange::parse_sky(rest).map_err(anyhow::Error::msg)?),
        "lamp" => Command::Light(LightChange::parse_lamp(rest).map_err(anyhow::Error::msg)?),
        "quit" if rest.is_empty() => Command::Quit,
        "quit" => bail!("`quit` takes nothing; seconds come first, such as `20 quit`"),
        "" => bail!(
            "a time without a command; write `{first} view …`, `{first} picture FILE` or `{first} quit`"
        ),
        other => {
            bail!(
                "`{other}` is not a command; there are view, picture, probe, object, sky, lamp, with, \
                 without and quit"
            )
        }
    };
    Ok(Some(ScriptStep { seconds, command }))
}

/// Parses the names of parts such as `prefilter,dither`.
fn parts(command: &str, names: &str, switches: Switches) -> Result<Vec<&'static str>> {
    let known = || switches.join(", ");
    if names.is_empty() {
        bail!(
            "`{command}` takes parts of the render cache, such as `{command} prefilter,dither` \
             (there are {})",
            known()
        );
    }
    let part = |name: &str| {
        let part = switches.iter().copied().find(|known| *known == name);
        part.with_context(|| {
            format!("`{name}` is no part of the render cache (there are {})", known())
        })
    };
    names.split([',', ' ']).filter(|name| !name.is_empty()).map(part).collect()
}

/// Parses a column and a row.
fn pixel(text: &str) -> Option<(u32, u32)> {
    let mut numbers = text.split([',', ' ']).filter(|part| !part.is_empty()).map(str::parse);
    match (numbers.next(), numbers.next(), numbers.next()) {
        (Some(Ok(column)), Some(Ok(row)), None) => Some((column, row)),
        _ => None,
    }
}

/// Parses seconds such as `20`, `20s` or `2m`.
///
/// # Errors
/// A text for the user, if the text is not a time.
pub fn parse_seconds(text: &str) -> Result<f64, String> {
    let (number, factor) = match text.strip_suffix('m') {
        Some(minutes) => (minutes, 60.0),
        None => (text.strip_suffix('s').unwrap_or(text), 1.0),
    };
    let seconds = number.parse::<f64>().ok().map(|seconds| seconds * factor);
    let seconds = seconds.filter(|seconds| (0.0..MAX_SECONDS).contains(seconds));
    seconds.ok_or_else(|| format!("`{text}` is not a time; write 20s or 2m"))
}

#[cfg(test)]
mod tests {
    use holo_picture::View;

    use super::*;

    /// Parts of a driver.
    const PARTS: Switches = &["ageing", "prefilter", "depth-cull", "dither"];

    #[test]
    fn a_script_is_read_as_the_manual_describes_it() {
        let text = "0 view -vp 12.5 .5 5 -vd .7 .7 0 -vu 0 0 1 -vh 60\r\n\
                    # a comment\n\n0.1 picture a b.pfm\n1 picture b.pfm # another\n10 quit\n";
        let steps = parse(text, "walk.txt", PARTS).unwrap();
        assert_eq!(steps.len(), 4);
        let view = View::parse_vf("rview -vp 12.5 .5 5 -vd .7 .7 0 -vu 0 0 1 -vh 60").unwrap();
        assert_eq!(
            steps[0],
            ScriptStep { seconds: Some(0.0), command: Command::View(Box::new(view)) }
        );
        assert_eq!(
            steps[1],
            ScriptStep { seconds: Some(0.1), command: Command::Picture("a b.pfm".into()) }
        );
        assert_eq!(steps[3], ScriptStep { seconds: Some(10.0), command: Command::Quit });
        assert_eq!(Script::Steps(steps.into_iter()).duration(), 10.0);
        let twice =
            parse("1 picture a.pfm\n2 view -vh 50\n3 picture b.pfm\n4 quit", "walk.txt", PARTS)
                .unwrap();
        assert_eq!(Script::Steps(twice.into_iter()).duration(), 6.0);
        assert_eq!(
            parse_line("quit", PARTS).unwrap(),
            Some(ScriptStep { seconds: None, command: Command::Quit })
        );
    }

    #[test]
    fn parts_are_switched_by_name() {
        let switch = |line| parse_line(line, PARTS).unwrap().unwrap();
        let parts = vec!["prefilter", "depth-cull"];
        let without = Command::Switch { parts, on: false };
        assert_eq!(
            switch("2 without prefilter,depth-cull"),
            ScriptStep { seconds: Some(2.0), command: without.clone() }
        );
        assert_eq!(switch("without prefilter, depth-cull").command, without);
        assert_eq!(
            switch("with dither").command,
            Command::Switch { parts: vec!["dither"], on: true }
        );
    }

    #[test]
    fn a_wrong_line_is_named() {
        for (line, part) in [
            ("1 pictures a.pfm", "not a command"),
            ("1", "without a command"),
            ("-1 quit", "not a time"),
            ("1e300 quit", "not a time"),
            ("1e19 quit", "not a time"),
            ("1 probe 3", "a column and a row"),
            ("1 picture a.jpg", ".exr, .hdr, .pfm or .png"),
            ("1 picture", "takes the name"),
            ("1 view -vp 1 2", "-vp"),
            ("1 quit now", "`quit` takes nothing"),
            ("1 object fly", "`object fly` is no command"),
            ("1 sky at", "`at` has no value"),
            ("1 lamp ceiling", "such as `lamp ceiling 0.5`"),
            ("1 without", "such as `without prefilter,dither`"),
            ("1 with colour", "`colour` is no part of the render cache (there are ageing, "),
        ] {
            let error =
                format!("{:#}", parse(&format!("\n{line}\n"), "walk.txt", PARTS).unwrap_err());
            assert!(error.starts_with("walk.txt:2") && error.contains(part), "{error}");
        }
    }
}
