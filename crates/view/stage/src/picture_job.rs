//! Draws an ordered picture in parts, between the frames of the walk.
//!
//! Invariants:
//! - A part is begun only while the eye rests and the walk has its frame. A movement ends it.
//! - At most one band is in memory here, besides those that wait for their receiver.

use std::time::{Duration, Instant};

use holo_display::{FrameRequest, PartsPlan};
use holo_picture::{Picture, View};
use holo_session::Session;
use tokio::sync::mpsc::error::TrySendError;

use super::picture_order::{BegunPicture, PictureNews, PictureOrder};

/// Time that a picture waits for stored samples.
pub const STORED_PATIENCE: Duration = Duration::from_secs(3);

/// Longest time for which a receiver may take nothing.
const RECEIVER_PATIENCE: Duration = Duration::from_secs(60);

/// Side of a part, pixels.
const SIDE: u32 = 384;

/// Most pixels of a band, which has all columns: 48 MiB.
const BAND_PIXELS: u32 = 1 << 22;

/// Most pixels of a picture by a driver that cannot draw parts.
pub const WHOLE_PIXELS: u64 = 1 << 23;

/// A picture that is being drawn.
pub struct PictureJob {
    pub order: PictureOrder,
    pub look: FrameRequest,
    phase: JobPhase,
    /// Since when the receiver has taken nothing.
    waits_since: Option<Instant>,
}

enum JobPhase {
    /// Stored samples are on their way until then, at most.
    Fetching(Instant),
    Drawing(Box<Drawing>),
}

struct Drawing {
    plan: PartsPlan,
    /// The first row of the band that is being drawn.
    first: u32,
    /// The band's next column.
    column: u32,
    /// The band, or what is next for the receiver.
    band: Picture,
    waiting: Option<PictureNews>,
}

/// How far a job is after a piece of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// More can be done at once.
    Goes,
    /// It waits for samples or for the receiver.
    Waits,
    /// The driver cannot draw parts.
    Whole,
    /// It is over: the picture is drawn, or nobody wants it.
    Over,
}

impl PictureJob {
    /// Returns a job that draws `view` in a picture of `size` pixels.
    pub fn new(order: PictureOrder, view: View, size: (u32, u32)) -> PictureJob {
        let look = FrameRequest { view, size, is_moving: false };
        let phase = JobPhase::Fetching(Instant::now() + STORED_PATIENCE);
        PictureJob { order, look, phase, waits_since: None }
    }

    /// Returns the share that is drawn.
    pub fn share(&self) -> f32 {
        match &self.phase {
            JobPhase::Fetching(_) => 0.0,
            JobPhase::Drawing(drawing) => {
                let rows = drawing.first as f32
                    + drawing.band.height as f32 * drawing.column as f32
                        / self.look.size.0.max(1) as f32;
                rows / self.look.size.1.max(1) as f32
            }
        }
    }

    /// Returns whether there is something to do at `now`, so that [`work`](Self::work) does not
    /// only wait.
    pub fn is_due(&self, session: &Session, now: Instant) -> bool {
        match &self.phase {
            _ if !self.order.is_wanted() => true,
            JobPhase::Fetching(until) => session.has_stored_beside() || now >= *until,
            JobPhase::Drawing(drawing) => {
                drawing.waiting.is_none() || self.order.news.capacity() > 0
            }
        }
    }

    /// Draws one part, or passes on what is drawn.
    pub fn work(&mut self, session: &mut Session) -> Progress {
        let now = Instant::now();
        if !self.order.is_wanted() {
            return Progress::Over;
        }
        let drawing = match &mut self.phase {
            JobPhase::Fetching(until) => {
                if !session.has_stored_beside() && now < *until {
                    return Progress::Waits;
                }
                let Some(plan) = session.plan_parts(&self.look) else { return Progress::Whole };
                self.phase = JobPhase::Drawing(Box::new(Drawing::new(plan)));
                return Progress::Goes;
            }
            JobPhase::Drawing(drawing) => drawing,
        };
        if let Some(news) = drawing.waiting.take() {
            match self.order.news.try_send(news) {
                Ok(()) => self.waits_since = None,
                Err(TrySendError::Closed(_)) => return Progress::Over,
                Err(TrySendError::Full(news)) => {
                    drawing.waiting = Some(news);
                    let since = *self.waits_since.get_or_insert(now);
                    let is_patient = now.saturating_duration_since(since) < RECEIVER_PATIENCE;
                    return if is_patient { Progress::Waits } else { Progress::Over };
                }
            }
        }
        if drawing.first >= self.look.size.1 {
            return Progress::Over;
        }
        let is_drawn = drawing.draw_part(session);
        // Only an interrupt is a reason to draw the same part again.
        if is_drawn || session.interrupt().is_set() { Progress::Goes } else { Progress::Over }
    }
}

impl Drawing {
    fn new(mut plan: PartsPlan) -> Drawing {
        let FrameRequest { view, size, .. } = plan.look;
        // Only the receiver needs the preview.
        let preview = std::mem::replace(&mut plan.preview, Picture::new(1, 1));
        let band = band(size, 0);
        let waiting = Some(PictureNews::Begun(Box::new(BegunPicture { view, size, preview })));
        Drawing { plan, first: 0, column: 0, band, waiting }
    }

    /// Draws the next part. Returns false if it is not drawn.
    fn draw_part(&mut self, session: &mut Session) -> bool {
        let size = self.plan.look.size;
        let columns = self.column..(self.column + SIDE).min(size.0);
        let rows = self.first..self.first + self.band.height;
        let Some(part) = session.draw_part(&self.plan, columns.clone(), rows.clone()) else {
            return false;
        };
        let (width, from) = (size.0.max(1) as usize, columns.start as usize);
        let of_part = part.pixels.chunks(part.width.max(1) as usize);
        for (row, part) in self.band.pixels.chunks_mut(width).zip(of_part) {
            row[from..from + part.len()].copy_from_slice(part);
        }
        self.column = columns.end;
        if self.column == size.0 {
            (self.column, self.first) = (0, rows.end);
            let next = band(size, self.first);
            let drawn = std::mem::replace(&mut self.band, next);
            self.waiting = Some(PictureNews::Band(drawn.pixels));
        }
        true
    }
}

/// Returns an empty band that begins at a row.
fn band(size: (u32, u32), first: u32) -> Picture {
    let rows = (BAND_PIXELS / size.0.max(1)).clamp(1, SIDE);
    Picture::new(size.0, rows.min(size.1.saturating_sub(first)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_bounded_and_cover_every_row_once() {
        for size in [(1, 1), (383, 385), (8192, 8192), (65_535, 1024), (1, 65_535)] {
            let mut first = 0;
            while first < size.1 {
                let band = band(size, first);
                assert!(band.height > 0 && band.pixels.len() <= BAND_PIXELS as usize, "{size:?}");
                first += band.height;
            }
            assert_eq!(first, size.1, "{size:?}");
        }
    }
}
