//! Changes of a scene's light, as people state them in lines.

use std::path::Path;

/// Options that a line `sky …` may state. The sky itself needs no word before it.
const WORDS: [&str; 8] =
    ["place", "at", "direct", "diffuse", "weather", "north", "ground", "illuminance"];

/// Value that takes an option back.
pub const NONE: &str = "none";

/// A change of a scene's light: options by their names, as on the command line without `--`. The
/// value [`NONE`] takes an option back.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightChange(Vec<(String, String)>);

impl LightChange {
    /// Parses the rest of a line `sky [SKY] [OPTION VALUE] …`, such as `clear at
    /// 2026-06-21T15:30+02:00 north 30`. Whoever has the scene checks the values.
    ///
    /// # Errors
    /// A text for the user, if an option has no value or is stated twice.
    pub fn parse_sky(text: &str) -> Result<LightChange, String> {
        let mut options: Vec<(String, String)> = Vec::new();
        for word in text.split_whitespace() {
            match options.last_mut() {
                _ if WORDS.contains(&word) => options.push((word.to_owned(), String::new())),
                None => options.push(("sky".to_owned(), word.to_owned())),
                // Names of files have blanks.
                Some((_, value)) if value.is_empty() => word.clone_into(value),
                Some((_, value)) => *value = format!("{value} {word}"),
            }
        }
        if options.is_empty() {
            return Err(format!(
                "write `sky` with a sky, options or both, such as `sky clear place 52.37,4.90 at \
                 2026-06-21T15:30+02:00`; options: {}",
                WORDS.join(", ")
            ));
        }
        for (at, (name, value)) in options.iter().enumerate() {
            if value.is_empty() {
                return Err(format!("`{name}` has no value; write it as for --{name}, or `none`"));
            }
            if options[..at].iter().any(|(before, _)| before == name) {
                return Err(format!("`{name}` is stated twice"));
            }
        }
        Ok(LightChange(options))
    }

    /// Parses the rest of a line `lamp NAME FACTOR`.
    ///
    /// # Errors
    /// A text for the user, if there is no number at the end.
    pub fn parse_lamp(text: &str) -> Result<LightChange, String> {
        let parts = text.rsplit_once(char::is_whitespace);
        let parts = parts.filter(|(_, factor)| factor.parse::<f32>().is_ok_and(f32::is_finite));
        let (name, factor) = parts.ok_or(
            "write `lamp` with a name and a factor, such as `lamp ceiling 0.5`; `sun` and `sky` \
             are names too",
        )?;
        Ok(LightChange(vec![("lamp".to_owned(), format!("{}={factor}", name.trim_end()))]))
    }

    /// Returns whether it changes nothing.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the options that it states.
    pub fn options(&self) -> &[(String, String)] {
        &self.0
    }

    /// Returns whether it names a file of the machine that has the scene.
    pub fn names_file(&self) -> bool {
        let is_picture = |value: &str| {
            let ending = Path::new(value).extension();
            ending.is_some_and(|end| {
                end.eq_ignore_ascii_case("hdr") || end.eq_ignore_ascii_case("exr")
            })
        };
        self.0.iter().any(|(name, value)| match name.as_str() {
            "weather" => value != NONE,
            "sky" => is_picture(value),
            _ => false,
        })
    }

    /// Adds a later change. It counts where both state the same.
    pub fn add(&mut self, later: LightChange) {
        for (name, value) in later.0 {
            let lamp = |value: &str| value.rsplit_once('=').map(|(lamp, _)| lamp.to_owned());
            let is_lamp = name == "lamp";
            self.0.retain(|(other, before)| {
                *other != name || (is_lamp && lamp(before) != lamp(&value))
            });
            self.0.push((name, value));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(line: &str) -> Vec<(String, String)> {
        LightChange::parse_sky(line).unwrap().0
    }

    fn owned(options: &[(&str, &str)]) -> Vec<(String, String)> {
        options.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
    }

    #[test]
    fn a_line_states_a_sky_and_options_by_their_names() {
        assert_eq!(
            sky("clear place 52.37,-4.9 at 2026-06-21 15:30+02:00 north -30"),
            owned(&[
                ("sky", "clear"),
                ("place", "52.37,-4.9"),
                ("at", "2026-06-21 15:30+02:00"),
                ("north", "-30")
            ])
        );
        assert_eq!(sky("my sky.hdr"), owned(&[("sky", "my sky.hdr")]));
        assert_eq!(sky("weather none"), owned(&[("weather", "none")]));
        for (line, reason) in
            [("", "such as `sky clear"), ("clear at", "`at` has no value"), ("at 1 at 2", "twice")]
        {
            let error = LightChange::parse_sky(line).unwrap_err();
            assert!(error.contains(reason), "{line}: {error}");
        }
    }

    #[test]
    fn a_line_states_the_factor_of_a_lamp_whose_name_may_have_blanks() {
        let lamp = LightChange::parse_lamp("the lamp by the door  0.5").unwrap();
        assert_eq!(lamp.0, owned(&[("lamp", "the lamp by the door=0.5")]));
        for line in ["", "ceiling", "0.5", "ceiling off", "ceiling nan"] {
            assert!(LightChange::parse_lamp(line).is_err(), "{line}");
        }
    }

    #[test]
    fn of_two_changes_the_later_one_counts_where_both_state_the_same() {
        let mut both = LightChange::parse_sky("clear at 1").unwrap();
        both.add(LightChange::parse_lamp("a 0.5").unwrap());
        both.add(LightChange::parse_lamp("b 1").unwrap());
        both.add(LightChange::parse_lamp("a 2").unwrap());
        both.add(LightChange::parse_sky("at 2").unwrap());
        let wanted = [("sky", "clear"), ("lamp", "b=1"), ("lamp", "a=2"), ("at", "2")];
        assert_eq!(both.0, owned(&wanted));
    }

    #[test]
    fn files_of_the_machine_are_known() {
        for (line, names) in [
            ("sky.HDR", true),
            ("weather a.epw", true),
            ("weather none", false),
            ("clear north 3", false),
        ] {
            assert_eq!(LightChange::parse_sky(line).unwrap().names_file(), names, "{line}");
        }
    }
}
