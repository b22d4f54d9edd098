//! The pixels of a window, and drawing into them.
//!
//! Everything outside the canvas is clipped, so callers need not check.

use holo_picture::Image;
use rayon::prelude::*;

/// A colour: red, green and blue, sRGB.
pub type Color = [u8; 3];

/// A point, in pixels from the left and from the top.
pub type Point = (f64, f64);

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rect {
    /// Columns to its left; negative if it begins outside.
    pub x: i32,
    /// Rows above it.
    pub y: i32,
    /// Columns.
    pub width: i32,
    /// Rows.
    pub height: i32,
}

impl Rect {
    /// Returns the largest rectangle with the proportions of `inner` in the middle of `outer`.
    pub fn fit(inner: (u32, u32), outer: (u32, u32)) -> Rect {
        let [iw, ih, ow, oh] =
            [inner.0, inner.1, outer.0, outer.1].map(|side| f64::from(side.max(1)));
        let scale = (ow / iw).min(oh / ih);
        let (width, height) = ((iw * scale).round() as i32, (ih * scale).round() as i32);
        let middle = |outer: u32, side: i32| (outer as i32 - side) / 2;
        Rect { x: middle(outer.0, width), y: middle(outer.1, height), width, height }
    }

    /// Returns the rectangle, smaller by a margin on all sides.
    #[must_use]
    pub fn inset(self, by: i32) -> Rect {
        let side = |side: i32| (side - 2 * by).max(0);
        Rect { x: self.x + by, y: self.y + by, width: side(self.width), height: side(self.height) }
    }

    /// Returns whether a point lies in it.
    pub fn contains(&self, (x, y): Point) -> bool {
        let (u, v) = self.shares((x, y));
        (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)
    }

    /// Returns a point's place in the rectangle, in shares of its sides from the left and top.
    pub fn shares(&self, (x, y): Point) -> Point {
        let share = |at: f64, from: i32, side: i32| (at - f64::from(from)) / f64::from(side.max(1));
        (share(x, self.x, self.width), share(y, self.y, self.height))
    }

    /// Returns the point at shares of its sides.
    pub fn at(&self, (u, v): Point) -> Point {
        let at = |share: f64, from: i32, side: i32| f64::from(from) + share * f64::from(side);
        (at(u, self.x, self.width), at(v, self.y, self.height))
    }
}

/// Pixels to draw into: `0x00RRGGBB`, in rows from the top.
pub struct Canvas<'a> {
    pixels: &'a mut [u32],
    width: usize,
    height: usize,
}

