//! People who look at frames in the same way share one image and its encodings.
//!
//! Invariant: an image and its encoded parts are made once for each frame, moment of adaptation and
//! look.

use std::{sync::Arc, time::Instant};

use anyhow::Result;
use holo_picture::{Image, Look};
use holo_stage::{PublishedFrame, Viewer, on_screen_threads};
use rayon::prelude::*;
use tokio::sync::Mutex;

use super::encode::{Coding, Colours, PictureRect};

/// An encoded part of a picture.
pub type Part = (PictureRect, Arc<[u8]>);

/// The eyes of everyone with one look.
#[derive(Debug)]
pub struct Eyes {
    look: Look,
    sight: Mutex<EncodedImage>,
}

/// The latest image and its encoded parts.
#[derive(Debug, Default)]
struct EncodedImage {
    viewer: Viewer,
    /// The frame's number, how many times it was shown again, and its colours.
    seen: Option<((u64, u32), Arc<Image>)>,
    /// Encoded parts of the image.
    parts: Vec<(Coding, Part)>,
}

/// All eyes that somebody uses.
#[derive(Debug, Default)]
pub struct AllEyes(parking_lot::Mutex<Vec<Arc<Eyes>>>);

impl AllEyes {
    /// Returns the eyes of a look. Everyone with this look shares them.
    pub fn of(&self, look: Look) -> Arc<Eyes> {
        let mut all = self.0.lock();
        // Eyes that no client uses are dropped.
        all.retain(|eyes| Arc::strong_count(eyes) > 1);
        if let Some(eyes) = all.iter().find(|eyes| eyes.look == look) {
            return Arc::clone(eyes);
        }
        let eyes = Arc::new(Eyes { look, sight: Mutex::default() });
        all.push(Arc::clone(&eyes));
        eyes
    }
}

impl Eyes {
    /// Returns the look.
    pub fn look(&self) -> Look {
        self.look
    }

    /// Returns the colours of a frame after `times` looks at it. Eyes adapt between looks.
    pub async fn see(
        self: &Arc<Self>,
        shown: &Arc<PublishedFrame>,
        times: u32,
    ) -> Result<Arc<Image>> {
        let (eyes, shown) = (Arc::clone(self), Arc::clone(shown));
        let seeing = tokio::task::spawn_blocking(move || {
            let mut sight = eyes.sight.blocking_lock();
            let moment = (shown.number, times);
            if let Some((_, image)) = sight.seen.as_ref().filter(|(seen, _)| *seen == moment) {
                return Arc::clone(image);
            }
            let image = sight.viewer.see(&shown.frame.picture, &eyes.look, Instant::now());
            let image = Arc::new(image);
            sight.seen = Some((moment, Arc::clone(&image)));
            sight.parts.clear();
            image
        });
        Ok(seeing.await?)
    }

    /// Returns parts of an image, encoded.
    pub async fn encode(
        self: &Arc<Self>,
        image: &Arc<Image>,
        rects: Vec<PictureRect>,
        coding: Coding,
    ) -> Result<Vec<Part>> {
        let (eyes, image) = (Arc::clone(self), Arc::clone(image));
        let encoding = tokio::task::spawn_blocking(move || {
            let mut sight = eyes.sight.blocking_lock();
            let is_latest =
                sight.seen.as_ref().is_some_and(|(_, latest)| Arc::ptr_eq(latest, &image));
            let strips: Vec<PictureRect> =
                rects.into_iter().flat_map(PictureRect::strips).collect();
            let known = |rect: &PictureRect| {
                let parts = sight.parts.iter().filter(|_| is_latest);
                let mut parts = parts.filter(|(of, (at, _))| *of == coding && at == rect);
                parts.next().map(|(_, part)| part.clone())
            };
            let strips: Vec<(PictureRect, Option<Part>)> =
                strips.into_iter().map(|rect| (rect, known(&rect))).collect();
            let colours = Colours { bytes: &image.rgb, size: (image.width, image.height) };
            let encode = |(rect, known): (PictureRect, Option<Part>)| match known {
                Some(part) => Ok((part, false)),
                None => Ok(((rect, colours.encode(rect, coding)?.into()), true)),
            };
            let encoded: Vec<(Part, bool)> =
                on_screen_threads(|| strips.into_par_iter().map(encode).collect::<Result<_>>())?;
            if is_latest {
                let fresh = encoded.iter().filter(|(_, is_new)| *is_new);
                sight.parts.extend(fresh.map(|(part, _)| (coding, part.clone())));
            }
            Ok(encoded.into_iter().map(|(part, _)| part).collect())
        });
        encoding.await?
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use holo_display::Frame;
    use holo_picture::View;

    use super::*;

    fn shown(number: u64) -> Arc<PublishedFrame> {
        let size = (128, 64);
        let view = View::new(DVec3::ZERO, DVec3::Y, DVec3::Z, Some(60.0), None, size).unwrap();
        let mut frame = Frame::black(size);
        frame.picture.pixels.fill([1.0; 3]);
        Arc::new(PublishedFrame {
            number,
            input: (0, 0),
            view,
            options: String::new(),
            frame: Arc::new(frame),
            is_at_rest: true,
            took: [0.0; 2],
            done: Instant::now(),
        })
    }

    #[tokio::test]
    async fn clients_with_the_same_look_share_one_image_and_one_encoding() {
        let (all, rect) = (AllEyes::default(), PictureRect { x: 0, y: 0, width: 128, height: 64 });
        let (first, second) = (all.of(Look::default()), all.of(Look::default()));
        let other = all.of(Look { false_color: true, ..Look::default() });
        let frame = shown(1);
        let image = first.see(&frame, 0).await.unwrap();
        assert!(Arc::ptr_eq(&image, &second.see(&frame, 0).await.unwrap()));
        assert!(!Arc::ptr_eq(&image, &other.see(&frame, 0).await.unwrap()));
        let encode = async |eyes: &Arc<Eyes>| {
            eyes.encode(&image, vec![rect], Coding::Jpeg(80)).await.unwrap().remove(0).1
        };
        assert!(Arc::ptr_eq(&encode(&first).await, &encode(&second).await));
        let next = first.see(&shown(2), 0).await.unwrap();
        assert!(!Arc::ptr_eq(&image, &next));
        // Eyes that no client uses are dropped.
        drop((first, second));
        all.of(other.look());
        assert_eq!(all.0.lock().len(), 1);
    }
}
