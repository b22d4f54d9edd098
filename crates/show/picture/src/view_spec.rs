//! The parts of a view that a person, a script or a Radiance file states; later words override
//! earlier ones.
//!
//! One parser serves `--vp 1,2,3`, `view -vp 1 2 3 -vh 60`, `.vf` files and `VIEW=` lines. Every
//! number in a [`ViewSpec`] is finite. [`ViewSpec::resolve`] decides whether they make a view.

use crate::error::PictureError;
use crate::files::Format;
use crate::kind::ViewKind;
use crate::picture::Picture;
use crate::view::{View, ViewParameters};
use crate::view_error::ViewError;
use glam::DVec3;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Parts of a view; `None` means not stated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewSpec {
    /// `-vt`: type; perspective if not stated.
    pub kind: Option<ViewKind>,
    /// `-vp`: eye.
    pub vp: Option<DVec3>,
    /// `-vd`: direction. Its length (Radiance's focus distance) is ignored.
    pub vd: Option<DVec3>,
    /// `-vu`: up.
    pub vu: Option<DVec3>,
    /// `-vh`: full horizontal angle, degrees; width of a parallel view, scene units.
    pub vh: Option<f64>,
    /// `-vv`: full vertical angle, degrees; height of a parallel view, scene units.
    pub vv: Option<f64>,
    /// `-vo`: fore clipping distance, scene units; 0: none.
    pub vo: Option<f64>,
    /// `-va`: aft clipping distance, scene units; 0: none.
    pub va: Option<f64>,
    /// `-vs`: shift to the right, in widths of the picture.
    pub vs: Option<f64>,
    /// `-vl`: lift, in heights of the picture.
    pub vl: Option<f64>,
}

/// Longest text that is searched for a view. A view file has one line, and 1 MiB exceeds any
/// picture header.
const MAX_TEXT: usize = 1 << 20;

/// First words of lines that contain a view: programs that write their options into a picture's
/// header.
const PROGRAMS: [&str; 8] =
    ["rview", "rvu", "rpict", "rpiece", "rholo", "rhpict", "rtpict", "view"];

impl ViewSpec {
    /// Applies one option. `option` is its name with or without dashes; `value` holds its numbers,
    /// separated by commas or spaces, as in `apply_option("--vp", "1,2,3")`.
    ///
    /// # Errors
    /// An unknown option, a wrong number of numbers, a number that is not finite, or an unknown
    /// view type.
    pub fn apply_option(&mut self, option: &str, value: &str) -> Result<(), ViewError> {
        let name = option.trim_start_matches('-');
        let shown = || format!("--{name}");
        let words: Vec<&str> = value
            .split(|c: char| c == ',' || c.is_whitespace())
            .filter(|w| !w.is_empty())
            .collect();
        if name == "vt" {
            return self.set_kind(value.trim());
        }
        let wanted = arity(name).ok_or_else(|| ViewError::UnknownOption(option.to_owned()))?;
        if words.len() != wanted {
            return Err(ViewError::Count { option: shown(), wanted, found: words.len() });
        }
        self.set(name, &shown(), &words)
    }

    /// Applies a line of options such as `-vp 12.5 .5 5 -vd .7 .7 0 -vh 60`. Every word must be an
    /// option or belong to one.
    ///
    /// # Errors
    /// The errors of [`ViewSpec::apply_option`]. The options before the wrong one have then been
    /// applied.
    pub fn apply_line(&mut self, line: &str) -> Result<(), ViewError> {
        self.apply_words(line, true)
    }

    /// Returns this view with everything that `later` states. If `later` changes the type, this
    /// view's sizes are dropped, because they would mean something else.
    #[must_use]
    pub fn overridden_by(&self, later: &ViewSpec) -> ViewSpec {
        let is_other = later.kind.is_some_and(|kind| kind != self.kind.unwrap_or_default());
        let sizes = if is_other { ViewSpec::default() } else { *self };
        ViewSpec {
            kind: later.kind.or(self.kind),
            vp: later.vp.or(self.vp),
            vd: later.vd.or(self.vd),
            vu: later.vu.or(self.vu),
            vh: later.vh.or(sizes.vh),
            vv: later.vv.or(sizes.vv),
            vo: later.vo.or(self.vo),
            va: later.va.or(self.va),
            vs: later.vs.or(self.vs),
            vl: later.vl.or(self.vl),
        }
    }

