//! Checks which packages use each other, against the graph in ARCHITECTURE.md.

// Functions beside the tests fail them in the same way.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use holo_tests::{cargo, workspace};
use serde_json::Value;

/// For each package the packages it uses directly. A package is named by its folder.
///
/// Parentheses mark a package that only tests use: `(tracer)`.
type Graph = BTreeMap<String, BTreeSet<String>>;

/// The graph in the first fenced block of the section "Direction of use".
///
/// A line `A -> B C (D)` means: A uses B and C, and its tests also use D.
fn drawn(architecture: &str) -> Graph {
    let section = architecture.split("\n## ").find(|part| part.starts_with("Direction of use\n"));
    let block = section
        .and_then(|section| section.split("```").nth(1))
        .expect("ARCHITECTURE.md has a section \"Direction of use\" with a fenced block");
    let mut graph = Graph::new();
    let mut package = String::new();
    // The first line is the block's language. A line without an arrow continues the one above it.
    for line in block.lines().skip(1) {
        let uses = match line.split_once("->") {
            Some((name, uses)) => {
                package = name.trim().to_owned();
                let before = graph.insert(package.clone(), BTreeSet::new());
                assert!(before.is_none(), "{package} is drawn twice");
                uses
            }
            None => line,
        };
        let uses = uses.split_whitespace().map(str::to_owned);
        graph.get_mut(&package).expect("the first line has an arrow").extend(uses);
    }
    graph
}

/// The graph in the packages' own Cargo.toml.
fn built() -> Graph {
    let output = cargo()
        .args(["metadata", "--format-version", "1", "--no-deps", "--locked"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    packages
        .iter()
        .map(|package| {
            let manifest = Path::new(package["manifest_path"].as_str().unwrap());
            (folder_name(manifest.parent().unwrap()), direct_uses(package))
        })
        .collect()
}

/// The packages of this workspace that one of `cargo metadata`'s packages uses directly.
fn direct_uses(package: &Value) -> BTreeSet<String> {
    let (mut always, mut in_tests) = (BTreeSet::new(), BTreeSet::new());
    for used in package["dependencies"].as_array().unwrap() {
        // Packages from elsewhere have no path.
        let Some(path) = used["path"].as_str() else { continue };
        let uses = if used["kind"] == "dev" { &mut in_tests } else { &mut always };
        uses.insert(folder_name(Path::new(path)));
    }
    let only_in_tests = in_tests.difference(&always).map(|name| format!("({name})"));
    only_in_tests.chain(always.iter().cloned()).collect()
}

fn folder_name(folder: &Path) -> String {
    folder.file_name().unwrap().to_str().unwrap().to_owned()
}

/// One sentence for each difference between the two graphs.
fn differences(drawn: &Graph, built: &Graph) -> Vec<String> {
    let mut found = Vec::new();
    let nothing = BTreeSet::new();
    let packages: BTreeSet<&String> = drawn.keys().chain(built.keys()).collect();
    for package in packages {
        match (drawn.contains_key(package), built.contains_key(package)) {
            (false, _) => found.push(format!("{package} is not drawn")),
            (_, false) => found.push(format!("{package} is drawn, but there is no such package")),
            _ => {}
        }
        let drawn = drawn.get(package).unwrap_or(&nothing);
        let built = built.get(package).unwrap_or(&nothing);
        found.extend(
            built.difference(drawn).map(|used| format!("{package} -> {used} is not drawn")),
        );
        found.extend(
            drawn.difference(built).map(|used| format!("{package} -> {used} is drawn, not used")),
        );
    }
    found
}

#[test]
fn packages_use_each_other_exactly_as_the_architecture_draws_it() {
    let architecture = std::fs::read_to_string(workspace().join("ARCHITECTURE.md")).unwrap();
    let differences = differences(&drawn(&architecture), &built());
    assert!(
        differences.is_empty(),
        "ARCHITECTURE.md, \"Direction of use\":\n{}",
        differences.join("\n")
    );
}

/// A drawing with these lines.
fn drawing(lines: &str) -> Graph {
    drawn(&format!("# Title\n\n## Direction of use\n\nText.\n\n```text\n{lines}\n```\n\n## More\n"))
}

#[test]
fn an_edge_that_is_not_drawn_is_named_and_so_is_one_that_is_gone() {
    let drawn = drawing("display ->\nserver  -> net\nnet ->");
    assert_eq!(differences(&drawn, &drawn), [""; 0]);
    let on_two_lines = drawing("display ->\nserver ->\n    net\nnet ->");
    assert_eq!(on_two_lines, drawn);
    let links_display = drawing("display ->\nserver  -> net display\nnet ->");
    assert_eq!(differences(&drawn, &links_display), ["server -> display is not drawn"]);
    assert_eq!(differences(&links_display, &drawn), ["server -> display is drawn, not used"]);
}

#[test]
fn an_edge_of_tests_alone_differs_from_one_of_the_program() {
    let in_tests = drawing("display ->\nserver -> (display)");
    let always = drawing("display ->\nserver -> display");
    assert_eq!(
        differences(&in_tests, &always),
        ["server -> display is not drawn", "server -> (display) is drawn, not used"]
    );
}

#[test]
fn a_package_that_is_not_drawn_is_named_and_so_is_one_that_is_gone() {
    let (one, two) = (drawing("net ->"), drawing("net ->\nserver -> net"));
    assert_eq!(differences(&one, &two), ["server is not drawn", "server -> net is not drawn"]);
    assert_eq!(
        differences(&two, &one),
        ["server is drawn, but there is no such package", "server -> net is drawn, not used"]
    );
}
