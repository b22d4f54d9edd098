//! A model of a client's screen, which determines what to send next.

use std::sync::Arc;

use holo_picture::Image;

use super::encode::{Coding, PictureRect, Tiles};

/// Bandwidth assumed before it is measured, bytes per second.
const FIRST_BANDWIDTH: f64 = 20e6;

/// Seconds that an update may take to arrive.
const UPDATE_SECONDS: f64 = 0.1;

/// Bytes per pixel in a PNG of a noisy picture, about.
const PNG_BYTES: f64 = 2.0;

/// JPEG qualities, each with its bytes per pixel, about.
const QUALITIES: [(u8, f64); 4] = [(90, 0.35), (80, 0.22), (65, 0.14), (45, 0.0)];

/// Updates of fewer bytes are not used to measure bandwidth, because decoding takes longer than
/// transfer.
const LEAST_MEASURED_BYTES: usize = 30_000;

/// Weight of the last update in the running mean of bandwidth.
const NEWEST: f64 = 0.3;

/// A client's screen.
pub struct ClientScreen {
    shown: Option<ScreenPicture>,
    /// Running mean of the bandwidth, bytes per second.
    bandwidth: f64,
}

/// The picture on it.
struct ScreenPicture {
    image: Arc<Image>,
    /// Tiles that were sent as JPEG and so are not exact.
    inexact: Tiles,
}

/// Parts to send, all encoded in the same way.
#[derive(Debug, PartialEq, Eq)]
pub struct Update {
    /// The parts; none if the screen shows the picture already.
    pub rects: Vec<PictureRect>,
    /// Their encoding.
    pub coding: Coding,
}

impl Default for ClientScreen {
    fn default() -> ClientScreen {
        ClientScreen { shown: None, bandwidth: FIRST_BANDWIDTH }
    }
}

impl ClientScreen {
    /// Records how long an update was under way.
    pub fn note(&mut self, bytes: usize, seconds: f64) {
        if bytes >= LEAST_MEASURED_BYTES {
            let newest = bytes as f64 / seconds.max(1e-4);
            self.bandwidth += NEWEST * (newest - self.bandwidth);
        }
    }

    /// Returns whether the screen shows exactly the picture's colours.
    pub fn is_exact(&self) -> bool {
        self.shown.as_ref().is_none_or(|shown| shown.inexact.is_empty())
    }

    /// Returns the parts to send so that the screen shows this picture, if not exactly.
    pub fn show(&mut self, image: Arc<Image>) -> Update {
        let size = (image.width, image.height);
        let has_size = |before: &ScreenPicture| (before.image.width, before.image.height) == size;
        let before = self.shown.take().filter(has_size);
        let changed = match &before {
            Some(before) => Tiles::changed(&before.image.rgb, &image.rgb, size),
            None => Tiles::new(size, true),
        };
        let affordable = self.bandwidth * UPDATE_SECONDS / changed.pixels().max(1.0);
        let fits = |&&(_, bytes): &&(u8, f64)| bytes <= affordable;
        let quality = QUALITIES.iter().find(fits).map_or(1, |(quality, _)| *quality);
        let mut inexact = before.map_or(Tiles::new(size, false), |before| before.inexact);
        inexact.add(&changed);
        self.shown = Some(ScreenPicture { image, inexact });
        Update { rects: changed.rects(), coding: Coding::Jpeg(quality) }
    }

    /// Returns the next parts to send exactly.
    pub fn improve(&mut self) -> Update {
        let Some(shown) = &mut self.shown else {
            return Update { rects: Vec::new(), coding: Coding::Png };
        };
        let tile = f64::from(super::encode::TILE).powi(2) * PNG_BYTES;
        let most = (self.bandwidth * UPDATE_SECONDS / tile).max(1.0) as usize;
        let next = shown.inexact.first(most);
        shown.inexact.remove(&next);
        Update { rects: next.rects(), coding: Coding::Png }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(byte: u8) -> Arc<Image> {
        sized(640, 360, byte)
    }

    fn sized(width: u32, height: u32, byte: u8) -> Arc<Image> {
        let rgb = vec![byte; (width * height * 3) as usize];
        Arc::new(Image { width, height, rgb, legend: None, exposure: None })
    }

    #[test]
    fn a_new_picture_is_sent_whole_then_its_changes_then_exact_tiles() {
        let mut screen = ClientScreen::default();
        let whole = vec![PictureRect { x: 0, y: 0, width: 640, height: 360 }];
        assert_eq!(screen.show(picture(1)).rects, whole);
        assert!(!screen.is_exact());
        assert_eq!(screen.improve(), Update { rects: whole.clone(), coding: Coding::Png });
        assert!(screen.is_exact());
        assert_eq!(screen.show(picture(1)).rects, []);
        assert!(screen.is_exact());
        let mut other = Image::clone(&picture(1));
        other.rgb[0] = 2;
        let corner = vec![PictureRect { x: 0, y: 0, width: 64, height: 64 }];
        assert_eq!(screen.show(Arc::new(other)).rects, corner);
        assert_eq!(screen.improve(), Update { rects: corner, coding: Coding::Png });
        assert!(screen.is_exact());
        // A picture of another size is sent whole.
        let small = vec![PictureRect { x: 0, y: 0, width: 320, height: 180 }];
        assert_eq!(screen.show(sized(320, 180, 1)).rects, small);
    }

    #[test]
    fn a_slow_link_gets_less_quality_and_exact_tiles_a_few_at_a_time() {
        let mut screen = ClientScreen::default();
        let (fast, slow) = (screen.show(picture(1)), 20_000.0);
        for _ in 0..50 {
            screen.note(40_000, 40_000.0 / slow);
        }
        let later = screen.show(picture(2));
        let quality = |update: &Update| match update.coding {
            Coding::Jpeg(quality) => quality,
            Coding::Png => 100,
        };
        assert!(quality(&later) < quality(&fast), "{later:?} {fast:?}");
        let mut updates = 0;
        while !screen.is_exact() {
            assert!(!screen.improve().rects.is_empty());
            updates += 1;
        }
        assert!(updates > 10, "{updates}");
    }
}
