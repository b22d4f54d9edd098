//! Which surface a pixel shows, or which colour, by the samples of its own and around it.

use super::bins::BINS_AN_OCTAVE;
use super::leaf::own_surface;
use super::paint::{CLEARLY_IN_FRONT, Counts, Painter};
use super::pyramid::Level;
use super::sums::NEAR_CLASSES;
use super::surface::{Bins, Surface};
use super::{MultiDepth, Quadtree, SEEN_SHARE};

/// Samples a pixel from which a surface without one is not there: with 2 expected, one pixel in seven has none.
pub(super) const MANY_A_PIXEL: u32 = 2;

/// What a pixel shows.
pub(super) enum Shown<'a> {
    /// A colour that is known, and a squared distance.
    Known([f32; 3], f32),
    /// A surface of its own.
    Own(&'a Surface),
    /// One surface, as from larger leaves of a level on, by its bins there.
    Surface(usize, Bins),
    /// A colour, and the nearest bin of what it is mixed of.
    Mixed([f32; 3], u16),
}

/// Of pixels that nothing is known of.
const NOTHING: Shown<'static> = Shown::Known([0.0; 3], 0.0);

/// What a pixel with samples of its own shows.
///
/// Samples that pass near the eye are samples of this very pixel: their shares are the surfaces' coverage, which is what
/// makes a silhouette smooth. With none of them the nearest surface is what is seen: whatever lies behind was seen past its
/// edge.
fn mix<'a>(
    painter: &Painter,
    column: usize,
    row: usize,
    own: &'a [Surface],
    ask_nearer: bool,
    depths: &mut MultiDepth,
) -> Shown<'a> {
    let Some(front) = own.first() else { return NOTHING };
    let near = |surface: &Surface| near_count(surface, front, ask_nearer);
    let all: f32 = own.iter().map(near).sum();
    let alone = Shown::Own(front);
    if all == 0.0 {
        let covered = covering(painter, column, row, front.bins);
        depths.by_leaves += u64::from(covered.is_some());
        depths.remaining += u64::from(covered.is_none() && own.len() > 1);
        return covered.map_or(alone, |(level, bins)| Shown::Surface(level, bins));
    }
    if own.len() == 1 {
        return alone;
    }
    depths.by_near_samples += 1;
    let mut colour = [0.0; 3];
    let mut nearest = None;
    for surface in own.iter().filter(|surface| near(surface) > 0.0) {
        let coverage = near(surface) / all;
        for (sum, part) in colour.iter_mut().zip(painter.colour(column, row, 0, surface.bins)) {
            *sum += coverage * part;
        }
        nearest = nearest.or(Some(surface.bins.first));
    }
    nearest.map_or(NOTHING, |bin| Shown::Mixed(colour, bin))
}

/// Level and bins of a surface that hides a pixel's front surface, though the pixel has no sample of it.
///
/// Where samples are few, those of a far surface show through between those of a near one, having looked past its edge (the
/// paper's Figure 6). A surface in front that most samples of the 4 × 4 or 2 × 2 pixels around are of is taken to go on
/// here, unless it has so many samples that it would have had one here. Most of those that look as the eye does, if there are such: others may
/// look from behind the surface, as from the next room, and be any number. Only for pixels with no sample near the eye: those
/// see for themselves. On a disc before a wall eight times as far, batch samples of a 4³ grid, this took a tenth (0.4 a
/// pixel) to four tenths (1 to 3 a pixel) off the error; a third instead of a half made some worse. On a ball before a near
/// wall, 16³ grid, it costs 0.1 to 0.4 dB.
fn covering(painter: &Painter, column: usize, row: usize, front: Bins) -> Option<(usize, Bins)> {
    [2, 1].into_iter().find_map(|level| {
        let leaf = painter.all.levels.get(level)?.leaf(column >> level, row >> level);
        let seen = painter.leaf_seen(level, column, row);
        let all: f32 = seen.iter().map(|surface| surface.count as f32).sum();
        let hides = |surface: &&Surface| {
            let parts = seen.iter().filter(|part| {
                surface.bins.first <= part.bins.first && part.bins.last <= surface.bins.last
            });
            surface.bins.last.saturating_add(CLEARLY_IN_FRONT) < front.first
                && parts.map(|part| part.count as f32).sum::<f32>() >= 0.5 * all
                && surface.count <= MANY_A_PIXEL << (2 * level)
        };
        let hiding = leaf.iter().find(hides)?;
        Some((level, hiding.bins))
    })
}

/// Samples of a surface that pass so near the eye that they see past the front surface what the eye sees.
///
/// Within the footprint of a pixel at their own distance is not near enough: with `front` at an eighth of the distance they
/// would look behind it by seven pixels (batch pictures then got worse with more samples). The radius is halved for each
/// whole doubling from the front to the surface, which keeps that below a pixel and a half.
fn near_count(surface: &Surface, front: &Surface, ask_nearer: bool) -> f32 {
    let behind = surface.bins.first.saturating_sub(front.bins.first);
    let halvings = if ask_nearer { usize::from(behind / BINS_AN_OCTAVE) } else { 0 };
    surface.near().iter().skip(halvings.min(NEAR_CLASSES - 1)).map(|&count| count as f32).sum()
}

/// What a pixel without samples shows: that of the smallest leaf around it that has any.
#[inline(always)]
fn fill(painter: &Painter, column: usize, row: usize) -> Shown<'static> {
    let filling = painter.all.levels.iter().enumerate().skip(1).find_map(
        |(level, leaves): (usize, &Level)| {
            let leaf = leaves.leaf(column >> level, row >> level);
            if let [only] = leaf {
                return Some((level, only.bins));
            }
            let all: f32 = leaf.iter().map(|surface| surface.count as f32).sum();
            let seen = leaf.iter().find(|surface| surface.count as f32 >= SEEN_SHARE * all)?;
            Some((level, own_surface(leaf, seen.bins)?.bins))
        },
    );
    filling.map_or(NOTHING, |(level, bins)| {
        let (level, bins) = covering(painter, column, row, bins).unwrap_or((level, bins));
        Shown::Surface(level, bins)
    })
}

impl Quadtree {
    /// What a pixel shows, given its leaf, and as what it is counted.
    pub(super) fn shown<'a>(
        &self,
        painter: &Painter,
        column: usize,
        row: usize,
        own: &'a [Surface],
        is_unseen: bool,
        depths: &mut MultiDepth,
    ) -> (Counts, Shown<'a>) {
        if !self.covered[row * self.size.0 as usize + column] {
            return (Counts::default(), NOTHING);
        }
        if is_unseen {
            let colour = if self.view.clips_sky() { [0.0; 3] } else { self.params.sky };
            return (Counts::unseen(), Shown::Known(colour, f32::INFINITY));
        }
        // A radius that was given is that of the nearest surface already.
        let ask_nearer = self.params.viewpoint_radius.is_none();
        let shown = match (self.standing(painter, column, row, own), own) {
            (Some((0, _)), [front, ..]) => Shown::Own(front),
            (Some((level, bins)), _) => Shown::Surface(level, bins),
            (None, []) => fill(painter, column, row),
            (None, _) => mix(painter, column, row, own, ask_nearer, depths),
        };
        let samples = painter.all.levels[0].samples[row * self.size.0 as usize + column];
        (if own.is_empty() { Counts::empty() } else { Counts::samples(samples) }, shown)
    }
}
