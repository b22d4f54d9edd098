//! Where the parts of the panel are.

use super::{canvas::Rect, text::Font};

/// Signs in a line of the panel.
pub const SIGNS: i32 = 36;

/// Lines above the plan: a heading, seven values and the plan's heading, with gaps.
const LINES_ABOVE: i32 = 10;

/// Largest height of the plan, in lines.
const PLAN_LINES: i32 = 14;

/// Most named views: those with a key.
const MOST_VIEWS: usize = 9;

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
