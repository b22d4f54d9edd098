//! Traces rays that are difficult for ray tracers against closed meshes. Counts rays that hit
//! nothing (leaks) and rays whose result is NaN. Exits with 1 if the count is not 0.
//!
//! `cargo run --release -p holo-raycast --example stress -- [RAYS]` (a million; 100000000 takes
//! minutes)

#[path = "../tests/it/common/mod.rs"]
mod common;

use std::error::Error;

use common::stress;

fn main() -> Result<(), Box<dyn Error>> {
    let rays: u64 = std::env::args().nth(1).map_or(Ok(1_000_000), |count| count.parse())?;
    let mut bad = 0;
    for (name, counts) in stress::run(rays) {
        println!(
            "{name:44} {:10} rays  {} leaks  {} not a number",
            counts.rays, counts.leaks, counts.not_a_number
        );
        bad += counts.leaks + counts.not_a_number;
    }
    println!("{bad} in all");
    if bad > 0 {
        std::process::exit(1);
    }
    Ok(())
}
