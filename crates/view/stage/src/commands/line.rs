//! Command lines: inputs to the stage, in words.

use std::path::Path;

use clap::ValueEnum;
use glam::DVec3;
use holo_options::parse_size;
use holo_picture::{Format, ViewSpec};
use holo_session::{DriverArg, LightChange, ObjectOrder};

use crate::{Input, Named};

/// Most bytes in the name of a view.
const MOST_NAME: usize = 60;

/// All command lines, as help for people.
const LINES: &str = "home, back, forward, view OPTIONS, view NAME, go X Y Z, lock, unlock, \
    solid, ghost, leave, \
    size WxH, pause, resume, kill workers, restart workers, driver NAME, with PART, without PART, keep NAME, forget NAME, restore, \
    picture FILE, picture FILE WxH, object add FILE at X Y Z, object move|turn|scale NAME to|by …, \
    object bake NAME, object remove NAME, object list, sky SKY OPTION VALUE …, lamp NAME FACTOR, restart (twice), start over (twice), cancel, quit";

/// Parses a command line.
///
/// # Errors
/// A text for the user, if the line is not a command.
pub fn parse(line: &str) -> Result<Input, String> {
    let line = line.trim();
    let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = rest.trim();
    let plain = match line {
        "home" => Some(Input::Home),
        "back" => Some(Input::Back),
        "forward" => Some(Input::Forward),
        "lock" => Some(Input::LockHeight(true)),
        "unlock" => Some(Input::LockHeight(false)),
        "solid" => Some(Input::Solid(true)),
        "ghost" => Some(Input::Solid(false)),
        "leave" => Some(Input::Leave),
        "pause" => Some(Input::Pause(true)),
        "resume" => Some(Input::Pause(false)),
        "kill workers" => Some(Input::KillWorkers),
        "restart workers" => Some(Input::RestartWorkers),
        "restart" => Some(Input::Restart),
        "start over" => Some(Input::StartOver),
        "restore" => Some(Input::RestoreView),
        "cancel" => Some(Input::Cancel),
        "quit" => Some(Input::Quit),
        _ => None,
    };
    if let Some(input) = plain {
        return Ok(input);
    }
    match word {
        "view" if rest.starts_with('-') => view(rest),
        "view" => named(rest).map(Input::Recall),
        "go" => place(rest).map(Input::GoTo),
        "size" => parse_size(rest).map(|(width, height)| Input::Size(width, height)),
        "driver" => driver(rest).map(Input::Driver),
        "with" => parts(rest).map(|parts| Input::Switch(parts, true)),
        "without" => parts(rest).map(|parts| Input::Switch(parts, false)),
        "keep" => name(rest).map(Input::Keep),
        "forget" => name(rest).map(Input::Forget),
        "picture" => picture(rest),
        "object" => ObjectOrder::parse(rest).map(Input::Object),
        "sky" => LightChange::parse_sky(rest).map(Input::Light),
        "lamp" => LightChange::parse_lamp(rest).map(Input::Light),
        _ => Err(format!("`{line}` is no command. Commands: {LINES}")),
    }
}

fn picture(text: &str) -> Result<Input, String> {
    let sized = text.rsplit_once(char::is_whitespace);
    let sized = sized.and_then(|(file, size)| Some((file.trim_end(), parse_size(size).ok()?)));
    let (file, size) = sized.map_or((text, None), |(file, size)| (file, Some(size)));
    match Format::of_path(Path::new(file)) {
        Some(_) => Ok(Input::Picture(file.into(), size)),
        None => Err("`picture` needs a file that ends with .png, .exr, .hdr or .pfm".to_owned()),
    }
}

fn view(options: &str) -> Result<Input, String> {
    let mut view = ViewSpec::default();
    view.apply_line(options).map_err(|error| error.to_string())?;
    Ok(Input::View(Box::new(view)))
}

fn named(text: &str) -> Result<Named, String> {
    match text.parse() {
        Ok(number) => Ok(Named::Number(number)),
        Err(_) => name(text).map(Named::Name),
    }
}

