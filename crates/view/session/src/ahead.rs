//! Loads the whole file: stored samples that no view has requested arrive in parts, while the
//! session has nothing else to do. Light for later views is then already here.
//!
//! Invariants:
//! - At most one part is under way. A new view waits for that part at the most.
//! - Nothing is loaded while the eye moves, or before all stored samples of the view have arrived.

use std::time::{Duration, Instant};

use anyhow::Result;
use glam::DVec3;
use holo_proto::control::{Control, MAX_PART};
use holo_section::Section;

use super::{Session, current_view::RequestedSamples, demand::SEARCH_AFTER};

/// Samples in one part: about 10 ms of two cores.
const PART: u32 = 1 << 16;

/// The file is loaded again once other displays have caused this share of its samples to be stored
/// since the last load. The server does not send those samples to this display.
const MANY_NEW: f64 = 0.1;

/// The least time between two loads of the file.
const LOAD_EVERY: Duration = Duration::from_secs(30);

/// For so long after the first request, parts follow each other without a pause. Meanwhile little
/// is traced, because millions of stored samples arrive in the time in which a worker traces some
/// hundred thousand.
const EAGER: Duration = Duration::from_secs(3);

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

impl Session {
    /// Returns whether the driver has room for all samples of the file.
    pub(super) fn loads_whole_file(&self) -> bool {
        self.stored() <= self.driver.light.room()
    }

    /// Returns whether all stored samples are here, except a few that were stored for others since.
    pub fn has_whole_file(&self) -> bool {
        self.loads_whole_file() && self.ahead.is_done() && !self.has_many_new()
    }

    /// Returns the number of samples in the file, as the server last reported it.
    fn stored(&self) -> u64 {
        self.status.as_ref().map_or(self.welcome.samples, |status| status.samples)
    }

    /// Returns how many samples are here, of all views and parts.
    pub fn samples_here(&self) -> u64 {
        self.current.as_ref().map_or(0, |current| current.received.samples())
    }

    /// Returns how many of the file's samples are not here.
    fn missing(&self) -> u64 {
        self.stored().saturating_sub(self.samples_here())
    }

    /// Returns whether all samples of a file are here to which nothing is added.
    pub(super) fn has_all_of_replay(&self) -> bool {
        !self.welcome.tracing && self.ahead.is_done() && self.missing() == 0
    }

    /// Returns whether others have stored many samples since the file was loaded.
    fn has_many_new(&self) -> bool {
        let new = self.missing().saturating_sub(self.ahead.missing);
        new as f64 > MANY_NEW * self.stored() as f64
    }

    /// Loads the whole file from its beginning, because samples may have been stored without being
    /// sent.
    pub(super) fn load_again(&mut self) -> Result<()> {
        self.ahead.restart();
        self.ask_for_part(MAX_PART)
    }

    /// Requests a part of the file, if there is nothing else to do. Returns when one is due.
    pub(super) fn ask_ahead(&mut self, now: Instant) -> Result<Option<Instant>> {
        let Some(current) = self.current.as_ref() else { return Ok(None) };
        let is_idle = current.asked == RequestedSamples::All
            && !self.is_moving()
            && self.ahead.asked.is_none();
        if !is_idle || !self.loads_whole_file() {
            return Ok(None);
        }
        let due = self.ahead.resumes.max(current.since + SEARCH_AFTER);
        if self.has_whole_file() {
            return Ok(None);
        }
        if now < due {
            return Ok(Some(due));
        }
        if self.ahead.is_done() {
            self.ahead.restart();
        }
        self.ask_for_part(PART)?;
        Ok(None)
    }

    fn ask_for_part(&mut self, samples: u32) -> Result<()> {
        let Some(current) = self.current.as_ref() else { return Ok(()) };
        let eye = current.look.view.vp;
        let part = self.ahead.part(&self.sections, eye);
        if let Some((section, first)) = part.filter(|_| self.ahead.asked.is_none()) {
            let now = Instant::now();
            self.ahead.asked = Some(now);
            self.ahead.began.get_or_insert(now);
            let section = u16::try_from(section)?;
            let as_settled = self.is_loading_to_settle;
            let part = Control::PartWanted { section, first, samples, as_settled };
            self.outbox.control(&part)?;
        }
        Ok(())
    }

    /// Records that a part has arrived. After the first seconds, the next one is requested only
    /// after a pause as long as this one took, so that tracing and drawing get their share. Returns
    /// true if the session is settling and this was the last part.
    pub(super) fn part_sent(&mut self, section: u16, next: Option<u64>) -> Result<bool> {
        let now = Instant::now();
        self.last_stored = now;
        let is_stale = std::mem::take(&mut self.ahead.is_stale);
        let of_section = self.ahead.next.get_mut(usize::from(section));
        if let Some(of_section) = of_section.filter(|_| !is_stale) {
            *of_section = next;
        }
        let took = self.ahead.asked.take().map_or(Duration::ZERO, |asked| now - asked);
        let is_eager = self.ahead.began.is_some_and(|began| now < began + EAGER);
        self.ahead.resumes = if is_eager { now } else { now + took };
        if self.ahead.is_done() {
            self.ahead.resumes = now + LOAD_EVERY;
            self.ahead.missing = self.missing();
        }
        if self.is_loading_to_settle {
            self.is_loading_to_settle = !self.ahead.is_done();
            self.ask_for_part(MAX_PART)?;
            return Ok(!self.is_loading_to_settle);
        }
        Ok(false)
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
