//! Every driver, and one way to use any of them.

use crate::{Room, RoomSample};
use holo_display::{Driver, Frame, Interrupt, Look, Resolution};
use holo_driver_quadtree::{Filling, QuadtreeDriver};
use holo_driver_rendercache::{FramelessDriver, PointImageParams, RenderCacheDriver};
use holo_driver_surfaces::{StandIn, StandIns, StandInsDriver, SurfacesDriver};
use holo_picture::{Picture, View};
use holo_section::BeamKey;
use std::sync::Arc;

/// A driver, and what it promises beyond the contract of all drivers.
pub struct Subject {
    /// Its name in tests.
    pub name: &'static str,
    make: fn(&Room) -> Box<dyn Driver>,
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
pub const SUBJECTS: [Subject; 7] = [
    Subject {
        name: "surfaces",
        make: |room| {
            let (sections, scene) = (Arc::clone(&room.sections), Arc::clone(&room.raycaster));
            Box::new(SurfacesDriver::new(sections, scene, None))
        },
        ignores_order: true,
        ends_early: true,
        forgets_earlier: true,
        needs_no_scene: false,
    },
    Subject {
        name: "surfaces of stand-ins",
        make: |room| {
            let (sections, sky) = (Arc::clone(&room.sections), room.sky());
            let stand_in = StandIn { geometry: Some(Arc::clone(&room.simple)), portals: None };
            Box::new(StandInsDriver::new(
                Arc::clone(&room.sections),
                Arc::clone(&room.raycaster),
                StandIns([(0, stand_in)].into()),
                None,
                Box::new(move || Box::new(QuadtreeDriver::new(Arc::clone(&sections), sky))),
            ))
        },
        ignores_order: true,
        ends_early: true,
        forgets_earlier: true,
        needs_no_scene: false,
    },
    Subject {
        name: "surfaces of stand-ins with a portal",
        make: |room| {
            let (sections, sky) = (Arc::clone(&room.sections), room.sky());
            let geometry = Some(Arc::clone(&room.simple));
            let stand_in = StandIn { geometry, portals: Some(Arc::clone(&room.portal)) };
            Box::new(StandInsDriver::new(
                Arc::clone(&room.sections),
                Arc::clone(&room.raycaster),
                StandIns([(0, stand_in)].into()),
                None,
                Box::new(move || Box::new(QuadtreeDriver::new(Arc::clone(&sections), sky))),
            ))
        },
        ignores_order: true,
        ends_early: true,
        // The driver beyond the portal does not.
        forgets_earlier: false,
        needs_no_scene: false,
    },
    Subject {
        name: "quadtree",
        make: |room| Box::new(QuadtreeDriver::new(Arc::clone(&room.sections), room.sky())),
        ignores_order: true,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
    Subject {
        name: "cells",
        make: |room| {
            let sections = Arc::clone(&room.sections);
            Box::new(QuadtreeDriver::of_cells(sections, room.sky(), Filling::Smooth))
        },
        ignores_order: true,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
    Subject {
        name: "pointimage",
        make: |room| {
            let params = PointImageParams::default();
            Box::new(RenderCacheDriver::new(Arc::clone(&room.sections), room.sky(), params))
        },
        ignores_order: false,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
    Subject {
        name: "frameless",
        make: |room| Box::new(FramelessDriver::new(Arc::clone(&room.sections), room.sky())),
        ignores_order: false,
        ends_early: false,
        forgets_earlier: false,
        needs_no_scene: true,
    },
];

impl Subject {
    /// Makes the driver.
    #[must_use]
    pub fn make(&self, room: &Room) -> Viewer {
        let mut driver = (self.make)(room);
        let interrupt = Interrupt::default();
        driver.end_early_by(interrupt.clone());
        Viewer { driver, interrupt }
    }
}

/// A driver in use, as a session uses it.
pub struct Viewer {
    driver: Box<dyn Driver>,
    /// Ends frames at rest.
    pub interrupt: Interrupt,
}

impl Viewer {
    /// Shows a view.
    pub fn look(&mut self, view: &View, size: (u32, u32), is_moving: bool) {
        let resolution = if is_moving { Resolution::Moving } else { Resolution::Full };
        let look = Look { view: *view, size, resolution };
        self.driver.weigh(&look, Vec::new()).unwrap();
        self.driver.look(&look).unwrap();
        self.driver.set_nearest(0.5);
    }

    /// Inserts samples one by one.
    pub fn insert(&mut self, samples: &[RoomSample]) {
        for (beam, sample) in samples {
            self.driver.insert(*beam, 1, std::slice::from_ref(sample));
        }
    }

    /// Inserts samples of the scene before an edit.
    pub fn insert_earlier(&mut self, samples: &[RoomSample]) {
        for (beam, sample) in samples {
            self.driver.insert_earlier(*beam, 1, std::slice::from_ref(sample));
        }
    }

    /// Takes samples of the scene before an edit out again. Returns whether the driver could.
    pub fn remove_earlier(&mut self, samples: &[RoomSample]) -> bool {
        let remove = |(beam, sample): &RoomSample| {
            self.driver.remove_earlier(*beam, 1, std::slice::from_ref(sample))
        };
        samples.iter().map(remove).fold(true, |all, removed| all && removed)
    }

    /// Marks beams as unseen.
    pub fn insert_unseen(&mut self, beams: &[BeamKey]) {
        beams.iter().for_each(|&beam| self.driver.insert_unseen(beam));
    }

    /// Inserts live rays through all pixels that want some. Returns their number.
    pub fn insert_live(&mut self, room: &Room, view: &View, size: (u32, u32)) -> usize {
        let pixels = self.driver.uncovered();
        self.driver.insert_live(1, &room.live(view, size, &pixels));
        pixels.len()
    }

    /// Returns the pixels that want live rays.
    #[must_use]
    pub fn uncovered(&mut self) -> Vec<u32> {
        self.driver.uncovered()
    }

    /// Reports that all samples of the view have arrived, and does all work in advance.
    pub fn settle(&mut self) {
        self.driver.settle();
        while self.driver.prepare() {}
    }

    /// Draws a frame of `size` pixels; `None` if it was interrupted.
    pub fn draw(&mut self, size: (u32, u32)) -> Option<Frame> {
        let frame = self.driver.draw(&mut |_| {});
        (frame.picture.size() == size).then_some(frame)
    }

    /// Draws a frame for a file.
    pub fn draw_for_file(&mut self, size: (u32, u32)) -> Option<Frame> {
        self.driver.draw_for_file();
        self.draw(size)
    }

    /// Draws the left part of a picture; `None` if the driver cannot, or was interrupted.
    pub fn draw_part(&mut self, view: &View, size: (u32, u32)) -> Option<Picture> {
        let look = Look { view: *view, size, resolution: Resolution::Full };
        let plan = self.driver.plan_parts(&look)?;
        self.driver.draw_part(&plan, 0..size.0 / 2, 0..size.1)
    }

    /// Returns the known distances from the eye.
    pub fn depths(&mut self) -> Vec<f32> {
        self.driver.depth()
    }

    /// Returns the distance of the surface under a pixel, if it is known.
    pub fn distance_at(&mut self, column: u32, row: u32) -> Option<f32> {
        Some(self.driver.surface_at(column, row)?.distance)
    }

    /// Returns how many samples the driver keeps from view to view.
    #[must_use]
    pub fn room(&self) -> u64 {
        self.driver.room()
    }
}
