//! What a person says about local objects, in words: the same lines on a page, in a window and in
//! scripts.

use std::path::{Component, PathBuf};

use glam::DVec3;
use holo_local_objects::ObjectPose;

/// How an object is to be changed.
#[derive(Clone, Debug, PartialEq)]
pub enum ObjectOrder {
    /// Carries a model into the scene.
    Add {
        /// The model's file.
        path: PathBuf,
        /// The object's name; by default that of the file.
        name: Option<String>,
        /// Where it is put.
        pose: ObjectPose,
    },
    /// Changes an object's pose.
    Change(String, PoseChange),
    /// Takes an object away, be it carried or part of the scene.
    Remove(String),
    /// Makes an object part of the scene.
    Bake(String),
    /// Says which objects there are.
    List,
    /// Takes hold of the object that is seen at a place of the picture. Places are shares of the
    /// picture from its left and top.
    Grab([f64; 2]),
    /// Moves the object that is held along the plane of its base, so that it stays under this place
    /// of the picture.
    DragTo([f64; 2]),
    /// Turns the object that is seen at a place of the picture, degrees.
    Spin([f64; 2], f64),
}

/// A change of a pose: to a value, or by a difference or factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PoseChange {
    /// The middle of the base is here.
    MoveTo(DVec3),
    /// It is this much farther.
    MoveBy(DVec3),
    /// Degrees around the up axis.
    TurnTo(f64),
    /// The same, more.
    TurnBy(f64),
    /// Factor to the model's size.
    ScaleTo(f64),
    /// The same, times the present one.
    ScaleBy(f64),
}

impl PoseChange {
    /// Returns the changed pose.
    #[must_use]
    pub fn of(self, pose: ObjectPose) -> ObjectPose {
        match self {
            Self::MoveTo(at) => ObjectPose { at, ..pose },
            Self::MoveBy(by) => ObjectPose { at: pose.at + by, ..pose },
            Self::TurnTo(turn) => ObjectPose { turn, ..pose },
            Self::TurnBy(by) => ObjectPose { turn: (pose.turn + by) % 360.0, ..pose },
            Self::ScaleTo(scale) => ObjectPose { scale, ..pose },
            Self::ScaleBy(factor) => ObjectPose { scale: pose.scale * factor, ..pose },
        }
    }
}

/// The forms of lines, for people.
const FORMS: &str = "write `object add FILE at X Y Z [turn DEGREES] [scale FACTOR] [as NAME]`, \
    `object move NAME to|by X Y Z`, `object turn NAME to|by DEGREES`, \
    `object scale NAME to|by FACTOR`, `object bake NAME`, `object remove NAME` or `object list`";

impl ObjectOrder {
    /// Parses what follows `object` in a command line.
    ///
    /// # Errors
    /// A text for the user, if it is no such order.
    pub fn parse(text: &str) -> Result<ObjectOrder, String> {
        let text = text.trim();
        let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let rest = rest.trim();
        match word {
            "add" => add(rest),
            "move" => change(rest, |is_to, words| {
                let place = place(words)?;
                Ok(if is_to { PoseChange::MoveTo(place) } else { PoseChange::MoveBy(place) })
            }),
            "turn" => change(rest, |is_to, words| {
                let angle = number(words, "an angle in degrees, such as 90")?;
                Ok(if is_to { PoseChange::TurnTo(angle) } else { PoseChange::TurnBy(angle) })
            }),
            "scale" => change(rest, |is_to, words| {
                let factor = number(words, "a factor, such as 1.5")?;
                Ok(if is_to { PoseChange::ScaleTo(factor) } else { PoseChange::ScaleBy(factor) })
            }),
            "remove" if !rest.is_empty() => Ok(ObjectOrder::Remove(rest.to_owned())),
            "bake" if !rest.is_empty() => Ok(ObjectOrder::Bake(rest.to_owned())),
            "list" if rest.is_empty() => Ok(ObjectOrder::List),
            _ => Err(format!("`object {text}` is no command: {FORMS}")),
        }
    }

    /// Returns whether the order names no file, or one without any folder.
    #[must_use]
    pub fn names_plain_file(&self) -> bool {
        let ObjectOrder::Add { path, .. } = self else { return true };
        let mut parts = path.components();
        matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None))
    }

    /// Parses `FILE@X,Y,Z[,TURN[,SCALE]]`, as options have it.
    ///
    /// # Errors
    /// A text for the user, if it is no such option.
    pub fn parse_option(text: &str) -> Result<ObjectOrder, String> {
        let problem = || {
            format!(
                "`{text}` is no object: write FILE@X,Y,Z[,TURN[,SCALE]], such as \
                 chair.glb@1,2,0,90"
            )
        };
        let (path, pose) = text.rsplit_once('@').ok_or_else(problem)?;
        let numbers: Result<Vec<f64>, _> = pose.split(',').map(|n| n.trim().parse()).collect();
        let (at, turn, scale) = match numbers.as_deref() {
            Ok(&[x, y, z]) => (DVec3::new(x, y, z), 0.0, 1.0),
            Ok(&[x, y, z, turn]) => (DVec3::new(x, y, z), turn, 1.0),
            Ok(&[x, y, z, turn, scale]) => (DVec3::new(x, y, z), turn, scale),
            _ => return Err(problem()),
        };
        let pose = checked(ObjectPose { at, turn, scale })?;
        match path.is_empty() {
            true => Err(problem()),
            false => Ok(ObjectOrder::Add { path: path.into(), name: None, pose }),
        }
    }
}

fn checked(pose: ObjectPose) -> Result<ObjectPose, String> {
    pose.check().map(|()| pose).map_err(|error| error.to_string())
}

