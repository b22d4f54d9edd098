//! Everything drawn over the picture: a function of the window's model and the time.

mod help;
mod panel;
pub mod space;
mod words;

use std::time::Instant;

use super::{
    canvas::{Canvas, Color, Point, Rect},
    model::{Grids, WindowModel},
    text::{self, Font, TextWeight},
};
use holo_stage::{StagePhase, on_screen_threads};
use space::{Lost, OverlayCamera};

/// Opacity of grids.
const ALWAYS: f32 = 0.5;
const WHERE_UNKNOWN: f32 = 0.35;

/// Grids are drawn if a greater share of the picture is unknown.
const MOST_UNKNOWN: f64 = 0.95;

/// Opacity of the background of text.
const GLASS: f32 = 0.86;

/// Examples of command lines.
const LINES: &str = "keep NAME · view NAME · view -vp 1 2 3 · picture FILE.exr 1920x1080";

/// Colours of the overlay.
struct Theme {
    back: Color,
    text: Color,
    dim: Color,
    glass: Color,
    accent: Color,
    bad: Color,
}

const DARK: Theme = Theme {
    back: [12, 13, 16],
    text: [236, 238, 242],
    dim: [154, 161, 173],
    glass: [20, 22, 27],
    accent: [255, 180, 84],
    bad: [255, 123, 114],
};

const LIGHT: Theme = Theme {
    back: [233, 234, 238],
    text: [27, 29, 34],
    dim: [91, 98, 112],
    glass: [250, 250, 252],
    accent: [179, 92, 0],
    bad: [179, 38, 30],
};

/// Draws the whole window.
pub fn draw(canvas: &mut Canvas, model: &WindowModel, now: Instant) {
    let theme = if model.modes.is_light { &LIGHT } else { &DARK };
    let font = Font::for_scale(model.scale);
    let mut page = Page { canvas, theme, font };
    page.canvas.clear(theme.back);
    let picture = model.picture();
    if let Some(seen) = &model.seen {
        on_screen_threads(|| page.canvas.picture(&seen.image, picture));
    }
    page.grids(model, picture);
    page.legend(model);
    if !model.modes.is_bare {
        page.focus(model, picture);
        page.status(model, now);
        page.welcome(model);
        if model.modes.has_panel {
            page.panel(model);
        }
    }
    page.lost(model);
    page.notice(model, now);
    page.loading(model);
    page.typed(model);
    if model.modes.has_help {
        page.help(model.scale);
    }
}

/// A canvas with a theme and a font size.
struct Page<'a, 'b> {
    canvas: &'a mut Canvas<'b>,
    theme: &'static Theme,
    font: Font,
}

/// A piece of one line: text, weight and colour.
type Word<'a> = (&'a str, TextWeight, Color);

impl Page<'_, '_> {
    fn size(&self) -> (i32, i32) {
        self.canvas.size()
    }

    /// Returns a length, given in tenths of a line's height.
    fn tenths(&self, tenths: i32) -> i32 {
        self.font.height() * tenths / 10
    }

    fn write(&mut self, at: (i32, i32), text: &str, weight: TextWeight, color: Color) {
        text::write(self.canvas, (self.font, weight), at, text, color);
    }

    /// Writes pieces of text one after another.
    fn words(&mut self, (mut x, y): (i32, i32), words: &[Word]) {
        for (text, weight, color) in words {
            self.write((x, y), text, *weight, *color);
            x += self.font.width_of(text);
        }
    }

    /// Draws a background for text, with a border.
    fn glass(&mut self, rect: Rect, border: Option<Color>) {
        let radius = self.tenths(5);
        if let Some(border) = border {
            self.canvas.rounded(rect.inset(-1), radius, border, 1.0);
            self.canvas.rounded(rect, radius, self.theme.back, 1.0);
        }
        self.canvas.rounded(rect, radius, self.theme.glass, GLASS);
    }

    /// Draws lines of text in a centred box that starts at `top`. Returns the box's lower end.
    fn message(&mut self, top: i32, lines: &[String], border: Option<Color>) -> i32 {
        let (pad, high) = (self.tenths(6), self.font.height());
        let wide = lines.iter().map(|line| self.font.width_of(line)).max().unwrap_or(0);
        let height = high * lines.len() as i32 + 2 * pad;
        let (width, x) = (wide + 2 * pad, (self.size().0 - wide) / 2 - pad);
        self.glass(Rect { x, y: top, width, height }, border);
        for (row, line) in (0..).zip(lines) {
            let color = self.theme.text;
            self.write((x + pad, top + pad + row * high), line, TextWeight::Regular, color);
        }
        top + height
    }

