//! A holodeck file, without what its header repeats: opened to be written, read through, compared
//! and closed.
#![no_main]

use holo_beamfile::{BeamFile, Options};
use holo_fuzz::{Memory, long};
use libfuzzer_sys::fuzz_target;

/// Beams that are read of one file, at most.
const BEAMS: usize = 64;

fuzz_target!(|bytes: &[u8]| {
    let options = Options { cache_bytes: 1 << 16, layout: Vec::new() };
    let Some(bytes) = long(bytes) else { return };
    let disk = Box::new(Memory(bytes.into()));
    let Ok(file) = BeamFile::open_on(disk, "fuzzed", options) else { return };
    let mut beams = Vec::new();
    file.for_each_beam(&mut |key, _| beams.push(key));
    for &key in beams.iter().take(BEAMS) {
        let counts = file.runs(key).iter().map(|run| u64::from(run.count)).sum::<u64>();
        // Damage may leave samples out, and adds none.
        if let Ok(samples) = file.read(key) {
            let read = samples.iter().map(|(_, samples)| samples.len() as u64).sum::<u64>();
            assert!(read <= counts, "{read} of {counts}");
        }
    }
    for name in file.blob_names() {
        let _ = file.blob(&name);
    }
    let _ = file.verify();
    let _ = file.close();
});
