//! Measures opening a file of many blocks.
//!
//! `cargo run --release -p holo-beamfile --example opening [BLOCKS] [EXTENTS]`
//!
//! Makes a file of BLOCKS blocks, each of EXTENTS packets of 21 samples, then opens it five times
//! to read and five times to write. Nothing is synced, so that making the file takes seconds. The
//! second figure is the time on a core, which does not depend on what else the machine does.

use std::fs::File;
use std::io;
use std::path::Path;
use std::time::Instant;

use bytemuck::Zeroable;
use holo_beamfile::{BeamFile, DiskStorage, Maker, Options, Storage};
use holo_section::{BeamId, BeamKey, NumberRun, Sample, SampleKind};

const BEAMS: u64 = 100_000;
const PACKET: u32 = 21;

/// A disk that does not wait for its writes.
struct Hasty(DiskStorage);

impl Storage for Hasty {
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        self.0.read_exact_at(bytes, offset)
    }

    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        self.0.write_all_at(bytes, offset)
    }

    fn sync_data(&self) -> io::Result<()> {
        Ok(())
    }

    fn length(&self) -> io::Result<u64> {
        self.0.length()
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        self.0.set_len(bytes)
    }
}

fn options() -> Options {
    Options { cache_bytes: 0, layout: vec![BEAMS] }
}

fn make(path: &Path, blocks: u64, extents: u64) -> Result<(), Box<dyn std::error::Error>> {
    let disk = File::options().read(true).write(true).create_new(true).open(path)?;
    let disk = Box::new(Hasty(DiskStorage::new(disk, path)));
    let file = BeamFile::create_on(disk, path, options())?;
    let packet = [Sample::zeroed(); PACKET as usize];
    for i in 0..blocks * extents {
        let run = NumberRun {
            key: BeamKey { section: 0, beam: BeamId(i * 61_803 % BEAMS) },
            first: (i / BEAMS) as u32 * PACKET,
            count: 0,
            kind: SampleKind::Uniform,
            paths: 1,
        };
        file.append(run, Maker::UNKNOWN, &packet)?;
        if (i + 1) % extents == 0 {
            file.flush()?;
        }
    }
    Ok(file.close()?)
}

/// Returns the time that this thread has spent on a core, in milliseconds.
fn core_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|ns| ns.parse().ok()).map_or(f64::NAN, |ns: f64| ns / 1e6)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u64> =
        std::env::args().skip(1).map(|n| n.parse()).collect::<Result<_, _>>()?;
    let (blocks, extents) =
        (numbers.first().copied().unwrap_or(50_000), numbers.get(1).copied().unwrap_or(20));
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("opening.holo");
    make(&path, blocks, extents)?;
    for _ in 0..5 {
        let (start, core) = (Instant::now(), core_ms());
        let file = BeamFile::open_read_only(&path, 0)?;
        let (to_read, core) = (start.elapsed(), core_ms() - core);
        let report = file.report();
        println!(
            "open to read {:.1} ms ({core:.1} on a core): {} blocks, {} extents, {} samples, {} MB",
            to_read.as_secs_f64() * 1e3,
            report.blocks,
            report.extents,
            report.samples,
            file.stats().file_bytes >> 20
        );
        drop(file);
        let (start, core) = (Instant::now(), core_ms());
        let file = BeamFile::open(&path, options())?;
        let (to_write, core) = (start.elapsed(), core_ms() - core);
        println!("open to write {:.1} ms ({core:.1} on a core)", to_write.as_secs_f64() * 1e3);
        file.close()?;
    }
    Ok(())
}