impl<'a> Canvas<'a> {
    /// Returns a canvas over pixels; `None` if their number does not match `size`.
    pub fn new(pixels: &'a mut [u32], size: (u32, u32)) -> Option<Canvas<'a>> {
        let (width, height) = (size.0 as usize, size.1 as usize);
        let fits = width > 0 && pixels.len() == width * height;
        fits.then_some(Canvas { pixels, width, height })
    }

    /// Returns its columns and rows.
    pub fn size(&self) -> (i32, i32) {
        (self.width as i32, self.height as i32)
    }

    /// Fills the whole canvas.
    pub fn clear(&mut self, color: Color) {
        self.pixels.fill(packed(color));
    }

    /// Shows a picture in a rectangle. A picture of another size is scaled with linear
    /// interpolation.
    pub fn picture(&mut self, image: &Image, to: Rect) {
        let (width, height) = (image.width as usize, image.height as usize);
        if image.rgb.len() != 3 * width * height || width == 0 || height == 0 {
            return;
        }
        let (columns, rows) = (self.columns(to), self.rows(to));
        let is_exact = (to.width as usize, to.height as usize) == (width, height);
        if is_exact {
            let left = 3 * (columns.start as i32 - to.x) as usize;
            for row in rows {
                let source = (row as i32 - to.y) as usize * width * 3;
                let source = &image.rgb[source + left..source + width * 3];
                let line = &mut self.pixels[row * self.width..][columns.clone()];
                for (pixel, rgb) in line.iter_mut().zip(source.chunks_exact(3)) {
                    *pixel = packed([rgb[0], rgb[1], rgb[2]]);
                }
            }
            return;
        }
        let blend = |column| PixelBlend::at(column as i32 - to.x, to.width, width);
        let across: Vec<PixelBlend> = columns.clone().map(blend).collect();
        let lines = self.pixels.par_chunks_exact_mut(self.width).enumerate();
        let lines = lines.skip(rows.start).take(rows.len());
        lines.for_each_init(Vec::new, |blended: &mut Vec<u32>, (row, line)| {
            let PixelBlend { first, second, share } =
                PixelBlend::at(row as i32 - to.y, to.height, height);
            let colors = |row: usize| {
                let line = &image.rgb[row * width * 3..][..width * 3];
                line.chunks_exact(3).map(|rgb| packed([rgb[0], rgb[1], rgb[2]]))
            };
            blended.clear();
            blended.extend(colors(first).zip(colors(second)).map(|(a, b)| mixed(a, b, share)));
            for (pixel, PixelBlend { first, second, share }) in
                line[columns.clone()].iter_mut().zip(&across)
            {
                *pixel = mixed(blended[*first], blended[*second], *share);
            }
        });
    }

    /// Fills a rectangle with a colour of opacity `share`.
    pub fn fill(&mut self, rect: Rect, color: Color, share: f32) {
        let columns = self.columns(rect);
        for row in self.rows(rect) {
            for pixel in &mut self.pixels[row * self.width..][columns.clone()] {
                *pixel = blended(*pixel, color, share);
            }
        }
    }

    /// Fills a rectangle with round corners.
    pub fn rounded(&mut self, rect: Rect, radius: i32, color: Color, share: f32) {
        for row in 0..rect.height {
            let from_edge = row.min(rect.height - 1 - row);
            let up = f64::from((radius - from_edge).max(0)) - 0.5;
            let inset = if from_edge >= radius {
                0
            } else {
                let radius = f64::from(radius);
                (radius - (radius * radius - up * up).max(0.0).sqrt()).round() as i32
            };
            let line = Rect {
                x: rect.x + inset,
                y: rect.y + row,
                width: rect.width - 2 * inset,
                height: 1,
            };
            self.fill(line, color, share);
        }
    }

    /// Fills a convex polygon.
    pub fn polygon(&mut self, points: &[Point], color: Color, share: f32) {
        let ends = |side: fn(f64, f64) -> f64, from: f64| {
            points.iter().map(|point| point.1).fold(from, side)
        };
        let (top, bottom) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
        if !(top.is_finite() && bottom.is_finite()) {
            return;
        }
        let rows = (top.floor() as i32).max(0)..(bottom.ceil() as i32).min(self.height as i32);
        for row in rows {
            let y = f64::from(row) + 0.5;
            let edges = points.iter().zip(points.iter().cycle().skip(1));
            let crossings = edges.filter(|(a, b)| (a.1 <= y) != (b.1 <= y));
            let (left, right) = crossings
                .map(|(a, b)| a.0 + (y - a.1) / (b.1 - a.1) * (b.0 - a.0))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, r), x| (l.min(x), r.max(x)));
            if left <= right {
                let (x, end) = (left.round() as i32, right.round() as i32);
                let width = end.saturating_sub(x);
                self.fill(Rect { x, y: row, width, height: 1 }, color, share);
            }
        }
    }

    /// Fills a disc.
    pub fn disc(&mut self, (x, y): Point, radius: f64, color: Color) {
        let corners: Vec<Point> = (0..24)
            .map(|corner| (f64::from(corner) / 24.0 * std::f64::consts::TAU).sin_cos())
            .map(|(sin, cos)| (x + radius * cos, y + radius * sin))
            .collect();
        self.polygon(&corners, color, 1.0);
    }

    /// Draws an antialiased line one pixel wide.
    pub fn line(&mut self, from: Point, to: Point, color: Color, share: f32) {
        let box_ = (self.width as f64, self.height as f64);
        let Some((from, to)) = cut(from, to, box_) else { return };
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let is_flat = dx.abs() >= dy.abs();
        let steps = if is_flat { dx.abs() } else { dy.abs() }.ceil().max(1.0);
        for step in 0..=steps as u32 {
            let at = f64::from(step) / steps;
            let (x, y) = (from.0 + at * dx, from.1 + at * dy);
            let (along, across) = if is_flat { (x, y) } else { (y, x) };
            let along = along.floor();
            let below = (across - 0.5).floor();
            let part = (across - 0.5 - below) as f32;
            for (across, part) in [(below, 1.0 - part), (below + 1.0, part)] {
                let (x, y) = if is_flat { (along, across) } else { (across, along) };
                self.blend(x as i32, y as i32, color, share * part);
            }
        }
    }

    /// Blends a colour over one pixel.
    pub fn blend(&mut self, x: i32, y: i32, color: Color, share: f32) {
        let (width, height) = self.size();
        if (0..width).contains(&x) && (0..height).contains(&y) {
            let pixel = &mut self.pixels[y as usize * self.width + x as usize];
            *pixel = blended(*pixel, color, share);
        }
    }

    /// Returns the columns of a rectangle that lie on the canvas.
    fn columns(&self, rect: Rect) -> std::ops::Range<usize> {
        part(rect.x, rect.width, self.width)
    }

    fn rows(&self, rect: Rect) -> std::ops::Range<usize> {
        part(rect.y, rect.height, self.height)
    }
}