    /// Returns the view and the size of its picture, as [`View::resolve`] does. `-vu` defaults to
    /// +z, as in Radiance.
    ///
    /// # Errors
    /// The errors of [`View::resolve`], a missing `-vp` or `-vd`, clipping surfaces that hide
    /// everything, sizes that the type does not allow, and a parallel view without a size.
    pub fn resolve(&self, max_size: (u32, u32)) -> Result<(View, (u32, u32)), ViewError> {
        let vp = self.vp.ok_or(ViewError::Missing("-vp"))?;
        let vd = self.vd.ok_or(ViewError::Missing("-vd"))?;
        let frame = ViewParameters {
            kind: self.kind.unwrap_or_default(),
            vh: self.vh,
            vv: self.vv,
            vs: self.vs.unwrap_or(0.0),
            vl: self.vl.unwrap_or(0.0),
            vo: self.vo.unwrap_or(0.0),
            va: self.va.unwrap_or(0.0),
        };
        View::fitted(vp, vd, self.vu.unwrap_or(DVec3::Z), &frame, max_size)
    }

    /// Applies one line of a Radiance header or view file if it contains a view; returns whether it
    /// does.
    ///
    /// As in Radiance, the line must begin with `VIEW=` or the name of a program that takes a view.
    /// So an indented line, which describes an original picture, does not count. Words that are not
    /// view options are ignored.
    pub(crate) fn apply_header_line(&mut self, line: &str) -> Result<bool, ViewError> {
        let rest = match line.strip_prefix("VIEW=") {
            Some(rest) => rest,
            None => {
                let (program, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
                let name = program.rsplit(['/', '\\']).next().unwrap_or(program);
                if !PROGRAMS.contains(&name.trim_end_matches(".exe")) {
                    return Ok(false);
                }
                rest
            }
        };
        let mut changed = *self;
        changed.apply_words(rest, false)?;
        // A program's line without any view option (`rpict -ab 2 scene.oct`) is no view.
        let is_view = rest.split_whitespace().any(|word| option_name(word).is_some());
        *self = changed;
        Ok(is_view)
    }

    fn apply_words(&mut self, line: &str, strict: bool) -> Result<(), ViewError> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut at = 0;
        while let Some(&word) = words.get(at) {
            at += 1;
            let Some(name) = option_name(word) else {
                if strict {
                    return Err(ViewError::UnknownOption(word.to_owned()));
                }
                continue;
            };
            if let Some(letter) = name.strip_prefix("vt") {
                // `-vt c` is accepted besides Radiance's `-vtc`.
                let next = words.get(at).filter(|word| option_name(word).is_none());
                let separate = next.filter(|_| letter.is_empty());
                at += usize::from(separate.is_some());
                self.set_kind(separate.copied().unwrap_or(letter))?;
                continue;
            }
            let wanted = arity(name).unwrap_or(0);
            let found = words[at..]
                .iter()
                .take(wanted)
                .take_while(|word| option_name(word).is_none())
                .count();
            if found < wanted {
                return Err(ViewError::Count { option: word.to_owned(), wanted, found });
            }
            self.set(name, word, &words[at..at + wanted])?;
            at += wanted;
        }
        Ok(())
    }

    fn set_kind(&mut self, kind: &str) -> Result<(), ViewError> {
        if kind == "s" {
            return Err(ViewError::Planispheric);
        }
        let mut letters = kind.chars();
        let known =
            letters.next().filter(|_| letters.next().is_none()).and_then(ViewKind::from_letter);
        self.kind = Some(known.ok_or_else(|| ViewError::UnsupportedKind(kind.to_owned()))?);
        Ok(())
    }

