//! Stored samples: any ten bytes are one, with a finite colour and a distance that is a number.
#![no_main]

use holo_section::{RayCoords, Sample, distance, rgbe};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: [u8; 18]| {
    let coords = [bytes[0], bytes[1], bytes[2], bytes[3]];
    let colour = [bytes[4], bytes[5], bytes[6], bytes[7]];
    let code = u16::from_le_bytes([bytes[8], bytes[9]]);
    let diagonal = f64::from_le_bytes(std::array::from_fn(|at| bytes[10 + at]));
    let sample = Sample::from_codes(RayCoords(coords), colour, code);
    assert!(sample.rgb().iter().all(|channel| channel.is_finite() && *channel >= 0.0));
    assert_eq!((sample.coords.0, sample.distance_code()), (coords, code));
    // What is decoded is encoded as itself, whatever is drawn for the dither.
    let dither = u32::from_le_bytes(coords);
    let again = rgbe::decode(rgbe::encode(sample.rgb(), dither));
    assert!(again == sample.rgb() || sample.rgb().iter().all(|channel| *channel < 1e-37));
    // Sections have diagonals in this range.
    if (1e-6..1e12).contains(&diagonal) {
        let far = sample.distance(diagonal);
        assert!(far >= 0.0 && distance::encode(far, diagonal) == code, "{far} of {diagonal}");
    }
});
