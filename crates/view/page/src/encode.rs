//! Encodes parts of a picture as images that browsers decode.

use anyhow::{Context, Result};
use jpeg_encoder::{ColorType, Encoder};

/// Side of the squares in which changes are detected, pixels: a multiple of JPEG's blocks.
pub const TILE: u32 = 64;

/// A rectangle of a picture, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureRect {
    /// Columns to its left.
    pub x: u32,
    /// Rows above it.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Rows of a strip that one thread encodes. With fewer rows, starting threads would cost more than
/// they save.
const STRIP: u32 = 3 * TILE;

impl PictureRect {
    /// Splits the rectangle into strips, which are encoded and decoded in parallel.
    pub fn strips(self) -> impl Iterator<Item = PictureRect> {
        let end = self.y + self.height;
        let tops = (self.y..end).step_by(STRIP as usize);
        tops.map(move |y| PictureRect { y, height: STRIP.min(end - y), ..self })
    }
}

/// How a part is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    /// JPEG of this quality, from 1 to 100.
    Jpeg(u8),
    /// PNG, which keeps the colours exactly.
    Png,
}

/// A picture's colours: sRGB bytes, rows from the top.
#[derive(Clone, Copy)]
pub struct Colours<'a> {
    /// Three bytes for each pixel.
    pub bytes: &'a [u8],
    /// Columns and rows.
    pub size: (u32, u32),
}

impl Colours<'_> {
    /// Encodes a part.
    ///
    /// # Errors
    /// If the part does not lie in the picture, or is larger than JPEG can be.
    pub fn encode(&self, rect: PictureRect, coding: Coding) -> Result<Vec<u8>> {
        let part = self.part(rect).context("the part lies outside the picture")?;
        let mut bytes = Vec::new();
        match coding {
            Coding::Jpeg(quality) => {
                let side = |side: u32| u16::try_from(side).context("a JPEG has short sides");
                let (width, height) = (side(rect.width)?, side(rect.height)?);
                Encoder::new(&mut bytes, quality).encode(&part, width, height, ColorType::Rgb)?;
            }
            Coding::Png => {
                let mut encoder = png::Encoder::new(&mut bytes, rect.width, rect.height);
                encoder.set_color(png::ColorType::Rgb);
                encoder.set_compression(png::Compression::Fast);
                encoder.write_header()?.write_image_data(&part)?;
            }
        }
        Ok(bytes)
    }

    fn part(&self, rect: PictureRect) -> Option<Vec<u8>> {
        let (left, right) = (3 * rect.x as usize, 3 * (rect.x + rect.width) as usize);
        let rows = self.bytes.chunks(3 * self.size.0 as usize);
        let rows = rows.skip(rect.y as usize).take(rect.height as usize);
        let parts: Option<Vec<&[u8]>> = rows.map(|row| row.get(left..right)).collect();
        parts.map(|parts| parts.concat())
    }
}

/// A set of square tiles of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tiles {
    columns: u32,
    size: (u32, u32),
    is_in: Vec<bool>,
}

impl Tiles {
    /// Returns the set of all tiles of a picture, or the empty set.
    pub fn new(size: (u32, u32), all: bool) -> Tiles {
        let columns = size.0.div_ceil(TILE);
        let is_in = vec![all; (columns * size.1.div_ceil(TILE)) as usize];
        Tiles { columns, size, is_in }
    }

    /// Returns the tiles that differ between two pictures of one size.
    pub fn changed(before: &[u8], after: &[u8], size: (u32, u32)) -> Tiles {
        let mut tiles = Tiles::new(size, false);
        let (row, tile) = (3 * size.0 as usize, 3 * TILE as usize);
        for (y, (before, after)) in before.chunks(row).zip(after.chunks(row)).enumerate() {
            let first = (y as u32 / TILE * tiles.columns) as usize;
            let parts = before.chunks(tile).zip(after.chunks(tile));
            for (is_in, (before, after)) in tiles.is_in[first..].iter_mut().zip(parts) {
                *is_in = *is_in || before != after;
            }
        }
        tiles
    }

    /// Returns whether the set is empty.
    pub fn is_empty(&self) -> bool {
        !self.is_in.contains(&true)
    }

    /// Returns an upper bound of the number of pixels in the tiles.
    pub fn pixels(&self) -> f64 {
        let tiles = self.is_in.iter().filter(|is_in| **is_in).count();
        tiles as f64 * f64::from(TILE * TILE)
    }

    /// Adds all of `others`.
    pub fn add(&mut self, others: &Tiles) {
        self.is_in.iter_mut().zip(&others.is_in).for_each(|(is_in, other)| *is_in |= other);
    }

