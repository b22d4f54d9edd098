//! Pictures against pixels that are told one by one, the long way.

use super::super::{Pyramids, Quadtree, QuadtreeParams, add_any_samples, room};
use super::*;
use holo_cpu::Instructions;
use holo_cpu::Isa;
use glam::DVec3;
use holo_picture::{ViewKind, ViewSpec};
use std::sync::Arc;

/// Bits of a pixel's colour and depth, what it is counted as, and the highest level that it was averaged over.
type Bits = ([u32; 3], u32, u32, usize);

fn bits(colour: [f32; 3], depth: f32, counts: Counts, reach: usize) -> Bits {
    (colour.map(f32::to_bits), depth.to_bits(), counts.0, reach)
}

/// A kind of view of the room, its angle and where its eye is.
type Place = (ViewKind, f64, f64);

const WITHIN: Place = (ViewKind::Perspective, 80.0, 1.0);
/// The picture is larger than what the room covers.
const AHEAD: Place = (ViewKind::Perspective, 80.0, -3.0);
/// From within, with corners that no ray belongs to.
const ROUND: Place = (ViewKind::Hemispherical, 170.0, 1.0);

/// Samples of any depth, seen from somewhere. One in `unseen` of the beams of pixels sees nothing; 0: none.
fn tree(
    (kind, angle, eye_x): Place,
    size: (u32, u32),
    params: QuadtreeParams,
    samples: usize,
    unseen: usize,
) -> Quadtree {
    let spec =
        ViewSpec { kind: Some(kind), vh: Some(angle), vd: Some(DVec3::X), ..ViewSpec::default() };
    let spec = ViewSpec { vp: Some(DVec3::new(eye_x, 1.5, 1.4)), ..spec };
    let (view, size) = spec.resolve(size).unwrap();
    let mut tree = Quadtree::new(Arc::from([room()]), view, size, params);
    add_any_samples(&mut tree, samples);
    let best = tree.best_beams();
    for (section, beam) in best
        .into_iter()
        .flatten()
        .filter(|(_, beam)| unseen > 0 && (beam.0 as usize).is_multiple_of(unseen))
    {
        tree.insert_unseen(section, beam);
    }
    tree
}

/// Every pixel of a picture that is wanted, by what [`Quadtree::shown`] tells of it, and how several depths were resolved.
fn long_way(
    tree: &Quadtree,
    pyramids: &Pyramids,
    is_wanted: impl Fn(usize) -> bool,
) -> (Vec<Option<Bits>>, MultiDepth) {
    let agreement = tree.agreement(pyramids);
    let painter = Painter::new(pyramids, agreement.as_ref(), &tree.params);
    let mut depths = MultiDepth::default();
    let mut pixels = vec![None; tree.covered.len()];
    for tile in 0..tile_count(tree.size) {
        painter.begin_tile();
        for (column, row) in tile_pixels(tree.size, tile) {
            let pixel = row * tree.size.0 as usize + column;
            if !is_wanted(pixel) {
                continue;
            }
            let leaf = painter.all.levels[0].leaf(column, row);
            let is_unseen = tree.sees_nothing(pixel);
            let (counts, shown) = tree.shown(&painter, column, row, leaf, is_unseen, &mut depths);
            let (colour, squared) = match shown {
                Shown::Known(colour, squared) => (colour, squared),
                Shown::Mixed(colour, bin) => (colour, bin_distance_squared(bin)),
                Shown::Own(own) => {
                    (painter.colour(column, row, 0, own.bins), bin_distance_squared(own.bins.first))
                }
                Shown::Surface(level, bins) => {
                    (painter.colour(column, row, level, bins), bin_distance_squared(bins.first))
                }
            };
            pixels[pixel] = Some(bits(colour, squared.sqrt(), counts, painter.reach()));
        }
    }
    (pixels, depths)
}

#[test]
fn every_pixel_is_that_which_is_told_alone_with_all_instructions() {
    let near = QuadtreeParams {
        viewpoint_radius: Some(0.3),
        sky: [0.25, 0.5, 1.0],
        ..QuadtreeParams::default()
    };
    let fixed = QuadtreeParams { leaf: LeafSize::Fixed(1), ..near };
    let mut met = MultiDepth::default();
    for (place, size, samples, params, unseen) in [
        (WITHIN, (37, 21), 2_000, QuadtreeParams::default(), 0),
        (WITHIN, (64, 48), 20_000, near, 5),
        (WITHIN, (64, 48), 100_000, near, 0),
        (WITHIN, (3, 2), 300, near, 0),
        (ROUND, (96, 96), 6_000, near, 0),
        (ROUND, (48, 48), 60_000, near, 6),
        (WITHIN, (40, 33), 8_000, fixed, 3),
        (AHEAD, (64, 48), 4_000, near, 0),
        (AHEAD, (69, 50), 30_000, QuadtreeParams::default(), 4),
        (AHEAD, (64, 80), 200_000, near, 7),
    ] {
        let mut tree = tree(place, size, params, samples, unseen);
        let case = format!("{place:?} {size:?} {samples}");
        let pyramids = Pyramids::new(&tree, None);
        // Any half: what is remembered from one pixel to the next is another's.
        let is_some = |pixel: usize| (pixel * 2_654_435_761) >> 7 & 1 == 0;
        let (expected, expected_depths) = long_way(&tree, &pyramids, |_| true);
        let (expected_some, _) = long_way(&tree, &pyramids, is_some);
        met.add(&expected_depths);
        let all = [Instructions::Portable, Instructions::Avx2, Instructions::Avx512];
        for isa in all.into_iter().filter_map(Isa::new) {
            tree.isa = isa;
            let (mut frame, agreement) = (tree.empty_frame(), tree.agreement(&pyramids));
            let mut counts = vec![Counts::default(); expected.len()];
            let mut reach = vec![0; expected.len()];
            let depths =
                tree.paint_all(&pyramids, agreement.as_ref(), &mut frame, &mut counts, &mut reach);
            assert_eq!(depths, expected_depths, "{case} {isa:?}");
            let colours = frame.picture.pixels.iter().zip(&frame.depth);
            for (pixel, ((&colour, &depth), (counts, reach))) in
                colours.zip(counts.into_iter().zip(reach)).enumerate()
            {
                let found = bits(colour, depth, counts, usize::from(reach));
                assert_eq!(Some(found), expected[pixel], "{case} {pixel} {isa:?}");
            }
            let agreement = tree.agreement(&pyramids);
            let mut painter = TilePainter::new(&tree, &pyramids, agreement.as_ref());
            for tile in 0..tile_count(size) {
                painter.paint(tile, is_some);
                for (column, row) in tile_pixels(size, tile) {
                    let pixel = row * size.0 as usize + column;
                    let (Painted { colour, depth, counts }, reach) =
                        painter.painted(TileColours::lane(column, row));
                    let found = is_some(pixel).then(|| bits(colour, depth, counts, reach));
                    assert_eq!(found, expected_some[pixel], "{case} some {pixel} {isa:?}");
                }
            }
        }
    }
    assert!(met.by_near_samples > 100 && met.by_leaves > 100 && met.remaining > 100, "{met:?}");
}