    /// Breaks a text into lines that fit the window.
    fn wrapped(&self, text: &str) -> Vec<String> {
        let room = (self.size().0 - 4 * self.font.height()) / self.font.width();
        text::wrapped(text, room.clamp(10, 76) as usize)
    }

    fn grids(&mut self, model: &WindowModel, picture: Rect) {
        let strength = strength(model);
        let view = model.seen.as_ref().map(|seen| &seen.shown.view);
        let Some(camera) = OverlayCamera::now(&model.state, view).filter(|_| strength > 0.0) else {
            return;
        };
        for line in camera.grids(&model.state.sections) {
            let share = if line.is_edge { strength } else { 0.5 * strength };
            let (from, to) = (picture.at(line.from), picture.at(line.to));
            self.canvas.line(from, to, self.theme.accent, share);
        }
    }

    /// Outlines the part of the picture that is traced first.
    fn focus(&mut self, model: &WindowModel, picture: Rect) {
        let Some([left, top, right, bottom]) = model.focus() else { return };
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        let corners = corners.map(|corner| picture.at(corner));
        for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            self.canvas.line(*from, *to, self.theme.accent, 1.0);
        }
    }

    fn status(&mut self, model: &WindowModel, now: Instant) {
        let fields = words::status(&model.state, model.seen.as_deref(), &model.pace, now);
        let (pad, high, gap) = (self.tenths(5), self.font.height(), self.font.width() * 2);
        let left = self.tenths(7);
        let most = self.size().0 - 2 * left - 2 * pad;
        let mut lines: Vec<(i32, Vec<(i32, &words::Field)>)> = Vec::new();
        for field in &fields {
            let space = if field.unit.is_empty() { "" } else { " " };
            let wide = self.font.width_of(&field.value)
                + self.font.width_of(space)
                + self.font.width_of(field.unit);
            match lines.last_mut() {
                Some((end, line)) if *end + gap + wide <= most => {
                    line.push((*end + gap, field));
                    *end += gap + wide;
                }
                _ => lines.push((wide, vec![(0, field)])),
            }
        }
        let Some(width) = lines.iter().map(|line| line.0).max() else { return };
        let height = high * lines.len() as i32 + pad;
        let y = self.size().1 - left - height;
        self.glass(Rect { x: left, y, width: width + 2 * pad, height }, None);
        for (row, (_, line)) in (0..).zip(lines) {
            for (x, field) in line {
                let theme = self.theme;
                let value = if field.is_bad { theme.bad } else { theme.text };
                let at = (left + pad + x, y + pad / 2 + row * high);
                let words = [
                    (field.value.as_str(), TextWeight::Bold, value),
                    (" ", TextWeight::Regular, theme.dim),
                    (field.unit, TextWeight::Regular, theme.dim),
                ];
                self.words(at, &words);
            }
        }
    }

    /// Shows first instructions, until the person does something.
    fn welcome(&mut self, model: &WindowModel) {
        if model.has_acted || model.seen.is_none() {
            return;
        }
        const WORDS: [(&str, &str); 5] = [
            ("Drag", " to look around   "),
            ("W A S D", " to walk   "),
            ("Wheel", " to approach   "),
            ("Right drag", " to orbit   "),
            ("?", " for more"),
        ];
        let wide: i32 =
            WORDS.iter().map(|(a, b)| self.font.width_of(a) + self.font.width_of(b)).sum();
        let (pad, high) = (self.tenths(7), self.font.height());
        let (x, y) = ((self.size().0 - wide) / 2, self.size().1 - 5 * high);
        if x < pad {
            return;
        }
        let rect = Rect { x: x - pad, y: y - pad, width: wide + 2 * pad, height: high + 2 * pad };
        self.glass(rect, None);
        let theme = self.theme;
        let words: Vec<Word> = WORDS
            .iter()
            .flat_map(|&(keys, what)| {
                [(keys, TextWeight::Bold, theme.accent), (what, TextWeight::Regular, theme.text)]
            })
            .collect();
        self.words((x, y), &words);
    }

    fn legend(&mut self, model: &WindowModel) {
        let Some(legend) = model.seen.as_ref().and_then(|seen| seen.image.legend.as_ref()) else {
            return;
        };
        let (pad, high) = (self.tenths(6), self.font.height());
        let labels = legend.ticks.iter().map(|tick| tick.label.as_str()).chain([legend.unit]);
        let wide = labels.map(|label| self.font.width_of(label)).max().unwrap_or(0);
        let bar = self.tenths(8);
        let height = (self.size().1 * 52 / 100).min(21 * high).max(4 * high);
        let x = self.tenths(7);
        let y = (self.size().1 - height) / 2;
        let width = 2 * pad + bar + self.tenths(6) + wide;
        self.glass(Rect { x, y, width, height }, None);
        let (dim, ink) = (self.theme.dim, self.theme.text);
        self.write((x + pad, y + pad / 2), legend.unit, TextWeight::Regular, dim);
        let (top, bottom) = (y + high * 2, y + height - pad);
        let length = (bottom - top).max(1);
        for row in 0..length {
            let place = 1.0 - (row as f32 + 0.5) / length as f32;
            let line = Rect { x: x + pad, y: top + row, width: bar, height: 1 };
            self.canvas.fill(line, legend.color(place), 1.0);
        }
        let mut last = i32::MAX;
        for tick in &legend.ticks {
            let at = bottom - (tick.place * length as f32).round() as i32;
            let mark = Rect { x: x + pad + bar, y: at, width: self.tenths(3), height: 1 };
            self.canvas.fill(mark, ink, 1.0);
            if last - at >= high {
                let place = (x + pad + bar + self.tenths(5), at - high / 2);
                self.write(place, &tick.label, TextWeight::Regular, ink);
                last = at;
            }
        }
    }

    fn lost(&mut self, model: &WindowModel) {
        let view = model.seen.as_ref().map(|seen| &seen.shown.view);
        let camera = OverlayCamera::now(&model.state, view);
        let Some(lost) = camera.and_then(|camera| Lost::new(&camera, &model.state)) else {
            return;
        };
        let lines = self.wrapped(&words::lost(&lost));
        let top = self.size().1 / 5;
        let end = self.message(top, &lines, Some(self.theme.accent));
        let (middle, radius) = (
            (f64::from(self.size().0) / 2.0, f64::from(end + self.font.height() * 2)),
            f64::from(self.font.height()),
        );
        let accent = self.theme.accent;
        match lost.turn {
            Some(angle) => self.arrow(middle, radius, angle),
            None => self.canvas.disc(middle, radius / 2.0, accent),
        }
    }

    /// Draws an arrow that points up, turned clockwise by `angle`.
    fn arrow(&mut self, (x, y): Point, radius: f64, angle: f64) {
        let at = |across: f64, along: f64| {
            let (sin, cos) = angle.sin_cos();
            let (across, along) = (across * radius, along * radius);
            (x + across * cos + along * sin, y + across * sin - along * cos)
        };
        let accent = self.theme.accent;
        self.canvas.polygon(&[at(0.0, 1.0), at(0.7, 0.1), at(-0.7, 0.1)], accent, 1.0);
        let shaft = [at(0.22, 0.1), at(0.22, -1.0), at(-0.22, -1.0), at(-0.22, 0.1)];
        self.canvas.polygon(&shaft, accent, 1.0);
    }

    fn notice(&mut self, model: &WindowModel, now: Instant) {
        let Some(text) = model.notice(now) else { return };
        let lines = self.wrapped(text);
        self.message(self.font.height() * 2, &lines, Some(self.theme.bad));
    }

    fn loading(&mut self, model: &WindowModel) {
        if let Some(text) = words::loading(&model.state, model.seen.is_some()) {
            let lines = self.wrapped(&text);
            self.message(self.size().1 / 2 - self.font.height(), &lines, None);
        }
    }

    /// Shows the command line that is being typed, with examples.
    fn typed(&mut self, model: &WindowModel) {
        let Some(line) = model.typed() else { return };
        let mut lines = self.wrapped(&format!("> {line}_"));
        lines.extend(self.wrapped(LINES));
        let height = (lines.len() as i32 + 5) * self.font.height();
        self.message(self.size().1 - height, &lines, Some(self.theme.accent));
    }
}

/// Returns the opacity of the sections' grids.
fn strength(model: &WindowModel) -> f32 {
    let unknown = model.seen.as_ref().map_or(0.0, |seen| {
        let frame = &seen.shown.frame;
        frame.empty_pixels as f64 / frame.depth.len().max(1) as f64
    });
    match model.modes.grids {
        Grids::Never => 0.0,
        Grids::Always => ALWAYS,
        Grids::Auto if model.modes.is_bare || model.state.phase != StagePhase::Running => 0.0,
        Grids::Auto if model.state.is_uncovered => ALWAYS,
        Grids::Auto if unknown > MOST_UNKNOWN => WHERE_UNKNOWN,
        Grids::Auto => 0.0,
    }
}

#[cfg(test)]
mod tests;