fn add(text: &str) -> Result<ObjectOrder, String> {
    let problem = || format!("`object add {text}` has no place: {FORMS}");
    let (path, rest) = text.rsplit_once(" at ").ok_or_else(problem)?;
    let (rest, name) = match rest.split_once(" as ") {
        Some((rest, name)) => (rest, Some(name.trim().to_owned())),
        None => (rest, None),
    };
    if name.as_ref().is_some_and(String::is_empty) || path.trim().is_empty() {
        return Err(problem());
    }
    let words: Vec<&str> = rest.split_whitespace().collect();
    let (at, further) = words.split_at_checked(3).ok_or_else(problem)?;
    let mut pose = ObjectPose::at(place(at)?);
    for pair in further.chunks(2) {
        match *pair {
            ["turn", angle] => pose.turn = number(&[angle], "an angle in degrees, such as 90")?,
            ["scale", factor] => pose.scale = number(&[factor], "a factor, such as 1.5")?,
            _ => return Err(format!("`{}` is no part of a pose: {FORMS}", pair.join(" "))),
        }
    }
    Ok(ObjectOrder::Add { path: path.trim().into(), name, pose: checked(pose)? })
}

/// Parses `NAME to VALUE` or `NAME by VALUE`.
fn change(
    text: &str,
    parse: impl Fn(bool, &[&str]) -> Result<PoseChange, String>,
) -> Result<ObjectOrder, String> {
    let found = [" to ", " by "].into_iter().filter_map(|word| {
        let (name, value) = text.rsplit_once(word)?;
        Some((name.trim(), word == " to ", value))
    });
    let found = found.max_by_key(|(name, ..)| name.len());
    let Some((name, is_to, value)) = found.filter(|(name, ..)| !name.is_empty()) else {
        return Err(format!("`{text}` says neither `to` nor `by`: {FORMS}"));
    };
    let words: Vec<&str> = value.split_whitespace().collect();
    Ok(ObjectOrder::Change(name.to_owned(), parse(is_to, &words)?))
}

fn place(words: &[&str]) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, _> = words.iter().map(|word| word.parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if DVec3::new(x, y, z).is_finite() => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("`{}` is no place: write three numbers, such as 1 2 0", words.join(" "))),
    }
}

fn number(words: &[&str], what: &str) -> Result<f64, String> {
    match words {
        [word] => word.parse().ok().filter(|number: &f64| number.is_finite()),
        _ => None,
    }
    .ok_or_else(|| format!("`{}` is not {what}", words.join(" ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_is_done_with_objects() {
        let pose = |turn, scale| ObjectPose { at: DVec3::new(1.0, -2.0, 0.0), turn, scale };
        let add = |name: Option<&str>, pose| ObjectOrder::Add {
            path: "my chair.glb".into(),
            name: name.map(Into::into),
            pose,
        };
        let change = |change| ObjectOrder::Change("the chair".into(), change);
        for (line, order) in [
            ("add my chair.glb at 1 -2 0", add(None, pose(0.0, 1.0))),
            ("add my chair.glb at 1 -2 0 turn 30 scale 2", add(None, pose(30.0, 2.0))),
            (
                "add my chair.glb at 1 -2 0 scale 2 as the chair",
                add(Some("the chair"), pose(0.0, 2.0)),
            ),
            ("move the chair to 1 2 3", change(PoseChange::MoveTo(DVec3::new(1.0, 2.0, 3.0)))),
            ("move the chair by 1 0 0", change(PoseChange::MoveBy(DVec3::X))),
            ("turn the chair by -15", change(PoseChange::TurnBy(-15.0))),
            ("scale the chair to 0.5", change(PoseChange::ScaleTo(0.5))),
            ("remove the chair", ObjectOrder::Remove("the chair".into())),
            ("bake the chair", ObjectOrder::Bake("the chair".into())),
            ("list", ObjectOrder::List),
        ] {
            assert_eq!(ObjectOrder::parse(line), Ok(order), "{line}");
        }
        assert_eq!(
            ObjectOrder::parse_option("my chair.glb@1,-2,0,30,2"),
            Ok(add(None, pose(30.0, 2.0)))
        );
        for (path, is_plain) in [("chair.glb", true), ("../chair.glb", false), ("/a/b.glb", false)]
        {
            let order = ObjectOrder::parse_option(&format!("{path}@1,2,3")).unwrap();
            assert_eq!(order.names_plain_file(), is_plain, "{path}");
        }
        let moved = PoseChange::MoveBy(DVec3::Z).of(pose(0.0, 1.0));
        assert_eq!(moved.at, DVec3::new(1.0, -2.0, 1.0));
    }

    #[test]
    fn other_lines_are_refused_with_a_reason() {
        for (line, reason) in [
            ("", "write `object add"),
            ("add chair.glb", "has no place"),
            ("add chair.glb at 1 2", "has no place"),
            ("add chair.glb at 1 2 nan", "is no place"),
            ("add chair.glb at 1 2 0 turn", "no part of a pose"),
            ("add chair.glb at 1 2 0 scale 0", "is no scale"),
            ("add chair.glb at 1e300 2 0", "is no place"),
            ("move chair 1 2 3", "neither `to` nor `by`"),
            ("turn chair to up", "is not an angle"),
            ("scale chair by inf", "is not a factor"),
            ("remove", "is no command"),
            ("bake", "is no command"),
        ] {
            let error = ObjectOrder::parse(line).unwrap_err();
            assert!(error.contains(reason), "{line}: {error}");
        }
        for option in ["chair.glb", "chair.glb@1,2", "@1,2,3", "a@1,2,x", "a@1,2,nan"] {
            assert!(ObjectOrder::parse_option(option).is_err(), "{option}");
        }
    }
}
