//! Which driver makes a session's pictures, and what it needs: the scene for the one that knows surfaces.
//!
//! Invariant: a scene is used only if its bytes have the announced hash.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use holo_display::{Filling, Frame, Resolution, Voronoi, WantedBeam, viewpoint_radius};
use holo_light::Store;
use holo_net::{Inbox, Message, Outbox, SceneReceiver};
use holo_picture::View;
use holo_proto::control::{Control, SceneInfo, Welcome};
use holo_raycast::Raycaster;
use holo_scene::Scene;
use holo_section::{BeamId, RayCoords, Sample, Section};

use crate::{
    CellsArg, Driver, DriverArgs,
    kept::Trees,
    point_args::{Part, PointArgs},
    points::{Kind, Points, StageTime},
    stand_ins::StandIns,
};

/// How long the scene's next piece may take: a server that has none sends nothing.
const SCENE_TIME: Duration = Duration::from_secs(10);

/// Least radius of records that are told apart, as a share of the scene's size.
const LEAST_RADIUS: f64 = 1e-5;

/// Views that follow each other more quickly are those of somebody who moves: full pictures could not follow. One that has been looked at
/// for longer is at rest.
pub const AT_REST: Duration = Duration::from_millis(150);

/// Tells moving from resting by when the last view was asked for.
#[derive(Default)]
pub struct Pace(Option<Instant>);

impl Pace {
    /// For a view that is asked for now.
    pub fn next(&mut self) -> Resolution {
        let last = self.0.replace(Instant::now());
        if last.is_some_and(|last| last.elapsed() < AT_REST) {
            Resolution::Half
        } else {
            Resolution::Full
        }
    }

    /// For a view that is shown again because nothing moves any more, however short a time ago that was: who says so has waited, and would ask
    /// again and again.
    pub fn rest(&mut self) -> Resolution {
        self.0 = Some(Instant::now());
        Resolution::Full
    }
}

/// Makes canvases for views.
pub enum Painter {
    /// Of samples alone, in leaves or in cells. It keeps what it has for the next view.
    Quadtree(Trees),
    /// With the records of indirect light that have come.
    Voronoi(Arc<Raycaster>, Arc<Store>, StandIns),
    /// One driver for all views: it keeps what it has.
    Points(Points),
}

impl Painter {
    /// The driver asked for, with the server's scene if it needs one.
    pub async fn new(
        DriverArgs { driver, cells }: DriverArgs,
        points: &PointArgs,
        sections: &Arc<[Section]>,
        inbox: &mut Inbox,
        outbox: &Outbox,
        welcome: &Welcome,
    ) -> Result<Painter> {
        let of_kind =
            |kind| Ok(Painter::Points(Points::new(kind, Arc::clone(sections), welcome.sky)));
        match driver {
            Driver::Quadtree => return Ok(Painter::Quadtree(Trees::default())),
            Driver::Pointimage => return of_kind(Kind::PointImage(points.params())),
            Driver::Frameless => return of_kind(Kind::Frameless),
            Driver::Auto | Driver::Voronoi => {}
        }
        let of_cells = |filling| Ok(Painter::Quadtree(Trees::of_cells(filling)));
        match cells {
            Some(CellsArg::Constant) => return of_cells(Filling::Constant),
            Some(CellsArg::Smooth) => return of_cells(Filling::Smooth),
            None => {}
        }
        let mut stand_ins = StandIns::default();
        let raycaster = match fetch(inbox, outbox, &welcome.scene, &Control::SceneWanted).await? {
            Some((packed, others)) => {
                let hash = welcome.scene.hash;
                let raycaster = tokio::task::spawn_blocking(move || build(&packed, hash)).await?;
                if let Some(info) = others {
                    let fetched = fetch(inbox, outbox, &info, &Control::StandInsWanted).await?;
                    let (blob, _) = fetched
                        .context("the server announced stand-ins for the scene and sent none")?;
                    stand_ins =
                        tokio::task::spawn_blocking(move || StandIns::build(&blob, info.hash))
                            .await??;
                }
                Some(raycaster)
            }
            None => None,
        };
        match (raycaster, driver) {
            (Some(Ok(raycaster)), _) => {
                // Records keep coming while workers make them: whoever asks once gets them all.
                outbox.control(&Control::LightWanted)?;
                let (low, high) = raycaster.scene().bounds();
                let records = Store::new(
                    (LEAST_RADIUS * low.distance(high)).max(f64::from(f32::MIN_POSITIVE)) as f32,
                );
                Ok(Painter::Voronoi(Arc::new(raycaster), Arc::new(records), stand_ins))
            }
            (Some(Err(error)), Driver::Voronoi) => Err(error),
            // 0.6 dB better than leaves of a quadtree, on average over 42 sets of samples of a known room (example `cells_quality`), and
            // never worse.
            (None | Some(Err(_)), _) => of_cells(Filling::Smooth),
        }
    }