/// Two neighbouring source pixels, and the weight of the second one in 256ths.
struct PixelBlend {
    first: usize,
    second: usize,
    share: u32,
}

impl PixelBlend {
    /// Returns the blend for pixel `at` of `to`, from a row of `from` pixels.
    fn at(at: i32, to: i32, from: usize) -> PixelBlend {
        let last = from.saturating_sub(1);
        let place = (f64::from(at) + 0.5) * from as f64 / f64::from(to.max(1)) - 0.5;
        let place = place.clamp(0.0, last as f64);
        let first = place as usize;
        let share = ((place - first as f64) * 256.0) as u32;
        PixelBlend { first, second: (first + 1).min(last), share }
    }
}

/// Returns the part of `from..from + side` that lies in `0..most`.
fn part(from: i32, side: i32, most: usize) -> std::ops::Range<usize> {
    let most = most as i32;
    let begin = from.clamp(0, most);
    begin as usize..from.saturating_add(side).clamp(begin, most) as usize
}

fn packed([red, green, blue]: Color) -> u32 {
    u32::from_be_bytes([0, red, green, blue])
}

fn blended(pixel: u32, color: Color, share: f32) -> u32 {
    mixed(pixel, packed(color), (share * 256.0) as u32)
}

/// Blends two colours; `share` of 256 is the weight of the second. Red and blue are multiplied
/// together, because a window on a fine screen has millions of pixels.
fn mixed(first: u32, second: u32, share: u32) -> u32 {
    const RED_BLUE: u32 = 0x00ff_00ff;
    const GREEN: u32 = 0x0000_ff00;
    let part = |mask: u32| ((first & mask) * (256 - share) + (second & mask) * share) >> 8 & mask;
    // Green's products need 24 bits, red's and blue's 16 bits each.
    part(RED_BLUE) | part(GREEN)
}

