//! Loads the whole file: stored samples that no view has requested arrive in parts, while the
//! session has nothing else to do. Light for later views is then already here.
//!
//! Invariants:
//! - At most one part is under way. A new view waits for that part at the most.
//! - Nothing is loaded while the eye moves, or before all stored samples of the view have arrived.

use std::time::Instant;

use glam::DVec3;
use holo_section::Section;

mod loading;

/// Progress of loading the file.
pub struct Ahead {
    /// For each section, the number of the next beam to load. `None` once all are loaded.
    next: Vec<Option<u64>>,
    /// When the part under way was requested.
    asked: Option<Instant>,
    /// When the first part was requested.
    began: Option<Instant>,
    /// True if loading was restarted after that part was requested.
    is_stale: bool,
    /// When the next part may be requested.
    resumes: Instant,
    /// Samples in the file that had not arrived when loading ended, such as damaged ones.
    missing: u64,
}

impl Ahead {
    /// Returns the state before anything is loaded.
    pub fn new(sections: usize) -> Ahead {
        Ahead {
            next: vec![Some(0); sections],
            asked: None,
            began: None,
            is_stale: false,
            resumes: Instant::now(),
            missing: 0,
        }
    }

    /// Starts loading from the beginning.
    pub fn restart(&mut self) {
        self.is_stale = self.asked.is_some();
        self.next.fill(Some(0));
    }

    /// Returns whether the whole file was loaded.
    fn is_done(&self) -> bool {
        self.next.iter().all(Option::is_none)
    }

    /// Returns the next part to load: a section and the number of its first beam. Sections near the
    /// eye come first.
    fn part(&self, sections: &[Section], eye: DVec3) -> Option<(usize, u64)> {
        let parts = self.next.iter().enumerate().filter_map(|(at, next)| next.map(|n| (at, n)));
        let away = |at: usize| {
            let middle = sections[at].local_to_world(DVec3::splat(0.5));
            if sections[at].contains(eye) { 0.0 } else { middle.distance(eye) }
        };
        parts.min_by(|(one, _), (other, _)| away(*one).total_cmp(&away(*other)))
    }
}

#[cfg(test)]
mod tests {
    use holo_section::{SectionSpec, ViewClass};

    use super::*;

    fn section(x: f64) -> Section {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let class = ViewClass::Interior;
        let spec =
            SectionSpec { origin: [x, 0.0, 0.0], axes, grid: [2; 3], class, obstructions: false };
        Section::new(spec).unwrap()
    }

    #[test]
    fn sections_near_the_eye_are_loaded_first_and_each_to_its_end() {
        let sections = [section(0.0), section(2.0), section(8.0)];
        let mut ahead = Ahead::new(3);
        let eye = DVec3::new(2.9, 0.5, 0.5);
        assert_eq!(ahead.part(&sections, eye), Some((1, 0)));
        ahead.next[1] = Some(7);
        assert_eq!(ahead.part(&sections, eye), Some((1, 7)));
        ahead.next[1] = None;
        assert_eq!(ahead.part(&sections, eye), Some((0, 0)));
        assert_eq!(ahead.part(&sections, DVec3::new(9.0, 0.5, 0.5)), Some((2, 0)));
        ahead.next = vec![None; 3];
        assert!(ahead.is_done() && ahead.part(&sections, eye).is_none());
    }
}