    /// How much of each of a view's `beams` is wanted, considering what the driver has. Comes before the view's [`canvas`](Self::canvas).
    pub fn weigh(
        &self,
        view: View,
        size: (u32, u32),
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>> {
        match self {
            Painter::Points(points) => points.look(view, size, beams),
            Painter::Quadtree(_) | Painter::Voronoi(..) => Ok(beams),
        }
    }

    /// Leaves parts of the render cache out, or takes them in again.
    pub fn switch(&self, parts: &[Part], on: bool) -> Result<()> {
        match self {
            Painter::Points(points) if points.switch(parts, on) => Ok(()),
            _ => bail!("only --driver pointimage has parts that `with` and `without` switch"),
        }
    }

    /// Whether its canvases say which single rays they want.
    pub fn wants_rays(&self) -> bool {
        matches!(self, Painter::Points(points) if points.name() == "pointimage")
    }

    /// How near to the eye rays are to pass if the nearest visible surface is at `nearest`.
    pub fn radius(&self, view: &View, size: (u32, u32), nearest: f64) -> f64 {
        match self {
            Painter::Points(points) => points.radius(view, size, nearest),
            Painter::Quadtree(_) | Painter::Voronoi(..) => {
                viewpoint_radius(view, size, nearest, 1.0)
            }
        }
    }

    /// Where records of indirect light go, if the driver uses them.
    pub fn records(&self) -> Option<Arc<Store>> {
        match self {
            Painter::Voronoi(_, records, ..) => Some(Arc::clone(records)),
            Painter::Quadtree(_) | Painter::Points(_) => None,
        }
    }

    /// An empty picture of a view. While the camera moves the driver that knows the scene has half the `resolution`, and the quadtree draws drafts.
    pub fn canvas(
        &self,
        sections: Arc<[Section]>,
        view: View,
        size: (u32, u32),
        sky: [f32; 3],
        resolution: Resolution,
    ) -> Canvas {
        match self {
            Painter::Quadtree(trees) => {
                trees.look(sections, view, size, sky, resolution);
                Canvas::Quadtree(trees.clone())
            }
            Painter::Voronoi(raycaster, records, stand_ins) => {
                let (geometry, portals) = stand_ins.of(&sections, &view);
                // Records are of the scene's own surfaces.
                let records = geometry.is_none().then(|| Arc::clone(records));
                let raycaster = geometry.unwrap_or_else(|| Arc::clone(raycaster));
                let driver =
                    Voronoi::at_resolution(sections, raycaster, portals, view, size, resolution);
                Canvas::Voronoi(Box::new(match records {
                    Some(records) => driver.with_records(records),
                    None => driver,
                }))
            }
            Painter::Points(points) => Canvas::Points(points.clone()),
        }
    }
}

/// The packed scene or the stand-ins, by what is `wanted`; `None` if none comes. With the scene, what stand-ins there are.
async fn fetch(
    inbox: &mut Inbox,
    outbox: &Outbox,
    info: &SceneInfo,
    wanted: &Control,
) -> Result<Option<(Vec<u8>, Option<SceneInfo>)>> {
    if info.bytes == 0 {
        return Ok(None);
    }
    let mut receiver = SceneReceiver::new(info)?;
    let mut stand_ins = None;
    outbox.control(wanted)?;
    let mut deadline = tokio::time::Instant::now() + SCENE_TIME;
    loop {
        // Only pieces count: a server that has no scene still says how it fares.
        let Ok(message) = tokio::time::timeout_at(deadline, inbox.next()).await else {
            return Ok(None);
        };
        match message.context("lost the server")? {
            Message::BlobChunk(chunk) => {
                deadline = tokio::time::Instant::now() + SCENE_TIME;
                if receiver.take(&chunk)? {
                    return Ok(Some((receiver.into_bytes(), stand_ins)));
                }
            }
            Message::Control(Control::Ping(number)) => outbox.control(&Control::Pong(number))?,
            Message::Control(Control::Bye { reason }) => {
                bail!("the server ended the session: {reason}")
            }
            Message::Control(Control::StandIns(info)) => stand_ins = Some(info),
            Message::Control(_) => {}
            _ => bail!("the server sent a message that is not for a display"),
        }
    }
}

fn build(packed: &[u8], hash: [u8; 32]) -> Result<Raycaster> {
    ensure!(
        Scene::content_hash(packed) == hash,
        "the scene's bytes do not have the announced hash"
    );
    let scene = Scene::unpack(packed).context("reading the server's scene")?;
    Raycaster::build(Arc::new(scene)).context("preparing the scene")
}

/// A driver with the samples of one view.
pub enum Canvas {
    Quadtree(Trees),
    Voronoi(Box<Voronoi>),
    Points(Points),
}

impl Canvas {
    pub fn name(&self) -> &'static str {
        match self {
            Canvas::Points(driver) => driver.name(),
            Canvas::Quadtree(driver) => driver.name(),
            Canvas::Voronoi(_) => "voronoi",
        }
    }