/// Returns the part of a line that lies in a box from the origin (Liang and Barsky 1984).
fn cut(from: Point, to: Point, size: (f64, f64)) -> Option<(Point, Point)> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (mut begin, mut end) = (0.0_f64, 1.0_f64);
    let sides = [(-dx, from.0), (dx, size.0 - from.0), (-dy, from.1), (dy, size.1 - from.1)];
    for (outwards, room) in sides {
        if !(outwards.is_finite() && room.is_finite()) || (outwards == 0.0 && room < 0.0) {
            return None;
        }
        if outwards < 0.0 {
            begin = begin.max(room / outwards);
        } else if outwards > 0.0 {
            end = end.min(room / outwards);
        }
    }
    let at = |share: f64| (from.0 + share * dx, from.1 + share * dy);
    (begin <= end).then(|| (at(begin), at(end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, rgb: &[Color]) -> Image {
        Image { width, height, rgb: rgb.concat(), legend: None, exposure: None }
    }

    fn drawn(size: (u32, u32), draw: impl FnOnce(&mut Canvas)) -> Vec<u32> {
        let mut pixels = vec![0; (size.0 * size.1) as usize];
        draw(&mut Canvas::new(&mut pixels, size).unwrap());
        pixels
    }

    #[test]
    fn a_picture_of_the_rectangle_s_size_is_shown_bit_for_bit() {
        let colors = [[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]];
        let picture = image(2, 2, &colors);
        let to = Rect { x: 1, y: 0, width: 2, height: 2 };
        let pixels = drawn((3, 2), |canvas| canvas.picture(&picture, to));
        assert_eq!(pixels, [0, 0x0001_0203, 0x0004_0506, 0, 0x0007_0809, 0x000a_0b0c]);
        // A picture that is partly outside is clipped and not moved.
        let to = Rect { x: -1, y: -1, width: 2, height: 2 };
        let pixels = drawn((2, 1), |canvas| canvas.picture(&picture, to));
        assert_eq!(pixels, [0x000a_0b0c, 0]);
    }

    #[test]
    fn a_smaller_picture_is_enlarged_without_steps_and_keeps_its_corners() {
        let picture = image(2, 1, &[[0; 3], [200; 3]]);
        let to = Rect { x: 0, y: 0, width: 8, height: 2 };
        let pixels = drawn((8, 2), |canvas| canvas.picture(&picture, to));
        let red: Vec<u32> = pixels[..8].iter().map(|pixel| pixel >> 16).collect();
        assert_eq!((red[0], red[7]), (0, 200));
        assert!(red.is_sorted() && red.windows(2).all(|pair| pair[1] - pair[0] <= 50), "{red:?}");
        assert_eq!(pixels[..8], pixels[8..]);
        let even = image(3, 3, &[[77, 78, 79]; 9]);
        let to = Rect { x: 0, y: 0, width: 7, height: 5 };
        let pixels = drawn((7, 5), |canvas| canvas.picture(&even, to));
        assert!(pixels.iter().all(|&pixel| pixel == 0x004d_4e4f), "{pixels:x?}");
    }

    #[test]
    fn a_picture_keeps_its_shape_in_the_middle() {
        assert_eq!(Rect::fit((16, 9), (1600, 900)), Rect { x: 0, y: 0, width: 1600, height: 900 });
        let rect = Rect::fit((100, 100), (300, 100));
        assert_eq!(rect, Rect { x: 100, y: 0, width: 100, height: 100 });
        assert_eq!(rect.shares((150.0, 25.0)), (0.5, 0.25));
        assert_eq!(rect.at((0.5, 0.25)), (150.0, 25.0));
        assert!(rect.contains((100.0, 0.0)) && !rect.contains((99.9, 0.0)));
    }

    #[test]
    fn shapes_fill_their_area_and_nothing_outside_the_canvas() {
        let all = 4.0;
        let square = [(1.0, 1.0), (5.0, 1.0), (5.0, 5.0), (1.0, 5.0)];
        let pixels = drawn((8, 8), |canvas| canvas.polygon(&square, [255; 3], 1.0));
        let lit = pixels.iter().filter(|&&pixel| pixel > 0).count();
        assert_eq!(lit as f64, all * all);
        let far = [(-1e9, -1e9), (1e9, -1e9), (1e9, 1e9), (-1e9, 1e9)];
        let pixels = drawn((4, 4), |canvas| canvas.polygon(&far, [255; 3], 1.0));
        assert!(pixels.iter().all(|&pixel| pixel == 0x00ff_ffff));
        let endless = [(f64::NAN, 0.0), (0.0, f64::INFINITY), (3.0, 3.0)];
        drawn((4, 4), |canvas| {
            canvas.polygon(&endless, [255; 3], 1.0);
            canvas.line(endless[0], endless[1], [255; 3], 1.0);
            canvas.line((-1e300, 2.0), (1e300, 2.0), [255; 3], 1.0);
            canvas.rounded(Rect { x: -5, y: -5, width: 90, height: 90 }, 4, [9; 3], 0.5);
        });
    }

    #[test]
    fn a_line_s_light_lies_on_it() {
        let pixels = drawn((20, 20), |canvas| canvas.line((2.0, 3.5), (18.0, 3.5), [255; 3], 1.0));
        for (at, pixel) in pixels.iter().enumerate() {
            assert_eq!(*pixel > 0, at / 20 == 3 && (2..=18).contains(&(at % 20)), "{at}");
        }
        let slope = drawn((20, 20), |canvas| canvas.line((0.0, 0.0), (20.0, 10.0), [255; 3], 1.0));
        let light: u32 = slope.iter().map(|pixel| pixel & 255).sum();
        assert!((20 * 200..22 * 255).contains(&light), "{light}");
    }
}
