//! The list of keys.

use holo_stage::commands::{ACTIONS, GESTURES};

use super::{Font, Page, Rect, TextWeight};

/// Additional keys of windows.
const OF_WINDOWS: [(&str, &str); 2] = [("Enter", "type a line"), ("Ctrl Q", "quit at once")];

impl Page<'_, '_> {
    /// Lists the keys, in a font that fits the window.
    pub(super) fn help(&mut self, scale: f64) {
        let (font, list) = HelpList::fitting(self.size(), scale);
        self.font = font;
        let (high, sign) = (font.height(), font.width());
        let (width, height) = list.size(font);
        let (all_wide, all_high) = self.size();
        let (x, y) = ((all_wide - width) / 2, (all_high - height) / 2);
        let all = Rect { x: 0, y: 0, width: all_wide, height: all_high };
        self.canvas.fill(all, [0; 3], 0.45);
        self.glass(Rect { x, y, width, height }, Some(self.theme.dim));
        let theme = self.theme;
        self.write((x + high / 2, y + high / 2), "Keys", TextWeight::Bold, theme.accent);
        for (index, (keys, what)) in (0..).zip(rows()) {
            let (column, row) = (index / list.rows(), index % list.rows());
            let at = (x + high / 2 + column * list.column() * sign, y + high * 2 + row * high);
            self.write(at, keys, TextWeight::Bold, theme.text);
            self.write((at.0 + list.key_signs * sign, at.1), what, TextWeight::Regular, theme.dim);
        }
    }
}

/// Returns all keys and gestures, and what they do.
fn rows() -> impl Iterator<Item = (&'static str, &'static str)> {
    let keys = ACTIONS.iter().map(|action| (action.shown, action.help));
    keys.chain(GESTURES.iter().copied()).chain(OF_WINDOWS)
}

/// The layout of the list of keys, in signs.
struct HelpList {
    key_signs: i32,
    help_signs: i32,
    columns: i32,
}

impl HelpList {
    /// Returns the largest font that lets the list fit, and the list's layout in that font.
    fn fitting(size: (i32, i32), scale: f64) -> (Font, HelpList) {
        let one = Font::for_scale(1.0);
        let signs = |text: &str| one.width_of(text) / one.width();
        let key_signs = rows().map(|(keys, _)| signs(keys)).max().unwrap_or(0) + 1;
        let help_signs = rows().map(|(_, what)| signs(what)).max().unwrap_or(0);
        let list = |columns| HelpList { key_signs, help_signs, columns };
        let fonts = [1.0, 0.8, 0.6, 0.4].map(|part| Font::for_scale(part * scale));
        let choices = fonts.into_iter().flat_map(|font| [2, 1, 3].map(|count| (font, list(count))));
        let fits = |(font, list): &(Font, HelpList)| {
            let (width, height) = list.size(*font);
            width <= size.0 && height <= size.1
        };
        let mut fitting = choices.filter(fits);
        fitting.next().unwrap_or((Font::for_scale(0.0), list(2)))
    }

    fn rows(&self) -> i32 {
        (rows().count() as i32 + self.columns - 1) / self.columns
    }

    /// Returns the distance between two columns, in signs.
    fn column(&self) -> i32 {
        self.key_signs + self.help_signs + 1
    }

    /// Returns width and height, pixels.
    fn size(&self, font: Font) -> (i32, i32) {
        let signs = self.columns * self.column() - 1;
        (signs * font.width() + font.height(), (self.rows() * 2 + 5) * font.height() / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_keys_fit_into_the_window_at_any_scale() {
        for (size, scale) in [((1280, 720), 1.0), ((1000, 600), 1.0), ((2560, 1440), 2.0)] {
            let (font, list) = HelpList::fitting(size, scale);
            assert_eq!(font, Font::for_scale(scale), "{size:?}");
            let (width, height) = list.size(font);
            assert!(width <= size.0 && height <= size.1, "{size:?} {width}×{height}");
        }
        for (size, scale) in [((1280, 720), 2.0), ((640, 480), 1.0), ((700, 900), 1.5)] {
            let (font, list) = HelpList::fitting(size, scale);
            let (width, height) = list.size(font);
            assert!(width <= size.0 && height <= size.1, "{size:?} {width}×{height}");
        }
    }
}
