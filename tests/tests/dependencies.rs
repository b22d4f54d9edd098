//! Who may use whom, as ARCHITECTURE.md says it: parts are replaced one by one only while this holds.

use std::collections::{BTreeMap, BTreeSet};

use holo_tests::cargo;
use serde_json::Value;

/// Each library and what it may use directly; it may use what that may use, too.
const MAY_USE: &[(&str, &[&str])] = &[
    ("holo-section", &[]),
    ("holo-scene", &[]),
    ("holo-picture", &[]),
    ("holo-progress", &[]),
    ("holo-scenes", &[]),
    ("holo-proto", &["holo-section"]),
    ("holo-beamfile", &["holo-section"]),
    ("holo-net", &["holo-proto"]),
    ("holo-raycast", &["holo-scene"]),
    ("holo-light", &["holo-raycast"]),
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
    let output = cargo().args(["metadata", "--format-version", "1", "--no-deps", "--locked"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let package = |value: &Value| {
        let uses = value["dependencies"].as_array().unwrap().iter().filter(|used| used["source"].is_null());
        Package {
            name: value["name"].as_str().unwrap().to_owned(),
            uses: uses.map(|used| (used["name"].as_str().unwrap().to_owned(), used["kind"] == "dev")).collect(),
        }
    };
    metadata["packages"].as_array().unwrap().iter().map(package).collect()
}

/// Everything that `name` may use, however indirectly.
fn allowed(name: &str) -> BTreeSet<&'static str> {
    let direct: BTreeMap<&str, &[&'static str]> = MAY_USE.iter().copied().collect();
    if TOP.contains(&name) {
        return direct.keys().copied().chain(BINARIES.iter().copied()).map(leak).collect();
    }
    if BINARIES.contains(&name) {
        return direct.keys().copied().filter(|&library| library != "holo-scenes").map(leak).collect();
    }
    let mut found = BTreeSet::new();
    let mut open = vec![name];
    while let Some(next) = open.pop() {
        let uses = direct.get(next).unwrap_or_else(|| panic!("{next} is new: say here what it may use"));
        open.extend(uses.iter().copied().filter(|used| found.insert(*used)));
    }
    found
}

/// Names come from the tables above, which live for ever.
fn leak(name: &str) -> &'static str {
    let all = MAY_USE.iter().map(|(name, _)| *name).chain(BINARIES.iter().copied());
    all.into_iter().find(|other| *other == name).unwrap()
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
            assert!(!above.contains(&used.as_str()), "{} must not use {used}, not even in tests", package.name);
        }
    }
}
