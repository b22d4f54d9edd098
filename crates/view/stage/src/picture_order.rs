//! Orders of pictures to save, at any size.
//!
//! A picture is drawn in bands beside the walk, and never whole in memory. Whoever ordered it
//! receives the bands, and may end the drawing at any time.

use std::sync::{Arc, Weak};

use holo_picture::{Picture, View};
use tokio::sync::mpsc;

/// Messages that wait for a receiver: the announcement of a picture and two bands.
const MOST_WAITING: usize = 3;

/// A message about an ordered picture.
#[derive(Debug)]
pub enum PictureNews {
    /// The picture is drawn from now on.
    Begun(Box<BegunPicture>),
    /// Its next rows, from the top.
    Band(Vec<[f32; 3]>),
    /// It is not drawn, or not to its end, for this reason.
    Refused(String),
}

/// A picture whose rows follow.
#[derive(Debug)]
pub struct BegunPicture {
    /// Its view.
    pub view: View,
    /// Its size.
    pub size: (u32, u32),
    /// The same picture with fewer pixels.
    pub preview: Picture,
}

/// An order of a picture of the current view.
#[derive(Clone, Debug)]
pub struct PictureOrder {
    /// The size, as far as the view's proportions allow.
    pub size: (u32, u32),
    pub(super) news: mpsc::Sender<PictureNews>,
    /// Alive while somebody waits for the picture.
    is_wanted: Weak<()>,
}

/// Shows that somebody still waits for an ordered picture.
#[derive(Debug)]
pub struct PictureWish(Arc<()>);

impl PictureOrder {
    /// Returns an order, what receives the picture, and the wish for it. The drawing ends when one
    /// of the last two is dropped.
    pub fn new(size: (u32, u32)) -> (PictureOrder, mpsc::Receiver<PictureNews>, PictureWish) {
        let (sender, news) = mpsc::channel(MOST_WAITING);
        let wish = PictureWish(Arc::new(()));
        let is_wanted = Arc::downgrade(&wish.0);
        (PictureOrder { size, news: sender, is_wanted }, news, wish)
    }

    /// Returns whether somebody still waits for the picture.
    pub fn is_wanted(&self) -> bool {
        self.is_wanted.strong_count() > 0 && !self.news.is_closed()
    }

    /// Reports that the picture is not drawn.
    pub fn refuse(&self, reason: String) {
        // If nobody waits for the picture, nobody needs the reason.
        let _ = self.news.try_send(PictureNews::Refused(reason));
    }
}

impl PartialEq for PictureOrder {
    fn eq(&self, other: &PictureOrder) -> bool {
        self.news.same_channel(&other.news)
    }
}
