//! A row of a filter: three channels and a weight, with room at both ends.
//!
//! Always true: the room holds zeros.

use super::colour;

/// Pixels of room at each end: the widest filter's reach.
pub(super) const ROOM: usize = 3;

/// Sums of three channels and of weights.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub channels: [Vec<f32>; 4],
}

impl Row {
    pub fn new(width: usize) -> Self {
        Self { channels: std::array::from_fn(|_| vec![0.0; width + 2 * ROOM]) }
    }

    /// Colours, and weight 1 where there is one.
    #[inline(always)]
    pub fn decode(&mut self, colours: &[u32]) {
        let width = colours.len();
        let [r, g, b, w] = self.channels.each_mut().map(|channel| &mut channel[ROOM..][..width]);
        decode_into(colours, r, g, b, w);
    }

    pub fn clear(&mut self) {
        self.channels.iter_mut().for_each(|channel| channel.fill(0.0));
    }
}

#[inline(always)]
fn decode_into(colours: &[u32], r: &mut [f32], g: &mut [f32], b: &mut [f32], w: &mut [f32]) {
    for ((((&colour, r), g), b), w) in colours.iter().zip(r).zip(g).zip(b).zip(w) {
        [*r, *g, *b] = colour::decode(colour);
        *w = if colour == colour::NONE { 0.0 } else { 1.0 };
    }
}
