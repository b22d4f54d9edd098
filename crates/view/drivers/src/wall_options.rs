//! Options of a wall.

use clap::Args;
use holo_stereo::{Wall, WallScreen};

/// Most characters of a screen's name.
const MOST_NAME: usize = 32;

/// The screens of a wall.
#[derive(Args, Clone, Debug, Default)]
pub struct WallArgs {
    /// Show what the eye sees through this screen of a wall; once for each screen. Edges are
    /// lengths from the point of the screen's plane that is nearest to the eye, at DISTANCE, TURN
    /// degrees to the right and TILT degrees up. A page shows one screen: ?screen=NAME
    #[arg(
        long = "screen",
        value_name = "NAME=LEFT,RIGHT,BOTTOM,TOP,DISTANCE[,TURN[,TILT]]",
        value_parser = NamedScreen::parse
    )]
    pub screens: Vec<NamedScreen>,
}

/// A screen of a wall, and its name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedScreen {
    /// Lower-case letters, digits and hyphens.
    pub name: String,
    /// The screen.
    pub screen: WallScreen,
}

impl NamedScreen {
    /// Parses `NAME=LEFT,RIGHT,BOTTOM,TOP,DISTANCE[,TURN[,TILT]]`.
    ///
    /// # Errors
    /// A text for the user.
    pub fn parse(text: &str) -> Result<NamedScreen, String> {
        let (name, screen) = text
            .split_once('=')
            .ok_or_else(|| format!("`{text}` has no NAME= before its numbers"))?;
        let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if name.is_empty() || name.len() > MOST_NAME || !name.chars().all(is_plain) {
            return Err(format!(
                "`{name}` is no name of a screen: use 1 to {MOST_NAME} small letters, digits and \
                 hyphens"
            ));
        }
        Ok(NamedScreen { name: name.to_owned(), screen: WallScreen::parse(screen)? })
    }
}

impl WallArgs {
    /// Refuses screens of one name, and too many.
    ///
    /// # Errors
    /// A text for the user.
    pub fn check(&self) -> Result<(), String> {
        let names = self.names();
        for (at, name) in names.iter().enumerate() {
            if names[..at].contains(name) {
                return Err(format!("two screens are named {name}"));
            }
        }
        match names.len() {
            0 => Ok(()),
            _ => self.made().map(drop),
        }
    }

    /// Returns the wall; `None` for one view.
    pub fn wall(&self) -> Option<Wall> {
        self.made().ok()
    }

    /// Returns the names of the screens, in order.
    pub fn names(&self) -> Vec<String> {
        self.screens.iter().map(|screen| screen.name.clone()).collect()
    }

    fn made(&self) -> Result<Wall, String> {
        Wall::new(self.screens.iter().map(|named| named.screen).collect())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::{DriverArgs, StereoArg, StereoArgs};

    #[test]
    fn screens_need_a_name_each() {
        for (text, reason) in [
            ("-1,1,-1,1,1", "no NAME="),
            ("=-1,1,-1,1,1", "no name"),
            ("Left=-1,1,-1,1,1", "no name"),
            ("left=-1,1", "2 numbers"),
        ] {
            let error = NamedScreen::parse(text).unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
        let left = NamedScreen::parse("left=-1,1,-1,1,1,-90").unwrap();
        let twice = WallArgs { screens: vec![left.clone(), left.clone()] };
        assert_eq!(twice.check().unwrap_err(), "two screens are named left");
        let one = WallArgs { screens: vec![left] };
        assert!(one.check().is_ok());
        assert_eq!((one.wall().unwrap().count(), one.names()), (1, vec!["left".to_owned()]));
        assert_eq!(WallArgs::default().wall(), None);
        // A picture shows the screens of one eye.
        let stereo = StereoArgs { stereo: Some(StereoArg::Anaglyph), ..StereoArgs::default() };
        let both = DriverArgs { stereo, wall: one, ..DriverArgs::default() };
        assert!(both.check().unwrap_err().contains("--screen"));
    }
}
