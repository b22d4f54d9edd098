//! Turns frames into display colours on a separate thread, so that the window never waits for a
//! tone mapping.

use std::{
    mem,
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::Result;
use holo_picture::{Image, Look};
use holo_stage::{Front, PublishedFrame, Viewer};
use tokio::{sync::watch, time::sleep_until};

/// Interval between updates while eyes adapt to a frame at rest.
const ADAPTS_EVERY: Duration = Duration::from_millis(80);

/// Time that eyes adapt to a frame at rest. It is enough to adapt from a thousandth of the light to
/// less than one step of a display's colours.
const ADAPTING: Duration = Duration::from_secs(4);

/// A frame with its display colours.
#[derive(Debug)]
pub struct DisplayedFrame {
    /// The frame.
    pub shown: Arc<PublishedFrame>,
    /// Its colours.
    pub image: Image,
}

/// Publishes the display colours of each frame, in the latest look, until the stage or the window
/// is gone. If frames arrive faster, only the latest is processed. Calls `wake` after each frame
/// and after each change of the stage's state.
///
/// # Errors
/// If a frame cannot be turned into colours, which is a bug.
pub async fn see(
    front: Front,
    mut looks: watch::Receiver<Look>,
    seen: watch::Sender<Option<Arc<DisplayedFrame>>>,
    wake: impl Fn(),
) -> Result<()> {
    let (mut frames, mut states) = (front.frames.subscribe(), front.state.subscribe());
    // Values from before the subscription count too.
    frames.mark_changed();
    states.mark_changed();
    let mut viewer = Viewer::default();
    let mut adapts: Option<Adapting> = None;
    loop {
        let next = adapts.as_ref().map_or_else(Instant::now, |adapting| adapting.next);
        tokio::select! {
            changed = states.changed() => {
                changed?;
                states.mark_unchanged();
                wake();
                continue;
            }
            changed = frames.changed() => changed?,
            changed = looks.changed() => changed?,
            () = sleep_until(next.into()), if adapts.is_some() => {}
        }
        let look = *looks.borrow_and_update();
        let Some(shown) = frames.borrow_and_update().clone() else { continue };
        let mut own = mem::take(&mut viewer);
        let seeing = tokio::task::spawn_blocking(move || {
            let image = own.see(&shown.frame.picture, &look, Instant::now());
            (own, DisplayedFrame { shown, image })
        });
        let (own, new) = seeing.await?;
        viewer = own;
        let before = seen.borrow().clone();
        let is_same = before.is_some_and(|before| {
            before.shown.number == new.shown.number && before.image == new.image
        });
        adapts = Adapting::after(adapts, &new.shown, is_same);
        if !is_same {
            seen.send_replace(Some(Arc::new(new)));
            wake();
        }
    }
}

/// Progress of eyes that adapt to a frame at rest.
struct Adapting {
    /// The frame's number.
    frame: u64,
    /// When the colours are updated next.
    next: Instant,
    /// When adaptation ends.
    end: Instant,
}

impl Adapting {
    /// Returns the next state after a frame was seen. `None` if the frame is not at rest, the
    /// colours stay the same (`is_same`), or the time is over.
    fn after(before: Option<Adapting>, shown: &PublishedFrame, is_same: bool) -> Option<Adapting> {
        let (now, frame) = (Instant::now(), shown.number);
        let end = before.filter(|before| before.frame == frame).map(|before| before.end);
        let end = end.unwrap_or(now + ADAPTING);
        let goes_on = shown.is_at_rest && !is_same && now < end;
        goes_on.then_some(Adapting { frame, next: now + ADAPTS_EVERY, end })
    }
}

#[cfg(test)]
mod tests {
    use holo_stage::{Inputs, State};

    use super::*;
    use crate::tests::shown;

    #[tokio::test]
    async fn eyes_adapt_to_a_frame_at_rest_though_no_other_frame_comes() {
        let (inputs, _receiver) = Inputs::new(Arc::new(|| {}));
        let front = Front { inputs, frames: Arc::default(), state: Arc::default() };
        let (_looks, looks) = watch::channel(Look::default());
        let (sender, mut seen) = watch::channel(None);
        let (woken, mut wakes) = watch::channel(0);
        let wake = move || woken.send_modify(|count| *count += 1);
        let seeing = tokio::spawn(see(front.clone(), looks, sender, wake));
        front.state.send_replace(Arc::new(State { is_paused: true, ..State::default() }));
        wakes.changed().await.unwrap();
        let exposure = |seen: &Option<Arc<DisplayedFrame>>, frame| {
            let seen = seen.as_ref().filter(|seen| seen.shown.number == frame);
            seen.and_then(|seen| seen.image.exposure)
        };
        for (number, radiance) in [(1, 0.01), (2, 1.0)] {
            let frame = shown((8, 8), [radiance; 3], number);
            let at_rest = Look::default().show(&frame.frame.picture).exposure.unwrap();
            front.frames.send_replace(Some(Arc::new(frame)));
            // Eyes stop within 2 %, a difference that is invisible: a binary logarithm of 0.03.
            let adapted = |seen: &Option<Arc<DisplayedFrame>>| {
                exposure(seen, number).is_some_and(|now| (now / at_rest).log2().abs() < 0.03)
            };
            seen.wait_for(adapted).await.unwrap();
        }
        seeing.abort();
    }
}
