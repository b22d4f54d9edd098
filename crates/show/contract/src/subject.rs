//! Every driver, and one way to use any of them.

use crate::viewer;
use crate::{RoomSample, TestRoom};
use holo_display::{Driver, Frame, FrameRequest, Interrupt};
use holo_driver_mesh::mesh_driver;
use holo_driver_quadtree::{Filling, cells_driver, quadtree_driver};
use holo_driver_rendercache::{PointImageParams, frameless_driver, pointimage_driver};
use holo_driver_surfaces::{StandIn, StandIns, stand_ins_driver, surfaces_driver};
use holo_picture::{Picture, View};
use holo_raycast::Raycaster;
use holo_section::BeamKey;
use std::sync::Arc;

/// A driver, and what it promises beyond the contract of all drivers.
pub struct Subject {
    /// Its name in tests.
    pub name: &'static str,
    make: fn(&TestRoom) -> Driver,
    /// Its frames at rest are a function of the set of samples, in any order.
    pub ignores_order: bool,
    /// Its frames at rest end when they are interrupted. Others are drawn too fast for that.
    pub ends_early: bool,
    /// It takes earlier samples out again. The session makes other drivers anew.
    pub forgets_earlier: bool,
    /// It draws from samples alone.
    pub needs_no_scene: bool,
}

/// All drivers, wrappers included.
pub const SUBJECTS: [Subject; 8] = [
    Subject {
        name: "surfaces",
        make: |room| {
            let (sections, scene) = (Arc::clone(&room.sections), Arc::clone(&room.raycaster));
            surfaces_driver(sections, scene, None)
        },
        ignores_order: true,
        ends_early: true,
        forgets_earlier: true,
        needs_no_scene: false,
    },
    Subject {
        name: "surfaces of stand-ins",
        make: |room| with_stand_in(room, None),
        ignores_order: true,
        ends_early: true,
        forgets_earlier: true,
        needs_no_scene: false,
    },
    Subject {
        name: "surfaces of stand-ins with a portal",
        make: |room| with_stand_in(room, Some(&room.portal)),
        ignores_order: true,
        ends_early: true,
        // The driver beyond the portal does not.
        forgets_earlier: false,
        needs_no_scene: false,
    },
    Subject {
        name: "quadtree",
        make: |room| quadtree_driver(Arc::clone(&room.sections), room.sky()),
        ignores_order: true,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
    Subject {
        name: "cells",
        make: |room| {
            let sections = Arc::clone(&room.sections);
            cells_driver(sections, room.sky(), Filling::Smooth)
        },
        ignores_order: true,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
    Subject {
        name: "mesh",
        make: |room| mesh_driver(Arc::clone(&room.sections), room.sky()),
        ignores_order: true,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
    Subject {
        name: "pointimage",
        make: |room| {
            let params = PointImageParams::default();
            pointimage_driver(Arc::clone(&room.sections), room.sky(), params)
        },
        ignores_order: false,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
    Subject {
        name: "frameless",
        make: |room| frameless_driver(Arc::clone(&room.sections), room.sky()),
        ignores_order: false,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
];

/// Returns the driver of the room with simpler geometry.
fn with_stand_in(room: &TestRoom, portal: Option<&Arc<Raycaster>>) -> Driver {
    let (sections, sky) = (Arc::clone(&room.sections), room.sky());
    let stand_in =
        StandIn { geometry: Some(Arc::clone(&room.simple)), portals: portal.map(Arc::clone) };
    stand_ins_driver(
        Arc::clone(&room.sections),
        Arc::clone(&room.raycaster),
        StandIns([(0, stand_in)].into()),
        None,
        Arc::new(move || quadtree_driver(Arc::clone(&sections), sky)),
    )
}

impl Subject {
    /// Makes the driver.
    #[must_use]
    pub fn make(&self, room: &TestRoom) -> SubjectViewer {
        SubjectViewer(viewer::TestViewer::new((self.make)(room)))
    }
}

/// A driver in use, as a session uses it.
pub struct SubjectViewer(viewer::TestViewer);

impl SubjectViewer {
    /// Returns a viewer of another view of the same light.
    #[must_use]
    pub fn beside(&self) -> SubjectViewer {
        SubjectViewer(self.0.beside())
    }

    /// Returns the signal that ends frames at rest.
    #[must_use]
    pub fn interrupt(&self) -> &Interrupt {
        &self.0.interrupt
    }

    /// Shows a view.
    pub fn look(&mut self, view: &View, size: (u32, u32), is_moving: bool) {
        let look = FrameRequest { view: *view, size, is_moving };
        self.0.weigh(&look, Vec::new()).unwrap();
        self.0.viewpoint_radius(&look, 0.5);
        self.0.look(&look).unwrap();
    }

    /// Inserts samples one by one.
    pub fn insert(&mut self, samples: &[RoomSample]) {
        for (beam, sample) in samples {
            self.0.insert(*beam, 1, std::slice::from_ref(sample));
        }
    }

    /// Inserts samples of the scene before an edit.
    pub fn insert_earlier(&mut self, samples: &[RoomSample]) {
        for (beam, sample) in samples {
            self.0.insert_earlier(*beam, 1, std::slice::from_ref(sample));
        }
    }

    /// Takes samples of the scene before an edit out again. Returns whether the driver could.
    pub fn remove_earlier(&mut self, samples: &[RoomSample]) -> bool {
        let mut is_able = true;
        for (beam, sample) in samples {
            is_able &= self.0.remove_earlier(*beam, 1, std::slice::from_ref(sample));
        }
        is_able
    }

    /// Marks beams as unseen.
    pub fn insert_unseen(&mut self, beams: &[BeamKey]) {
        beams.iter().for_each(|&beam| self.0.insert_unseen(beam));
    }

    /// Inserts live rays through all pixels that want some. Returns their number.
    pub fn insert_live(&mut self, room: &TestRoom, view: &View, size: (u32, u32)) -> usize {
        let pixels = self.uncovered();
        self.0.insert_live(1, &room.live(view, size, &pixels));
        pixels.len()
    }

    /// Returns the pixels that want live rays.
    pub fn uncovered(&mut self) -> Vec<u32> {
        self.0.uncovered()
    }

    /// Reports that all samples of the view have arrived, and does all work in advance.
    pub fn settle(&mut self) {
        self.0.settle();
        while self.0.prepare() {}
    }

    /// Draws a frame; `None` without a view, and if it was interrupted.
    pub fn draw(&mut self) -> Option<Frame> {
        self.0.try_draw()
    }

    /// Draws a frame for a file.
    pub fn draw_for_file(&mut self) -> Frame {
        self.0.draw_for_file()
    }

    /// Draws the left half of a picture; `None` if the driver cannot, or was interrupted.
    pub fn draw_half(&mut self, view: &View, size: (u32, u32)) -> Option<Picture> {
        self.0.draw_half(&FrameRequest { view: *view, size, is_moving: false })
    }

    /// Returns the known distances from the eye.
    pub fn depths(&mut self) -> Vec<f32> {
        self.0.depths()
    }

    /// Returns how many samples the light keeps from view to view.
    #[must_use]
    pub fn room(&self) -> u64 {
        self.0.room()
    }
}