    /// Whether its pictures are those of somebody who moves: of fewer surfaces than pixels.
    pub fn is_moving(&self) -> bool {
        matches!(self, Canvas::Voronoi(driver) if driver.resolution() == Resolution::Half)
    }

    pub fn insert(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        match self {
            Canvas::Quadtree(driver) => driver.insert(section, beam, paths, samples),
            Canvas::Voronoi(driver) => driver.insert(section, beam, paths, samples),
            Canvas::Points(driver) => driver.insert(section, beam, samples),
        }
    }

    pub fn insert_unseen(&mut self, section: u16, beam: BeamId) {
        match self {
            Canvas::Quadtree(driver) => driver.insert_unseen(section, beam),
            Canvas::Points(driver) => driver.insert_unseen(section, beam),
            Canvas::Voronoi(driver) => driver.insert_unseen(section, beam),
        }
    }

    /// Single rays that would improve the picture most, if the driver can say: to be asked again and again.
    pub fn wanted_rays(&self) -> Vec<(u16, BeamId, RayCoords)> {
        match self {
            Canvas::Points(driver) => driver.wanted_rays(),
            Canvas::Quadtree(_) | Canvas::Voronoi(_) => Vec::new(),
        }
    }

    /// Beams besides the view's own whose stored samples are of use. To be asked when those of [`best_surface_beams`](Self::best_surface_beams)
    /// have come: from now on pictures are of this view's samples alone.
    pub fn surface_beams(&self) -> Vec<(u16, BeamId)> {
        match self {
            Canvas::Quadtree(driver) => {
                driver.settle();
                driver.own(|tree| tree.surface_beams())
            }
            Canvas::Points(_) => Vec::new(),
            Canvas::Voronoi(driver) => driver.surface_beams(),
        }
    }

    /// Some of those beams, which hold most of what is of use; none if the driver has no such choice. A beam of a section has about
    /// `samples_of_beam(section)` stored samples.
    pub fn best_surface_beams(&self, samples_of_beam: impl Fn(u16) -> f64) -> Vec<(u16, BeamId)> {
        match self {
            Canvas::Voronoi(driver) => driver.best_surface_beams(),
            Canvas::Quadtree(driver) => driver.own(|tree| tree.best_surface_beams(samples_of_beam)),
            Canvas::Points(_) => Vec::new(),
        }
    }

    /// Distances from the eye of what is seen, spread over the picture, as far as they are known yet.
    pub fn depth(&self) -> Vec<f32> {
        match self {
            Canvas::Quadtree(driver) => driver.own(|tree| tree.depth()),
            Canvas::Voronoi(driver) => driver.depth(),
            Canvas::Points(driver) => driver.draw().0.depth,
        }
    }

    /// Puts the distance of the nearest visible surface right, from which follows how near to the eye rays pass.
    pub fn set_nearest(&mut self, nearest: f64) {
        if let Canvas::Points(driver) = self {
            driver.set_nearest(nearest);
        }
    }

    /// The picture, how many of its pixels are guesses, and how long its stages took if the driver says so.
    pub fn draw(&self) -> (Frame, u64, Vec<StageTime>) {
        match self {
            Canvas::Quadtree(driver) => {
                (driver.draw().unwrap_or_else(crate::points::nothing), 0, Vec::new())
            }
            Canvas::Voronoi(driver) => {
                let drawn = driver.draw();
                (drawn.frame, drawn.guessed_pixels, Vec::new())
            }
            Canvas::Points(driver) => {
                let (frame, stages) = driver.draw();
                (frame, 0, stages)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_in_quick_succession_are_of_half_resolution_and_one_after_a_rest_is_full() {
        let mut pace = Pace::default();
        assert_eq!(pace.next(), Resolution::Full);
        assert_eq!(pace.next(), Resolution::Half);
        assert_eq!(pace.next(), Resolution::Half);
        std::thread::sleep(AT_REST);
        assert_eq!(pace.next(), Resolution::Full);
    }

    #[test]
    fn a_view_that_rests_is_full_however_little_time_is_left_of_moving() {
        let mut pace = Pace::default();
        pace.next();
        assert_eq!(pace.next(), Resolution::Half);
        // Asking for the view has taken a while, and so it rests earlier than a next one would be that of somebody at rest.
        assert_eq!(pace.rest(), Resolution::Full);
        assert_eq!(pace.next(), Resolution::Half);
    }
}
