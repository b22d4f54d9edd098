//! A recorded walk: the sections, and where the eye is in every frame.
//!
//! The file has one item per line, a word and numbers. `sky R G B`; `section ORIGIN SIDES CELLS`,
//! three numbers each; `angle DEGREES`, horizontal. `key SECONDS X Y Z HEADING PITCH` is a position
//! with angles in degrees. Heading 0 is along +x, and grows counter-clockwise. Between keys,
//! positions and angles are interpolated linearly. `#` begins a comment.

use glam::DVec3;
use holo_picture::View;
use holo_section::{Section, SectionSpec, ViewClass};
use std::error::Error;

/// Frames per second.
pub const RATE: f64 = 30.0;

pub struct Walk {
    pub sky: [f32; 3],
    pub sections: Vec<Section>,
    angle: f64,
    keys: Vec<[f64; 6]>,
}

impl Walk {
    pub fn parse(text: &str) -> Result<Self, Box<dyn Error>> {
        let mut walk = Self { sky: [0.0; 3], sections: Vec::new(), angle: 60.0, keys: Vec::new() };
        for (number, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default();
            let Some((word, rest)) = line.trim().split_once(' ') else { continue };
            let numbers: Result<Vec<f64>, _> = rest.split_whitespace().map(str::parse).collect();
            let wrong = || format!("line {}: `{line}` is not understood", number + 1);
            match (word, numbers.map_err(|_| wrong())?.as_slice()) {
                ("sky", &[r, g, b]) => walk.sky = [r, g, b].map(|channel| channel as f32),
                ("angle", &[angle]) => walk.angle = angle,
                ("section", &[x, y, z, a, b, c, i, j, k]) => {
                    walk.sections.push(Section::new(SectionSpec {
                        origin: [x, y, z],
                        axes: [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]],
                        grid: [i, j, k].map(|cells| cells as u32),
                        class: ViewClass::Interior,
                        obstructions: true,
                    })?)
                }
                ("key", numbers) => walk.keys.push(numbers.try_into().map_err(|_| wrong())?),
                _ => return Err(wrong().into()),
            }
        }
        if walk.keys.len() < 2 { Err("a walk has two keys at least".into()) } else { Ok(walk) }
    }

    pub fn frames(&self) -> usize {
        self.keys.last().map_or(0, |last| (last[0] * RATE) as usize)
    }

    /// Returns the view of a frame; after the end, the last view.
    pub fn view(&self, frame: usize, size: (u32, u32)) -> Result<View, Box<dyn Error>> {
        let seconds = frame as f64 / RATE;
        let next =
            self.keys.iter().position(|key| key[0] > seconds).unwrap_or(self.keys.len() - 1).max(1);
        let (from, to) = (&self.keys[next - 1], &self.keys[next]);
        let share = ((seconds - from[0]) / (to[0] - from[0])).clamp(0.0, 1.0);
        let [_, x, y, z, heading, pitch] =
            [0, 1, 2, 3, 4, 5].map(|i| from[i] + share * (to[i] - from[i]));
        let (heading, pitch) = (heading.to_radians(), pitch.to_radians());
        let along =
            DVec3::new(heading.cos() * pitch.cos(), heading.sin() * pitch.cos(), pitch.sin());
        Ok(View::new(DVec3::new(x, y, z), along, DVec3::Z, Some(self.angle), None, size)?)
    }
}
