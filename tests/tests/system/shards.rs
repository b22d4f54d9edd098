//! A fill on a cluster, played by processes of this machine, and the merge of its parts.

use std::process::Command;

use holo_tests::{CORNELL_SMALL_SECTION, Place, program, stored, workspace};

/// Runs the job file as a Slurm array of three does, one task after the other.
fn array(place: &Place, samples: &str) {
    for task in 0..3 {
        let status = Command::new("bash")
            .arg(workspace().join("scripts/cluster/fill.slurm"))
            .args([place.path("cornell.obj"), place.path("parts")])
            .args(["--config", &place.cornell(), "--section", CORNELL_SMALL_SECTION])
            .args(["--samples", samples, "--quiet"])
            .env("HOLODECK", program())
            .env("XDG_CACHE_HOME", place.path("cache"))
            .env("SLURM_ARRAY_TASK_ID", (task + 5).to_string())
            .env("SLURM_ARRAY_TASK_MIN", "5")
            .env("SLURM_ARRAY_TASK_COUNT", "3")
            .env("SLURM_CPUS_PER_TASK", "1")
            .status()
            .unwrap();
        assert!(status.success(), "task {task}");
    }
}

#[test]
fn the_tasks_of_a_cluster_fill_their_shares_and_merge_gives_one_holodeck() {
    let place = Place::new();
    array(&place, "3k");
    // Tasks that are run again go on.
    array(&place, "1k");
    let parts = [0, 1, 2].map(|part| place.text(&format!("parts/part-{part}.holo")));
    let all = place.text("all.holo");
    let mut merge = vec!["merge", &all, "--json"];
    merge.extend(parts.iter().map(String::as_str));
    let report = place.run(&merge).ok().json();
    let sum: u64 = parts.iter().map(|part| stored(part.as_ref()).count()).sum();
    assert!(sum >= 12_000, "{sum}");
    assert_eq!((&report["added"], &report["known"]), (&sum.into(), &0.into()));
    let whole = stored(all.as_ref());
    assert_eq!(whole.count(), sum);
    whole.assert_no_gaps();
    for part in &parts {
        whole.assert_contains(&stored(part.as_ref()));
    }
    let again = place.run(&merge).ok().json();
    assert_eq!((&again["added"], &again["known"]), (&0.into(), &sum.into()));
    // The file is one like others: it can be filled further and shown.
    place.fill_small("all.holo", "1k");
    assert!(stored(all.as_ref()).count() > sum);
    place.run(&["merge", &all, &place.text("none.holo")]).failed(1, &["none.holo"]);
}
