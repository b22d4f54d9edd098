//! The panel: light under the cursor, the plan, named views, and the parts of the driver's method.

use super::{
    Page, Rect, TextWeight,
    space::{OverlayCamera, Plan},
    words,
};
use crate::{canvas::Point, model::WindowModel, panel_layout::SIGNS};

/// Width of the names before values, in signs.
const NAME_SIGNS: i32 = 11;

/// Width of the names of parts before their meanings, in signs.
const PART_SIGNS: i32 = 14;

/// Least height of the plan, in lines. A lower plan is not drawn.
const LEAST_PLAN_LINES: i32 = 3;

/// Length of the view direction on the plan, as a share of the plan's size.
const GAZE: f64 = 0.22;

impl Page<'_, '_> {
    pub(super) fn panel(&mut self, model: &WindowModel) {
        let layout = model.panel();
        let (high, theme) = (self.font.height(), self.theme);
        self.glass(layout.rect, Some(theme.dim));
        let x = layout.rect.x + high * 7 / 10;
        let (exposure, tone) = model.display.words();
        let seen = model.seen.as_deref();
        let driver = model.state.driver.to_owned();
        let light = [("Drawing", driver), ("Exposure", exposure), ("Shown", tone.to_owned())];
        self.write((x, layout.rect.y + high / 2), "LIGHT", TextWeight::Bold, theme.dim);
        let values = light.into_iter().chain(words::under_cursor(seen, model.cursor()));
        for (row, (name, value)) in (0..).zip(values) {
            let y = layout.rect.y + high * 3 / 2 + row * high;
            self.write((x, y), name, TextWeight::Regular, theme.dim);
            let at = (x + NAME_SIGNS * self.font.width(), y);
            self.write(at, &value, TextWeight::Regular, theme.text);
        }
        let heading = layout.plan.y - high * 5 / 4;
        self.write((x, heading), "PLAN", TextWeight::Bold, theme.dim);
        self.plan(model, layout.plan);
        if let Some(first) = layout.views.first() {
            self.write((x, first.y - high), "VIEWS", TextWeight::Bold, theme.dim);
        }
        let names = model.state.views.iter().map(|(name, _)| name);
        for ((index, line), name) in (1..).zip(&layout.views).zip(names) {
            let name: String = name.chars().take(SIGNS as usize - 3).collect();
            self.write((line.x, line.y), &index.to_string(), TextWeight::Bold, theme.accent);
            let at = (line.x + 3 * self.font.width(), line.y);
            self.write(at, &name, TextWeight::Regular, theme.text);
        }
        if let Some(first) = layout.parts.first() {
            let heading = (x, first.y - high);
            self.write(heading, "PARTS OF THE METHOD", TextWeight::Bold, theme.dim);
        }
        for (line, part) in layout.parts.iter().zip(&*model.state.parts) {
            let colour = if part.is_on { theme.accent } else { theme.dim };
            self.write((line.x, line.y), part.name, TextWeight::Bold, colour);
            let at = (line.x + PART_SIGNS * self.font.width(), line.y);
            let meaning = if part.is_on { part.meaning } else { "off" };
            self.write(at, meaning, TextWeight::Regular, theme.text);
        }
    }

    /// Draws the sections from above, the eye and its view direction.
    fn plan(&mut self, model: &WindowModel, square: Rect) {
        let theme = self.theme;
        if square.width < LEAST_PLAN_LINES * self.font.height() {
            return;
        }
        self.canvas.rounded(square, self.font.height() * 3 / 10, theme.text, 0.07);
        let Some(plan) = Plan::new(&model.state) else { return };
        let at = |place: Point| square.at(plan.place(place));
        for (outline, is_interior) in &plan.outlines {
            let corners: Vec<Point> = outline.iter().map(|&corner| at(corner)).collect();
            self.canvas.polygon(&corners, theme.accent, if *is_interior { 0.22 } else { 0.1 });
            for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
                self.canvas.line(*from, *to, theme.accent, 1.0);
            }
        }
        let view = model.seen.as_ref().map(|seen| &seen.shown.view);
        let Some(camera) = OverlayCamera::now(&model.state, view) else { return };
        let eye = plan.flat(camera.eye);
        let ends = camera.sides().map(|side| {
            let (x, y) = plan.flat(side);
            let length = x.hypot(y).max(1e-9) / (GAZE * plan.size);
            at((eye.0 + x / length, eye.1 + y / length))
        });
        self.canvas.polygon(&[at(eye), ends[0], ends[1]], theme.text, 0.3);
        let radius = f64::from(self.font.height()) * 0.25;
        self.canvas.disc(at(eye), radius + 1.5, theme.back);
        self.canvas.disc(at(eye), radius, theme.text);
    }
}
