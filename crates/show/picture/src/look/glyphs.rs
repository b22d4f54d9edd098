//! Letters of legends: digits and what numbers and units need, 5 × 7 pixels each.

/// Size of a letter in pixels.
pub(super) const WIDTH: u32 = 5;

/// See [`WIDTH`].
pub(super) const HEIGHT: u32 = 7;

/// Rows from the top. In each, the highest of the five bits is the leftmost pixel.
const GLYPHS: [(char, [u8; 7]); 18] = [
    ('0', [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110]),
    ('1', [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110]),
    ('2', [0b01110, 0b10001, 0b00001, 0b00110, 0b01000, 0b10000, 0b11111]),
    ('3', [0b01110, 0b10001, 0b00001, 0b00110, 0b00001, 0b10001, 0b01110]),
    ('4', [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010]),
    ('5', [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110]),
    ('6', [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110]),
    ('7', [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000]),
    ('8', [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110]),
    ('9', [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100]),
    ('.', [0b00000, 0b00000, 0b00000, 0b00000, 0b00000, 0b00110, 0b00110]),
    ('-', [0b00000, 0b00000, 0b00000, 0b11111, 0b00000, 0b00000, 0b00000]),
    ('e', [0b00000, 0b00000, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110]),
    ('c', [0b00000, 0b00000, 0b01110, 0b10000, 0b10000, 0b10001, 0b01110]),
    ('d', [0b00001, 0b00001, 0b01101, 0b10011, 0b10001, 0b10001, 0b01111]),
    ('/', [0b00001, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b10000]),
    ('m', [0b00000, 0b00000, 0b11010, 0b10101, 0b10101, 0b10001, 0b10001]),
    ('²', [0b01100, 0b10010, 0b00100, 0b01000, 0b11110, 0b00000, 0b00000]),
];

/// Returns whether a letter is inked at a pixel. Letters that are not here are blank.
pub(super) fn is_inked(letter: char, column: u32, row: u32) -> bool {
    let rows = GLYPHS.iter().find(|(known, _)| *known == letter).map_or([0; 7], |(_, rows)| *rows);
    column < WIDTH && row < HEIGHT && rows[row as usize] >> (WIDTH - 1 - column) & 1 == 1
}

/// Returns the width of a text in pixels, with a blank column after each letter.
pub(super) fn text_width(text: &str) -> u32 {
    text.chars().count() as u32 * (WIDTH + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_differ_and_unknown_ones_are_blank() {
        let inked = |letter| {
            (0..HEIGHT)
                .flat_map(|row| (0..WIDTH).map(move |column| is_inked(letter, column, row)))
                .collect::<Vec<_>>()
        };
        for (i, (letter, _)) in GLYPHS.iter().enumerate() {
            assert!(inked(*letter).contains(&true));
            assert!(GLYPHS[..i].iter().all(|(other, _)| inked(*other) != inked(*letter)));
        }
        assert!(!inked('§').contains(&true));
        assert!(!is_inked('1', 5, 0) && !is_inked('1', 0, 7));
        assert_eq!(text_width("12"), 12);
    }
}
