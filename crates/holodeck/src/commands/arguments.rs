//! Rewrites words of the command line that clap does not understand by itself.

use std::{ffi::OsString, iter::Peekable, path::PathBuf};

use clap::builder::{OsStringValueParser, TypedValueParser};
use holo_picture::Format;

/// Radiance's view options with numbers, and how many each takes.
const NUMBERS: [(&str, usize); 9] = [
    ("-vp", 3),
    ("-vd", 3),
    ("-vu", 3),
    ("-vh", 1),
    ("-vv", 1),
    ("-vs", 1),
    ("-vl", 1),
    ("-vo", 1),
    ("-va", 1),
];

/// Rewrites view options that are written as in Radiance: `-vtc -vp 1 2 3` becomes `--vt=c
/// --vp=1,2,3`. All other words stay the same.
pub fn with_view_options(words: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut words = words.into_iter().peekable();
    let mut rewritten = Vec::new();
    while let Some(word) = words.next() {
        let text = word.to_str().unwrap_or_default();
        let count = NUMBERS.iter().find(|(name, _)| *name == text).map(|(_, count)| *count);
        match (count, text.strip_prefix("-vt")) {
            (Some(count), _) => {
                rewritten.push(format!("-{text}={}", numbers(&mut words, count)).into());
            }
            (None, Some("")) => rewritten.push("--vt".into()),
            (None, Some(kind)) if kind.chars().count() == 1 => {
                rewritten.push(format!("--vt={kind}").into());
            }
            (None, _) if text == "-vf" => rewritten.push("--vf".into()),
            (None, _) => rewritten.push(word),
        }
    }
    rewritten
}

/// Removes up to `count` numbers from the words, and joins them by commas.
///
/// If there are too few, the option's own check reports the mistake. Numbers with commas between
/// them are one word already.
fn numbers(words: &mut Peekable<impl Iterator<Item = OsString>>, count: usize) -> String {
    let mut found: Vec<String> = Vec::new();
    while found.len() < count {
        let is_number = |word: &OsString| {
            word.to_str()
                .is_some_and(|word| word.split(',').all(|part| part.parse::<f64>().is_ok()))
        };
        let Some(word) = words.next_if(is_number) else { break };
        found.extend(word.to_str().unwrap_or_default().split(',').map(str::to_owned));
    }
    found.join(",")
}

/// Returns the parser of the path of a picture to write. Its extension must name a format, and its
/// folder must exist. The name need not be UTF-8.
///
/// A mistake is thus reported before the work instead of after it.
pub fn picture_path() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().try_map(|path| checked_picture_path(path.into()))
}

fn checked_picture_path(path: PathBuf) -> Result<PathBuf, String> {
    if Format::of_path(&path).is_none() {
        let name = path.display();
        return Err(format!("pictures are written as .exr, .hdr, .pfm or .png, not as `{name}`"));
    }
    match path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        Some(folder) if !folder.is_dir() => Err(format!("there is no folder {}", folder.display())),
        _ => Ok(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rewritten(line: &str) -> String {
        let words = with_view_options(line.split(' ').map(OsString::from));
        words.join(&OsString::from(" ")).into_string().unwrap()
    }

    #[test]
    fn view_options_may_be_written_as_in_radiance() {
        for (radiance, ours) in [
            ("picture a.holo -vtc -vp 1 -2 3 -vh 60 -o a.png", {
                "picture a.holo --vt=c --vp=1,-2,3 --vh=60 -o a.png"
            }),
            ("-vt a -vf v.vf", "--vt a --vf v.vf"),
            ("-vd 0,0,1 -vs -.5", "--vd=0,0,1 --vs=-.5"),
            ("-vp 1 2 -vd 1 0 0", "--vp=1,2 --vd=1,0,0"),
            ("-vh wide", "--vh= wide"),
            ("--vp 1,2,3 --vt c -q --view left", "--vp 1,2,3 --vt c -q --view left"),
        ] {
            assert_eq!(rewritten(radiance), ours);
        }
    }

    #[test]
    fn a_picture_that_could_not_be_written_is_refused_by_its_name() {
        assert!(checked_picture_path("x.jpg".into()).unwrap_err().contains("x.jpg"));
        assert!(checked_picture_path("nowhere/x.png".into()).unwrap_err().contains("nowhere"));
        assert!(checked_picture_path("x".into()).is_err());
        assert_eq!(checked_picture_path("x.png".into()), Ok(PathBuf::from("x.png")));
    }
}
