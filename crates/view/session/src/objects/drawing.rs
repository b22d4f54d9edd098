//! Draws local objects over the frames of any driver.

use std::{sync::Arc, time::Instant};

use holo_display::{Frame, FramePhase, FrameRequest, Interrupt};
use holo_local_objects::{LayerDetail, LitObject, LocalObject, ObjectLayer, ObjectLighting, Room};
use holo_picture::View;

use super::ShownObjects;
use crate::Session;

/// Passes of objects at rest and in files: noise of 2.5 % falls below a third of that.
const PASSES: u32 = 32;

/// Passes by which the light around objects at rest is found, on screens and in files. Those of
/// screens take a few tenths of a second.
const LIGHT_PASSES: u32 = 4;
const LIGHT_PASSES_OF_FILE: u32 = 16;

/// Passes in each frame at rest.
const PASSES_OF_FRAME: u32 = 2;

impl Session {
    /// Returns whether a frame of the objects would be better than the one that is shown.
    pub fn refines_objects(&self) -> bool {
        let objects = &self.objects;
        if objects.is_empty() {
            return false;
        }
        // No other frame may be due: nothing arrives in a replay.
        if objects.has_arrived {
            return true;
        }
        let settles = objects.settles();
        objects.shown.as_ref().is_some_and(|shown| {
            let is_moving = shown.look.is_moving;
            let is_rough = shown.is_quick
                || shown.layer.is_unfinished()
                || self.has_probe()
                || objects.lightings.are_unfinished();
            !is_moving && settles && is_rough
        })
    }

    /// Draws the objects again over the last frame of the driver. `None` if it is of another view,
    /// or there is none.
    pub fn redraw_objects(&mut self) -> Option<Frame> {
        self.objects.has_arrived = false;
        let shown = self.objects.shown.take()?;
        let current_look = self.current.as_ref()?.look;
        if current_look != shown.look {
            return None;
        }
        let phase = if shown.look.is_moving { FramePhase::Moving } else { FramePhase::Rest };
        let base = Arc::clone(&shown.base);
        self.objects.shown = Some(shown);
        let frame = self.over(base, current_look, phase);
        Some(self.in_haze(frame))
    }

    /// Draws the objects over a frame of the driver, of the current view.
    pub(crate) fn with_objects(&mut self, frame: Frame, phase: FramePhase) -> Frame {
        self.objects.has_arrived = false;
        let Some(current) = self.current.as_ref().filter(|_| !frame.is_stereo) else {
            return frame;
        };
        let look = current.look;
        if self.objects.is_empty() {
            self.objects.shown = None;
            return frame;
        }
        self.over(Arc::new(frame), look, phase)
    }

    /// Draws the objects over a frame of the driver, of this view.
    fn over(&mut self, base: Arc<Frame>, look: FrameRequest, phase: FramePhase) -> Frame {
        let is_file = phase == FramePhase::File;
        let mut is_quick = !is_file && (phase == FramePhase::Moving || !self.objects.settles());
        let room = self.room();
        let passes = match (is_quick, is_file) {
            (true, _) => 0,
            (_, true) => LIGHT_PASSES_OF_FILE,
            _ => LIGHT_PASSES,
        };
        let objects = self.lit_objects(is_quick, is_file, passes, room.as_ref());
        let before = self.objects.shown.take();
        let stays = |shown: &ShownObjects| {
            let is_same = shown.look == look
                && shown.is_quick == is_quick
                && shown.objects.len() == objects.len()
                && shown.objects.iter().zip(&objects).all(|(before, now)| before.is_same(now));
            is_same && (room.is_some() || shown.base.depth == base.depth)
        };
        let (side, begin) = (self.objects.sides.side(), Instant::now());
        let detail = if is_quick { LayerDetail::Quick(side) } else { LayerDetail::Exact(PASSES) };
        let never = Interrupt::default();
        let interrupt = if is_file || is_quick { &never } else { &self.interrupt };
        let after = |before: Option<&ShownObjects>, detail: LayerDetail, interrupt: &Interrupt| {
            let before = before.map(|before| &before.layer);
            let (view, room) = (&look.view, room.as_ref());
            ObjectLayer::after(before, &base, view, &objects, room, detail, interrupt)
        };
        let most = if is_file { PASSES } else { PASSES_OF_FRAME };
        let draw = |layer: &mut ObjectLayer, most: u32, interrupt: &Interrupt| {
            let has_work = layer.is_unfinished();
            layer.draw(&base, &objects, room.as_ref(), most, interrupt);
            has_work
        };
        let (mut layer, before) = match before {
            Some(shown) if stays(&shown) => (Some(shown.layer), None),
            before => (after(before.as_ref(), detail, interrupt), before),
        };
        let has_work = layer.as_mut().is_some_and(|layer| draw(layer, most, interrupt));
        if layer.as_ref().is_none_or(|layer| !layer.is_drawn() && layer.is_unfinished()) {
            // Whoever has interrupted it wants a frame soon.
            is_quick = true;
            layer = after(before.as_ref(), LayerDetail::Quick(side), &never);
            if let Some(layer) = &mut layer {
                draw(layer, 1, &never);
            }
        } else if is_quick && has_work {
            self.objects.sides.note(side, begin.elapsed().as_secs_f64());
        }
        let mut frame = Frame::clone(&base);
        if let Some(layer) = layer {
            layer.compose(&mut frame);
            self.objects.shown = Some(ShownObjects { look, base, objects, is_quick, layer });
        }
        frame
    }

