//! Tiles against pixels read one by one.

use super::super::{Pyramids, Quadtree, QuadtreeParams, room};
use super::*;
use crate::pointimage::Instructions;
use glam::DVec3;
use holo_picture::View;
use holo_section::{BeamId, RayCoords, Sample};
use std::sync::Arc;

/// Samples of any depth and colour, some of them equal, so that leaves have surfaces of every kind.
fn tree(size: (u32, u32), samples: usize) -> Quadtree {
    let section = room();
    let view = View::new(DVec3::new(1.0, 1.5, 1.4), DVec3::X, DVec3::Z, Some(70.0), None, size).unwrap();
    let beams = section.beam_count();
    let mut tree = Quadtree::new(Arc::from([section]), view, size, QuadtreeParams::default());
    let mut state = 11_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    };
    for _ in 0..samples {
        let beam = u64::from(random()) % beams;
        // One half by place, so that leaves have quarters that differ.
        let exponent = [random(), beam as u32 / 5][random() as usize % 2] % 8;
        let rgbe = [100, 120, 140, 120 + exponent as u8];
        let code = [1200, random() % 3000][random() as usize % 2] as u16;
        let sample = Sample::from_codes(RayCoords(random().to_le_bytes()), rgbe, code);
        tree.insert(0, BeamId(beam), 1, &[sample]);
    }
    tree
}

#[test]
fn every_pixel_of_a_tile_is_that_which_is_read_alone_with_all_instructions() {
    for (size, samples) in [((37, 21), 300), ((37, 21), 30_000), ((64, 80), 40_000), ((3, 2), 500)] {
        let tree = tree(size, samples);
        let pyramids = Pyramids::new(&tree, None);
        let reader = Reader::new(pyramids.all(), &tree.params);
        let (width, height) = (size.0 as usize, size.1 as usize);
        let is_mixed = |level: &Level, place: usize| {
            level.leaf(place % level.width, place / level.width).iter().any(Surface::is_mixed)
        };
        let mixed = reader.levels[1..]
            .iter()
            .map(|level| (0..level.width * level.height).filter(|&at| is_mixed(level, at)).count());
        assert!(samples < 30_000 || mixed.sum::<usize>() > 20);
        let all = [Instructions::Portable, Instructions::Avx2, Instructions::Avx512];
        for isa in all.into_iter().filter_map(Isa::new) {
            let (mut colours, mut several) = (TileColours::new(), 0);
            for (column, row) in
                (0..height).step_by(TILE).flat_map(|row| (0..width).step_by(TILE).map(move |column| (column, row)))
            {
                // Each surface of every pixel's smallest leaf that has any: the first, the second and so on.
                for number in 0..4 {
                    let mut expected = Vec::new();
                    reader.begin_tile();
                    for lane in 0..LANES {
                        let (column, row) = (column + lane % TILE, row + lane / TILE);
                        if column >= width || row >= height {
                            continue;
                        }
                        let found = reader.levels.iter().enumerate().find_map(|(level, leaves)| {
                            Some((level, leaves.leaf(column >> level, row >> level).get(number)?.bins))
                        });
                        let Some((start, bins)) = found else { continue };
                        let noise = reader.noise(column, row, start, bins);
                        if start == 0 {
                            colours.ask_own(lane, &reader.levels[0].leaf(column, row)[number], &noise);
                        } else {
                            colours.ask(lane, start, bins, &noise);
                        }
                        reader.reach.set(0);
                        let colour = reader.colour(column, row, start, bins);
                        expected.push((lane, colour, reader.reach.take()));
                    }
                    several += expected.len() * usize::from(number > 0);
                    colours.find(&reader, column, row, isa);
                    for (lane, colour, reach) in expected {
                        let found = colours.get(lane);
                        assert_eq!(
                            (found.0.map(f32::to_bits), found.1),
                            (colour.map(f32::to_bits), reach),
                            "{size:?} {samples} {column} {row} {lane} {number} {isa:?}"
                        );
                    }
                }
            }
            assert!(several > 0);
        }
    }
}