/// Checks the name of a view: it must be printable, on one line, and not a word with another
/// meaning.
fn name(text: &str) -> Result<String, String> {
    let is_sound = !text.is_empty() && text.len() <= MOST_NAME && !text.contains(char::is_control);
    if !is_sound {
        return Err(format!("a view's name has 1 to {MOST_NAME} bytes on one line"));
    }
    if text.starts_with('-') || text.parse::<usize>().is_ok() {
        return Err(format!("`{text}` cannot be a view's name: it reads as options or a number"));
    }
    Ok(text.to_owned())
}

fn place(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if DVec3::new(x, y, z).is_finite() => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("`{text}` is no place: write three numbers, such as 1 2 1.6")),
    }
}

/// Parses names of parts of a driver, separated by commas. The driver knows which it has.
fn parts(text: &str) -> Result<Vec<String>, String> {
    let parts: Vec<String> = text.split(',').map(|part| part.trim().to_owned()).collect();
    let is_name = |part: &String| {
        (1..=MOST_NAME).contains(&part.len())
            && part.chars().all(|sign| sign.is_ascii_alphanumeric() || sign == '-')
    };
    match parts.iter().all(is_name) {
        true => Ok(parts),
        false => Err(format!("`{text}` names no part: write such as `without prefilter`")),
    }
}

fn driver(text: &str) -> Result<DriverArg, String> {
    DriverArg::from_str(text, false).map_err(|_| {
        format!("there is no driver `{text}`; drivers: {}", DriverArg::names().join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_keys_and_buttons_do() {
        for (line, input) in [
            (" home ", Input::Home),
            ("pause", Input::Pause(true)),
            ("resume", Input::Pause(false)),
            ("kill workers", Input::KillWorkers),
            ("restart", Input::Restart),
            ("start over", Input::StartOver),
            ("driver quadtree", Input::Driver(DriverArg::Quadtree)),
            ("view 3", Input::Recall(Named::Number(3))),
            ("view the hall", Input::Recall(Named::Name("the hall".to_owned()))),
            ("keep the hall", Input::Keep("the hall".to_owned())),
            ("go 1 -2 1.6", Input::GoTo(DVec3::new(1.0, -2.0, 1.6))),
            ("size 640x480", Input::Size(640, 480)),
            ("picture a b.png", Input::Picture("a b.png".into(), None)),
            ("picture a b.exr 64x36", Input::Picture("a b.exr".into(), Some((64, 36)))),
            ("object list", Input::Object(ObjectOrder::List)),
            ("object bake a chair", Input::Object(ObjectOrder::Bake("a chair".into()))),
            ("object remove a chair", Input::Object(ObjectOrder::Remove("a chair".into()))),
            ("quit", Input::Quit),
            ("sky clear north 3", Input::Light(LightChange::parse_sky("clear north 3").unwrap())),
            ("lamp a b 0.5", Input::Light(LightChange::parse_lamp("a b 0.5").unwrap())),
            ("with dither", Input::Switch(vec!["dither".into()], true)),
            (
                "without dither, depth-cull",
                Input::Switch(vec!["dither".into(), "depth-cull".into()], false),
            ),
        ] {
            assert_eq!(parse(line), Ok(input), "{line}");
        }
        let Ok(Input::View(view)) = parse("view -vp 1 2 3") else { panic!("a view") };
        assert_eq!(view.vp, Some(DVec3::new(1.0, 2.0, 3.0)));
    }

    #[test]
    fn unknown_lines_are_refused_with_a_reason() {
        for (line, reason) in [
            ("", "Commands: home"),
            ("fly", "`fly` is no command"),
            ("home now", "no command"),
            ("view", "name has"),
            ("view -vp 1 2", "-vp"),
            ("keep 3", "reads as options or a number"),
            ("keep -vp", "reads as options"),
            ("keep a\u{1b}b", "on one line"),
            ("go 1 2", "three numbers"),
            ("go 1 2 inf", "three numbers"),
            ("size 0x5", ""),
            ("driver fast", "drivers: surfaces"),
            ("without", "names no part"),
            ("with a,,b", "names no part"),
            ("object", "write `object add"),
            ("sky", "such as `sky clear"),
            ("lamp ceiling", "such as `lamp ceiling 0.5`"),
            ("picture", "needs a file"),
            ("picture a.txt 64x36", "needs a file"),
        ] {
            let error = parse(line).unwrap_err();
            assert!(error.contains(reason), "{line}: {error}");
        }
    }
}