    /// Draws the objects and the haze over a part of a picture. `view` is that of the part.
    pub(crate) fn finish_part(
        &mut self,
        picture: holo_picture::Picture,
        view: &View,
    ) -> holo_picture::Picture {
        let is_finished = self.objects.is_empty() && self.haze().is_none();
        let Some(room) = self.room().filter(|_| !is_finished) else { return picture };
        let mut frame = Frame::black(picture.size());
        frame.depth = room.depth(view, picture.size());
        frame.picture = picture;
        if !self.objects.is_empty() {
            let objects = self.lit_objects(false, false, LIGHT_PASSES_OF_FILE, Some(&room));
            self.objects.of_parts.clone_from(&objects);
            let mut layer =
                ObjectLayer::new(&frame, view, &objects, Some(&room), LayerDetail::Exact(PASSES));
            layer.draw(&frame, &objects, Some(&room), PASSES, &Interrupt::default());
            layer.compose(&mut frame);
        }
        self.in_haze(frame).picture
    }

    /// Returns the model of the scene, if it is here.
    fn room(&self) -> Option<Room> {
        self.scene.as_ref().map(|scene| Room::new(Arc::clone(&scene.raycaster)))
    }

    /// Returns an object with its light: that of the frame before, if both are the same.
    fn lit(
        &self,
        object: LocalObject,
        lighting: Arc<ObjectLighting>,
        passes: u32,
        room: Option<&Room>,
    ) -> LitObject {
        let shown = self.objects.shown.iter().flat_map(|shown| &shown.objects);
        let before = shown.chain(&self.objects.of_parts);
        let before = before.filter(|lit| lit.is_of(&object, &lighting));
        let lit = match before.max_by_key(|lit| lit.passes()) {
            Some(lit) => lit.clone(),
            None => LitObject::new(object, lighting),
        };
        if lit.passes() >= passes {
            return lit;
        }
        let never = Interrupt::default();
        let interrupt = if passes == LIGHT_PASSES_OF_FILE { &never } else { &self.interrupt };
        lit.at_rest(room, passes, interrupt).unwrap_or(lit)
    }

    pub(super) fn carried(&self) -> Vec<LocalObject> {
        self.objects.carried.list().iter().map(|carried| carried.object.clone()).collect()
    }

    /// Returns the objects with their light, found by this many passes. Quick frames use light that
    /// is known already.
    fn lit_objects(
        &mut self,
        is_quick: bool,
        is_file: bool,
        passes: u32,
        room: Option<&Room>,
    ) -> Vec<LitObject> {
        let objects = self.carried();
        self.objects.lightings.forget_others(&objects);
        let mut lit = Vec::with_capacity(objects.len());
        for object in objects {
            let lighting = self.lighting(&object, is_quick, is_file, room);
            lit.extend(lighting.map(|lighting| self.lit(object, lighting, passes, room)));
        }
        lit
    }
}
