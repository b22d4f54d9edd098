//! Measures appending, flushing, opening and reading.
//!
//! `cargo run --release -p holo-beamfile --example rates [MEGASAMPLES]`
//!
//! First, packets of 21 samples go to beams in a scattered order, as in a batch fill. Then a few
//! thousand neighbouring beams are read twice, as for a view. The first time they are in the
//! operating system's cache alone, and the second time in this crate's.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use holo_beamfile::{BeamFile, Caching, Maker, Options};
use holo_section::{BeamId, BeamKey, NumberRun, Sample, SampleKind};

const BEAMS: u64 = 100_000;
const PACKET: u32 = 21;

fn key(beam: u64) -> BeamKey {
    BeamKey { section: 0, beam: BeamId(beam) }
}

fn report(what: &str, time: Duration, samples: u64) {
    let seconds = time.as_secs_f64();
    let rate = samples as f64 / seconds / 1e6;
    println!(
        "{what:34} {seconds:8.3} s  {rate:8.1} M samples/s  {:6.1} ns each",
        1e9 * seconds / samples as f64
    );
}

fn read(file: &BeamFile, keys: &[BeamKey], what: &str) -> holo_beamfile::Result<()> {
    let start = Instant::now();
    let mut samples = 0;
    file.read_many(keys, Caching::Fill, &mut |_, beam| {
        samples += beam.samples.len() as u64;
        ControlFlow::Continue(())
    })?;
    report(what, start.elapsed(), samples);
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mega: u64 = std::env::args().nth(1).map_or(Ok(20), |word| word.parse())?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("rates.holo");
    let options = Options { cache_bytes: 256 << 20, layout: vec![BEAMS] };
    let file = BeamFile::create(&path, options.clone())?;
    let packet = [Sample::zeroed(); PACKET as usize];
    let packets = mega * 1_000_000 / u64::from(PACKET);

    let start = Instant::now();
    for i in 0..packets {
        let round = (i / BEAMS) as u32;
        let run = NumberRun {
            key: key(i * 61_803 % BEAMS),
            first: round * PACKET,
            count: 0,
            kind: SampleKind::Uniform,
            paths: 1,
        };
        file.append(run, Maker::UNKNOWN, &packet)?;
    }
    let total = packets * u64::from(PACKET);
    report("append", start.elapsed(), total);
    println!("    {:.0} ns a packet", start.elapsed().as_nanos() as f64 / packets as f64);
    file.flush()?;
    report("append and flush", start.elapsed(), total);
    file.close()?;

    let start = Instant::now();
    let file = BeamFile::open(&path, options)?;
    report("open", start.elapsed(), total);
    let report_text = file.report();
    println!(
        "    {} blocks, {} extents, {} bytes",
        report_text.blocks,
        report_text.extents,
        file.stats().file_bytes
    );

    let near: Vec<_> = (40_000..44_000).map(key).collect();
    read(&file, &near, "4000 beams side by side, cold")?;
    read(&file, &near, "4000 beams side by side, warm")?;
    let scattered: Vec<_> = (0..4000).map(|i| key(i * 7919 % BEAMS)).collect();
    read(&file, &scattered, "4000 beams scattered, cold")?;
    read(&file, &scattered, "4000 beams scattered, warm")?;
    let all: Vec<_> = (0..BEAMS).map(key).collect();
    read(&file, &all, "all beams")?;

    let start = Instant::now();
    let damage = file.verify()?;
    report("verify", start.elapsed(), total);
    assert!(damage.is_empty());
    Ok(())
}
