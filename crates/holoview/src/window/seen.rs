//! Makes frames visible beside the window's thread, which so never waits for a tone mapping.

use std::{mem, sync::Arc, time::Instant};

use anyhow::Result;
use holo_picture::{Image, Look};
use tokio::sync::watch;

use crate::{
    screen::Viewer,
    stage::{Front, Shown},
};

/// A frame as it is seen.
#[derive(Debug)]
pub struct Seen {
    /// The frame.
    pub shown: Arc<Shown>,
    /// Its colours.
    pub image: Image,
}

/// Publishes what is seen of each frame, in the latest look, until the stage or the window is gone.
/// Frames that come meanwhile are left out, except the last. Calls `wake` after each, and after
/// each change of the stage's state.
///
/// # Errors
/// If a frame cannot be shown, which is a fault of this program.
pub async fn see(
    front: Front,
    mut looks: watch::Receiver<Look>,
    seen: watch::Sender<Option<Arc<Seen>>>,
    wake: impl Fn(),
) -> Result<()> {
    let (mut frames, mut states) = (front.frames.subscribe(), front.state.subscribe());
    let mut viewer = Viewer::default();
    loop {
        tokio::select! {
            changed = states.changed() => {
                changed?;
                states.mark_unchanged();
                wake();
                continue;
            }
            changed = frames.changed() => changed?,
            changed = looks.changed() => changed?,
        }
        let look = *looks.borrow_and_update();
        let Some(shown) = frames.borrow_and_update().clone() else { continue };
        let mut own = mem::take(&mut viewer);
        let seeing = tokio::task::spawn_blocking(move || {
            let image = own.see(&shown.frame.picture, &look, Instant::now());
            (own, Seen { shown, image })
        });
        let (own, new) = seeing.await?;
        viewer = own;
        seen.send_replace(Some(Arc::new(new)));
        wake();
    }
}
