//! Which driver makes a session's pictures, and what it needs: the scene for the one that knows surfaces.
//!
//! Invariant: a scene is used only if its bytes have the announced hash.

use std::{sync::Arc, time::Duration};

use anyhow::{Context, Result, bail, ensure};
use holo_display::{Frame, Quadtree, QuadtreeParams, Voronoi};
use holo_net::{Inbox, Message, Outbox, SceneReceiver};
use holo_picture::View;
use holo_proto::control::{Control, Welcome};
use holo_raycast::Raycaster;
use holo_scene::Scene;
use holo_section::{BeamId, Sample, Section};

use crate::Driver;

/// How long the scene's next piece may take: a server that has none sends nothing.
const SCENE_TIME: Duration = Duration::from_secs(10);

/// Makes canvases for views.
pub enum Painter {
    Quadtree,
    Voronoi(Arc<Raycaster>),
}

impl Painter {
    /// The driver asked for, with the server's scene if it needs one.
    pub async fn new(driver: Driver, inbox: &mut Inbox, outbox: &Outbox, welcome: &Welcome) -> Result<Painter> {
        if driver == Driver::Quadtree {
            return Ok(Painter::Quadtree);
        }
        let raycaster = match fetch(inbox, outbox, welcome).await? {
            Some(packed) => {
                let hash = welcome.scene.hash;
                Some(tokio::task::spawn_blocking(move || build(&packed, hash)).await?)
            }
            None => None,
        };
        match (raycaster, driver) {
            (Some(Ok(raycaster)), _) => Ok(Painter::Voronoi(Arc::new(raycaster))),
            (Some(Err(error)), Driver::Voronoi) => Err(error),
            (None, Driver::Voronoi) => bail!("the holodeck has no scene; use --driver quadtree"),
            (_, _) => Ok(Painter::Quadtree),
        }
    }

    /// An empty picture of a view.
    pub fn canvas(&self, sections: Arc<[Section]>, view: View, size: (u32, u32), sky: [f32; 3]) -> Canvas {
        match self {
            Painter::Quadtree => {
                let params = QuadtreeParams { sky, ..QuadtreeParams::default() };
                Canvas::Quadtree(Box::new(Quadtree::new(sections, view, size, params)))
            }
            Painter::Voronoi(raycaster) => {
                Canvas::Voronoi(Box::new(Voronoi::new(sections, Arc::clone(raycaster), view, size)))
            }
        }
    }
}

/// The packed scene; `None` if none comes.
async fn fetch(inbox: &mut Inbox, outbox: &Outbox, welcome: &Welcome) -> Result<Option<Vec<u8>>> {
    if welcome.scene.bytes == 0 {
        return Ok(None);
    }
    let mut receiver = SceneReceiver::new(&welcome.scene)?;
    outbox.control(&Control::SceneWanted)?;
    let mut deadline = tokio::time::Instant::now() + SCENE_TIME;
    loop {
        // Only pieces count: a server that has no scene still says how it fares.
        let Ok(message) = tokio::time::timeout_at(deadline, inbox.next()).await else { return Ok(None) };
        match message.context("lost the server")? {
            Message::BlobChunk(chunk) => {
                deadline = tokio::time::Instant::now() + SCENE_TIME;
                if receiver.take(&chunk)? {
                    return Ok(Some(receiver.into_bytes()));
                }
            }
            Message::Control(Control::Ping(number)) => outbox.control(&Control::Pong(number))?,
            Message::Control(Control::Bye { reason }) => bail!("the server ended the session: {reason}"),
            Message::Control(_) => {}
            _ => bail!("the server sent a message that is not for a display"),
        }
    }
}

fn build(packed: &[u8], hash: [u8; 32]) -> Result<Raycaster> {
    ensure!(Scene::content_hash(packed) == hash, "the scene's bytes do not have the announced hash");
    let scene = Scene::unpack(packed).context("reading the server's scene")?;
    Raycaster::build(Arc::new(scene)).context("preparing the scene")
}

/// A driver with the samples of one view.
pub enum Canvas {
    Quadtree(Box<Quadtree>),
    Voronoi(Box<Voronoi>),
}

impl Canvas {
    pub fn name(&self) -> &'static str {
        match self {
            Canvas::Quadtree(_) => "quadtree",
            Canvas::Voronoi(_) => "voronoi",
        }
    }

    pub fn insert(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        match self {
            Canvas::Quadtree(driver) => driver.insert(section, beam, paths, samples),
            Canvas::Voronoi(driver) => driver.insert(section, beam, paths, samples),
        }
    }

    pub fn insert_unseen(&mut self, section: u16, beam: BeamId) {
        match self {
            Canvas::Quadtree(driver) => driver.insert_unseen(section, beam),
            // It knows by itself which pixels see nothing.
            Canvas::Voronoi(_) => {}
        }
    }

    /// Beams besides the view's own whose stored samples are of use.
    pub fn surface_beams(&self) -> Vec<(u16, BeamId)> {
        match self {
            Canvas::Quadtree(driver) => driver.surface_beams(),
            Canvas::Voronoi(driver) => driver.surface_beams(),
        }
    }

    /// Distance from the eye for each pixel, as far as it is known yet.
    pub fn depth(&self) -> Vec<f32> {
        match self {
            Canvas::Quadtree(driver) => driver.draw().depth,
            Canvas::Voronoi(driver) => driver.depth(),
        }
    }

    /// The picture, and how many of its pixels are guesses.
    pub fn draw(&self) -> (Frame, u64) {
        match self {
            Canvas::Quadtree(driver) => (driver.draw(), 0),
            Canvas::Voronoi(driver) => {
                let drawn = driver.draw();
                (drawn.frame, drawn.guessed_pixels)
            }
        }
    }
}
