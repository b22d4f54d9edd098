//! Who may use whom, as ARCHITECTURE.md says it: parts are replaced one by one only while this holds.

// Helpers beside the tests fail them in the same way.
#![allow(clippy::panic, clippy::unwrap_used)]

use std::collections::BTreeSet;

use holo_tests::cargo;
use serde_json::Value;

/// Each library and what it may use directly; it may use what that may use, too.
const MAY_USE: &[(&str, &[&str])] = &[
    ("holo-section", &[]),
    ("holo-scene", &[]),
    ("holo-picture", &[]),
    ("holo-progress", &[]),
    ("holo-scenes", &[]),
    ("holo-light", &[]),
    ("holo-proto", &["holo-section", "holo-light"]),
    ("holo-beamfile", &["holo-section"]),
    ("holo-net", &["holo-proto"]),
    ("holo-raycast", &["holo-scene"]),
    ("holo-tracer", &["holo-light", "holo-raycast"]),
    ("holo-display", &["holo-section", "holo-picture", "holo-light", "holo-raycast"]),
];

/// Any library, but for the bundled scenes, and none of each other.
const BINARIES: &[&str] = &["holo-server", "holo-rtworker", "holo-view"];

/// Everything.
const TOP: &[&str] = &["holodeck", "holo-tests"];

struct Package {
    name: String,
    /// Name, and whether only tests need it.
    uses: Vec<(String, bool)>,
}

fn packages() -> Vec<Package> {
    let output = cargo()
        .args(["metadata", "--format-version", "1", "--no-deps", "--locked"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let package = |value: &Value| {
        let uses = value["dependencies"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|used| used["source"].is_null());
        Package {
            name: value["name"].as_str().unwrap().to_owned(),
            uses: uses
                .map(|used| (used["name"].as_str().unwrap().to_owned(), used["kind"] == "dev"))
                .collect(),
        }
    };
    metadata["packages"].as_array().unwrap().iter().map(package).collect()
}

/// Everything that `name` may use, however indirectly.
fn allowed(name: &str) -> BTreeSet<&'static str> {
    let libraries = MAY_USE.iter().map(|(name, _)| *name);
    if TOP.contains(&name) {
        return libraries.chain(BINARIES.iter().copied()).collect();
    }
    if BINARIES.contains(&name) {
        return libraries.filter(|&library| library != "holo-scenes").collect();
    }
    let mut found = BTreeSet::new();
    let mut open = vec![name];
    while let Some(next) = open.pop() {
        let entry = MAY_USE.iter().find(|(library, _)| *library == next);
        let (_, uses) = entry.unwrap_or_else(|| panic!("{next} is new: say here what it may use"));
        for &used in *uses {
            if found.insert(used) {
                open.push(used);
            }
        }
    }
    found
}

#[test]
fn packages_use_only_what_lies_below_them() {
    let packages = packages();
    assert!(packages.len() >= 15, "{} packages: does cargo tell of all?", packages.len());
    for package in &packages {
        let allowed = allowed(&package.name);
        for (used, _) in package.uses.iter().filter(|(_, for_tests)| !for_tests) {
            assert!(allowed.contains(used.as_str()), "{} must not use {used}", package.name);
        }
    }
}

#[test]
fn tests_of_libraries_use_no_binary() {
    let above: Vec<&str> = BINARIES.iter().chain(TOP).copied().collect();
    for package in packages().iter().filter(|package| !above.contains(&package.name.as_str())) {
        for (used, _) in &package.uses {
            assert!(
                !above.contains(&used.as_str()),
                "{} must not use {used}, not even in tests",
                package.name
            );
        }
    }
}
