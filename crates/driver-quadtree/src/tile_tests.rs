//! Tiles against pixels read one by one.

use super::super::{Pyramids, any_samples};
use super::*;
use holo_cpu::Instructions;

#[test]
fn every_pixel_of_a_tile_is_that_which_is_read_alone_with_all_instructions() {
    for (size, samples) in [((37, 21), 300), ((37, 21), 30_000), ((64, 80), 40_000), ((3, 2), 500)]
    {
        let tree = any_samples(size, samples);
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
            for (column, row) in (0..height)
                .step_by(TILE)
                .flat_map(|row| (0..width).step_by(TILE).map(move |column| (column, row)))
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
                            Some((
                                level,
                                leaves.leaf(column >> level, row >> level).get(number)?.bins,
                            ))
                        });
                        let Some((start, bins)) = found else { continue };
                        let noise = reader.noise(column, row, start, bins);
                        if start == 0 {
                            colours.ask_own(
                                lane,
                                &reader.levels[0].leaf(column, row)[number],
                                &noise,
                            );
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
