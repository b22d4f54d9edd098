//! Runs a million rays of `examples/stress.rs`.

use crate::common::stress;

#[test]
fn no_ray_leaks_or_gives_nan_at_any_scale() {
    let results = stress::run(1_000_000);
    assert!(results.iter().map(|(_, counts)| counts.rays).sum::<u64>() >= 1_000_000);
    for (name, counts) in results {
        assert_eq!((counts.leaks, counts.not_a_number), (0, 0), "{name}: {counts:?}");
    }
}