    /// Sets the option `name` from exactly as many words as it takes.
    fn set(&mut self, name: &str, shown: &str, words: &[&str]) -> Result<(), ViewError> {
        let mut numbers = [0.0; 3];
        for (number, &word) in numbers.iter_mut().zip(words) {
            let parsed: Option<f64> = word.parse().ok();
            *number = parsed.filter(|x| x.is_finite()).ok_or_else(|| ViewError::Number {
                option: shown.to_owned(),
                word: word.to_owned(),
            })?;
        }
        let (vector, scalar) = (Some(DVec3::from_array(numbers)), Some(numbers[0]));
        match name {
            "vp" => self.vp = vector,
            "vd" => self.vd = vector,
            "vu" => self.vu = vector,
            "vh" => self.vh = scalar,
            "vv" => self.vv = scalar,
            "vo" => self.vo = scalar,
            "va" => self.va = scalar,
            "vs" => self.vs = scalar,
            "vl" => self.vl = scalar,
            _ => return Err(ViewError::UnknownOption(shown.to_owned())),
        }
        Ok(())
    }
}

impl View {
    /// Returns the view of a Radiance view file, such as `rview -vtv -vp 0 0 0 -vd 0 1 0 -vu 0 0 1
    /// -vh 60 -vv 45`. A line may also begin with the options themselves. Later lines override
    /// earlier ones.
    ///
    /// # Errors
    /// No view in the text, or one with an error; the error names the line.
    pub fn parse_vf(text: &str) -> Result<ViewSpec, ViewError> {
        if text.len() > MAX_TEXT {
            return Err(ViewError::NoView);
        }
        let (mut spec, mut found) = (ViewSpec::default(), false);
        for (index, line) in text.lines().enumerate() {
            let line = line.trim();
            let applied = if option_name(line.split_whitespace().next().unwrap_or("")).is_some() {
                spec.apply_line(line).map(|()| true)
            } else {
                spec.apply_header_line(line)
            };
            found |= applied
                .map_err(|error| ViewError::Line { line: index + 1, error: Box::new(error) })?;
        }
        if found { Ok(spec) } else { Err(ViewError::NoView) }
    }

    /// Reads a view from a view file, or from a picture that states its view (`.hdr`, `.exr`), as
    /// Radiance's `-vf` does.
    ///
    /// # Errors
    /// A file that cannot be read or states no view. The error names the file.
    pub fn read_vf(path: impl AsRef<Path>) -> Result<ViewSpec, PictureError> {
        let path = path.as_ref();
        let named = |error| PictureError::File { path: path.to_owned(), error: Box::new(error) };
        let mut bytes = Vec::new();
        File::open(path)
            .and_then(|file| file.take(MAX_TEXT as u64).read_to_end(&mut bytes))
            .map_err(|error| named(error.into()))?;
        if Format::of_bytes(&bytes) == Some(Format::Exr) {
            let view = Picture::read(path)?.view.ok_or_else(|| named(ViewError::NoView.into()))?;
            return View::parse_vf(&view.to_vf_options()).map_err(|error| named(error.into()));
        }
        // Pixels follow the header of a picture, which ends with an empty line.
        let is_picture = bytes.starts_with(b"#?");
        let header = bytes.windows(2).position(|two| two == b"\n\n").filter(|_| is_picture);
        let text = String::from_utf8_lossy(&bytes[..header.unwrap_or(bytes.len())]);
        View::parse_vf(&text).map_err(|error| named(error.into()))
    }
}

/// Returns the name of a view option without its dash (`vp`, `vtv`). `None` for other words, such
/// as negative numbers.
fn option_name(word: &str) -> Option<&str> {
    let name = word.strip_prefix('-')?;
    (arity(name).is_some() || (name.starts_with("vt") && name.len() <= 3)).then_some(name)
}

/// Returns how many numbers an option takes.
fn arity(name: &str) -> Option<usize> {
    match name {
        "vp" | "vd" | "vu" => Some(3),
        "vh" | "vv" | "vo" | "va" | "vs" | "vl" => Some(1),
        _ => None,
    }
}
