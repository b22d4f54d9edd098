//! The panel: light under the cursor, the plan, named views, and the parts of the driver's method.

use super::{
    Page, Rect, TextWeight,
    space::{OverlayCamera, Plan},
    words,
};
use crate::{canvas::Point, model::WindowModel, text::Font};

/// Signs in a line of the panel.
const SIGNS: i32 = 36;

/// Width of the names before values, in signs.
const NAME_SIGNS: i32 = 11;

/// Width of the names of parts before their meanings, in signs.
const PART_SIGNS: i32 = 14;

/// Lines above the plan: a heading, seven values and the plan's heading, with gaps.
const LINES_ABOVE: i32 = 10;

/// Largest height of the plan, in lines.
const PLAN_LINES: i32 = 14;

/// Least height of the plan, in lines. A lower plan is not drawn.
const LEAST_PLAN_LINES: i32 = 3;

/// Most named views: those with a key.
const MOST_VIEWS: usize = 9;

/// Length of the view direction on the plan, as a share of the plan's size.
const GAZE: f64 = 0.22;

/// Where the parts of the panel are.
#[derive(Clone, Debug, PartialEq)]
pub struct PanelLayout {
    /// The whole panel.
    pub rect: Rect,
    /// The plan: a square.
    pub plan: Rect,
    /// The line of each named view.
    pub views: Vec<Rect>,
    /// The line of each part of the driver's method that can be switched.
    pub parts: Vec<Rect>,
}

impl PanelLayout {
    /// Returns the layout in a window of a size and scale, with this many named views, and parts
    /// that can be switched.
    pub fn new(size: (u32, u32), scale: f64, views: usize, parts: usize) -> PanelLayout {
        let font = Font::for_scale(scale);
        let (high, margin) = (font.height(), font.height() * 7 / 10);
        let inner = SIGNS * font.width();
        let views = views.min(MOST_VIEWS) as i32;
        // In a low window, the plan shrinks first.
        let parts = parts as i32;
        let block = |lines: i32| if lines > 0 { lines + 2 } else { 0 };
        let lines = LINES_ABOVE + block(views) + block(parts);
        let room = size.1 as i32 - 2 * margin - (lines + 2) * high;
        let side = inner.min(PLAN_LINES * high).min(room).max(0);
        let (width, height) = (inner + 2 * margin, (lines + 1) * high + side);
        let rect = Rect { x: size.0 as i32 - margin - width, y: margin, width, height };
        let x = rect.x + margin;
        let plan = Rect {
            x: x + (inner - side) / 2,
            y: rect.y + LINES_ABOVE * high + high / 2,
            width: side,
            height: side,
        };
        let first = plan.y + side + high * 2;
        let line = |view: i32| Rect { x, y: first + view * high, width: inner, height: high };
        let views_end = block(views);
        let of_parts = |part: i32| line(views_end + part);
        let views = (0..views).map(line).collect();
        PanelLayout { rect, plan, views, parts: (0..parts).map(of_parts).collect() }
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_panel_lies_in_the_window_and_its_plan_gives_way_to_text() {
        let sizes = [((1280, 720), 9, 8), ((1280, 720), 0, 8), ((640, 420), 3, 0)];
        for (size, views, parts) in sizes {
            let layout = PanelLayout::new(size, 1.0, views, parts);
            let rect = layout.rect;
            assert!(rect.y >= 0 && rect.y + rect.height <= size.1 as i32, "{layout:?}");
            assert!(rect.x >= 0 && rect.x + rect.width <= size.0 as i32, "{layout:?}");
            assert_eq!((layout.views.len(), layout.parts.len()), (views, parts));
            let inside = |inner: &Rect| {
                let last = (inner.x + inner.width - 1, inner.y + inner.height - 1);
                rect.contains((f64::from(last.0), f64::from(last.1)))
            };
            let lines = || layout.views.iter().chain(&layout.parts);
            assert!(lines().all(inside) && inside(&layout.plan), "{layout:?}");
            let middle = |line: &Rect| (f64::from(line.x + 1), f64::from(line.y + line.height / 2));
            let at = |line| lines().filter(|other| other.contains(middle(line))).count();
            assert!(lines().all(|line| at(line) == 1), "lines overlap: {layout:?}");
        }
        let side = |height| PanelLayout::new((1280, height), 1.0, 9, 0).plan.width;
        assert!(side(520) < side(720) && side(800) == side(1000));
        assert_eq!(PanelLayout::new((1280, 720), 1.0, 100, 0).views.len(), MOST_VIEWS);
    }
}
