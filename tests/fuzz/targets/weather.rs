//! A weather file, and the hours of some moments in it.
#![no_main]

use holo_daylight::{CivilTime, WeatherFile};
use libfuzzer_sys::fuzz_target;

const MOMENTS: [&str; 4] =
    ["2026-01-01T00:30", "2026-02-28T23:59", "2026-06-21T15:30+02:00", "2024-02-29T12:00Z"];

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let Ok(file) = WeatherFile::new(text) else { return };
    for moment in MOMENTS {
        let Ok(moment) = moment.parse::<CivilTime>() else { continue };
        if let Ok(hour) = file.at(&moment.or_zone(file.zone)) {
            assert!(hour.direct >= 0.0 && hour.diffuse >= 0.0 && hour.water().is_finite());
        }
    }
});
