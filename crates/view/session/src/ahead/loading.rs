//! Requests the parts of the file.

use std::time::{Duration, Instant};

use anyhow::Result;
use holo_proto::control::{Control, MAX_PART};

use crate::{Session, Settling, current_view::RequestedSamples, demand::SEARCH_AFTER};

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

impl Session {
    /// Returns whether the driver has room for all samples of the file.
    pub(crate) fn loads_whole_file(&self) -> bool {
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
    pub(crate) fn has_all_of_replay(&self) -> bool {
        !self.welcome.tracing && self.ahead.is_done() && self.missing() == 0
    }

    /// Returns whether others have stored many samples since the file was loaded.
    fn has_many_new(&self) -> bool {
        let new = self.missing().saturating_sub(self.ahead.missing);
        new as f64 > MANY_NEW * self.stored() as f64
    }

    /// Loads the whole file from its beginning, because samples may have been stored without being
    /// sent.
    pub(crate) fn load_again(&mut self) -> Result<()> {
        self.ahead.restart();
        self.ask_for_part(MAX_PART)
    }

    /// Requests a part of the file, if there is nothing else to do. Returns when one is due.
    pub(crate) fn ask_ahead(&mut self, now: Instant) -> Result<Option<Instant>> {
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
            let as_settled = self.settling == Settling::Loading;
            let part = Control::PartWanted { section, first, samples, as_settled };
            self.outbox.control(&part)?;
        }
        Ok(())
    }

    /// Records that a part has arrived. After the first seconds, the next one is requested only
    /// after a pause as long as this one took, so that tracing and drawing get their share. Returns
    /// true if the session is settling and this was the last part.
    pub(crate) fn part_sent(&mut self, section: u16, next: Option<u64>) -> Result<bool> {
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
        if self.settling == Settling::Loading {
            let is_done = self.ahead.is_done();
            if is_done {
                self.settling = Settling::WholeFile;
            }
            self.ask_for_part(MAX_PART)?;
            return Ok(is_done);
        }
        Ok(false)
    }
}