    /// Removes all of `others`.
    pub fn remove(&mut self, others: &Tiles) {
        self.is_in.iter_mut().zip(&others.is_in).for_each(|(is_in, other)| *is_in &= !other);
    }

    /// Returns the first `most` tiles.
    pub fn first(&self, most: usize) -> Tiles {
        let mut left = most;
        let mut tiles = self.clone();
        for is_in in &mut tiles.is_in {
            *is_in = *is_in && left > 0;
            left -= usize::from(*is_in);
        }
        tiles
    }

    /// Returns disjoint rectangles that cover exactly these tiles.
    pub fn rects(&self) -> Vec<PictureRect> {
        let mut done: Vec<PictureRect> = Vec::new();
        // The rectangles that end at the row of tiles above.
        let mut open: Vec<PictureRect> = Vec::new();
        for (y, row) in (0..).zip(self.is_in.chunks(self.columns.max(1) as usize)) {
            let runs = runs(row).into_iter().map(|(first, count)| self.rect(first, y, count));
            let next: Vec<PictureRect> = runs
                .map(|run| {
                    let above =
                        open.iter().position(|above| (above.x, above.width) == (run.x, run.width));
                    match above.map(|at| open.swap_remove(at)) {
                        Some(above) => PictureRect { height: above.height + run.height, ..above },
                        None => run,
                    }
                })
                .collect();
            done.append(&mut open);
            open = next;
        }
        done.append(&mut open);
        done
    }

    fn rect(&self, column: u32, row: u32, columns: u32) -> PictureRect {
        let (x, y) = (column * TILE, row * TILE);
        let width = (columns * TILE).min(self.size.0 - x);
        PictureRect { x, y, width, height: TILE.min(self.size.1 - y) }
    }
}

/// Returns the runs of `true` in a row: the first index and the length of each.
fn runs(row: &[bool]) -> Vec<(u32, u32)> {
    let mut runs: Vec<(u32, u32)> = Vec::new();
    for (at, _) in (0..).zip(row).filter(|(_, is_in)| **is_in) {
        match runs.last_mut() {
            Some((first, count)) if *first + *count == at => *count += 1,
            _ => runs.push((at, 1)),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_hold_each_changed_tile_once_and_nothing_else() {
        let mut state = 1_u64;
        for case in 0..200 {
            let size = (1 + case * 7 % 700, 1 + case * 13 % 500);
            let mut tiles = Tiles::new(size, false);
            for is_in in &mut tiles.is_in {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                *is_in = (state >> 62) > 0;
            }
            let mut covered = vec![0_u32; (size.0 * size.1) as usize];
            for rect in tiles.rects() {
                for y in rect.y..rect.y + rect.height {
                    for x in rect.x..rect.x + rect.width {
                        covered[(y * size.0 + x) as usize] += 1;
                    }
                }
            }
            for (at, covered) in (0..).zip(covered) {
                let (x, y) = (at % size.0, at / size.0);
                let is_in = tiles.is_in[(y / TILE * tiles.columns + x / TILE) as usize];
                assert_eq!(covered, u32::from(is_in));
            }
        }
    }

    #[test]
    fn strips_are_a_rectangle_without_gaps() {
        let rect = PictureRect { x: 64, y: 128, width: 100, height: 2 * STRIP + 5 };
        let strips: Vec<PictureRect> = rect.strips().collect();
        assert_eq!(strips.len(), 3);
        let mut next = rect.y;
        for strip in strips {
            assert_eq!((strip.x, strip.width, strip.y), (rect.x, rect.width, next));
            next += strip.height;
        }
        assert_eq!(next, rect.y + rect.height);
    }

    #[test]
    fn a_changed_byte_changes_its_tile_alone() {
        let size = (200, 130);
        let before = vec![0; 200 * 130 * 3];
        let mut after = before.clone();
        after[3 * (129 * 200 + 199) + 2] = 1;
        let rects = Tiles::changed(&before, &after, size).rects();
        assert_eq!(rects, [PictureRect { x: 192, y: 128, width: 8, height: 2 }]);
        assert!(Tiles::changed(&before, &before, size).is_empty());
    }

    #[test]
    fn a_png_holds_exactly_the_part() {
        let bytes: Vec<u8> = (0..100 * 80 * 3).map(|i| (i * 31 % 251) as u8).collect();
        let colours = Colours { bytes: &bytes, size: (100, 80) };
        let rect = PictureRect { x: 10, y: 20, width: 30, height: 40 };
        let png = colours.encode(rect, Coding::Png).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut decoded = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut decoded).unwrap();
        assert_eq!(decoded, colours.part(rect).unwrap());
        let outside = PictureRect { x: 90, ..rect };
        assert!(colours.encode(outside, Coding::Png).is_err());
    }
}
