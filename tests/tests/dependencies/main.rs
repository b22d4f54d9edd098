//! Checks which packages use each other, against the graph in ARCHITECTURE.md; that no files of a
//! package use each other in a circle; and that the name of a type has one meaning.

// Functions beside the tests fail them in the same way.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use holo_tests::{cargo, workspace};
use serde_json::Value;

use source::{Modules, circles};

mod source;

/// Folders that use nothing of their package outside: the package and the folder.
const CLOSED_FOLDERS: &[(&str, &str)] = &[("driver-surfaces", "light_store")];

/// Most types that share their name with another type in a package that they see, or in their own.
const MOST_SHARED_NAMES: usize = 8;

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

/// The packages of this workspace, from `cargo metadata`.
fn packages() -> Vec<Value> {
    let output = cargo()
        .args(["metadata", "--format-version", "1", "--no-deps", "--locked"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// The folder of a package.
fn folder(package: &Value) -> PathBuf {
    Path::new(package["manifest_path"].as_str().unwrap()).parent().unwrap().to_owned()
}

/// The graph in the packages' own Cargo.toml.
fn built() -> Graph {
    let name = |package: &Value| folder_name(&folder(package));
    packages().iter().map(|package| (name(package), direct_uses(package))).collect()
}

/// The modules of a package's library and programs.
fn modules(package: &Value) -> Vec<Modules> {
    let targets = package["targets"].as_array().unwrap().iter();
    let is_built = |target: &&Value| ["lib", "bin"].contains(&target["kind"][0].as_str().unwrap());
    targets
        .filter(is_built)
        .map(|target| Modules::read(Path::new(target["src_path"].as_str().unwrap())))
        .collect()
}

/// The circles of files in a package, each as the package's name and the files.
fn circles_of_files(package: &Value) -> Vec<String> {
    let source = folder(package).join("src");
    let name = folder_name(&folder(package));
    let word = |file: &&Path| file.strip_prefix(&source).unwrap_or(file).display().to_string();
    let words = |circle: &BTreeSet<&Path>| circle.iter().map(word).collect::<Vec<_>>().join(" ");
    let modules = modules(package);
    let found = modules
        .iter()
        .flat_map(|modules| circles(&modules.uses()).iter().map(words).collect::<Vec<_>>());
    found.map(|files| format!("{name}: {files}")).collect()
}

/// All packages that each package sees, itself included.
fn seen(graph: &Graph) -> Graph {
    let sees = |package: &String| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![package]);
        while let Some(package) = open.pop() {
            if seen.insert(package.clone()) {
                open.extend(graph.get(package).into_iter().flatten());
            }
        }
        seen
    };
    graph.keys().map(|package| (package.clone(), sees(package))).collect()
}

/// The types that share their name with another one in a package that they see or that sees them:
/// the name, with the packages of all of its types. `types` has the names in each package.
fn shared_names(graph: &Graph, types: &[(String, String)]) -> Vec<(String, Vec<String>)> {
    let seen = seen(graph);
    let mut packages: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (package, name) in types {
        packages.entry(name).or_default().push(package);
    }
    let meet = |a: &str, b: &str| {
        let sees = |a: &str, b: &str| seen.get(a).is_some_and(|seen| seen.contains(b));
        sees(a, b) || sees(b, a)
    };
    let shared = packages.into_iter().filter_map(|(name, packages)| {
        let others = |at: usize| packages.iter().enumerate().filter(move |(n, _)| *n != at);
        let is_shared = |&at: &usize| others(at).any(|(_, other)| meet(packages[at], other));
        let places: Vec<usize> = (0..packages.len()).filter(is_shared).collect();
        let packages: Vec<String> = places.iter().map(|&at| packages[at].to_owned()).collect();
        (!packages.is_empty()).then(|| (name.to_owned(), packages))
    });
    shared.collect()
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

/// Otherwise `scripts/plant-faults` would plant nothing, or something else.
#[test]
fn the_text_of_every_planted_fault_stands_once_in_its_file() {
    let faults = std::fs::read_to_string(workspace().join("scripts/plant-faults.toml")).unwrap();
    let faults: toml::Table = faults.parse().unwrap();
    let faults = faults["fault"].as_array().unwrap();
    assert!(!faults.is_empty());
    let wrong = |fault: &&toml::Value| {
        let text = |key: &str| fault[key].as_str().unwrap();
        let file = std::fs::read_to_string(workspace().join(text("file"))).unwrap_or_default();
        file.matches(text("find")).count() != 1 || text("find") == text("replace")
    };
    let wrong: Vec<_> = faults.iter().filter(wrong).map(|fault| fault["name"].as_str()).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn no_files_of_a_package_use_each_other_in_a_circle() {
    let found: BTreeSet<String> = packages().iter().flat_map(circles_of_files).collect();
    let found: Vec<String> = found.into_iter().collect();
    assert!(found.is_empty(), "files use each other in a circle:\n{}", found.join("\n"));
}

/// Returns the uses that lead out of a closed folder of a package, each as two files.
fn uses_that_leave(package: &Value, closed: &str) -> Vec<String> {
    let inside = folder(package).join("src").join(closed);
    assert!(inside.is_dir(), "{} is no folder", inside.display());
    let mut leave = Vec::new();
    for modules in modules(package) {
        for (file, uses) in modules.uses() {
            let is_outside = |used: &&&Path| !used.starts_with(&inside);
            if file.starts_with(&inside) {
                let uses = uses.iter().filter(is_outside);
                leave.extend(uses.map(|used| format!("{} {}", file.display(), used.display())));
            }
        }
    }
    leave
}

#[test]
fn closed_folders_use_nothing_of_their_package_outside() {
    let packages = packages();
    for (name, closed) in CLOSED_FOLDERS {
        let is_it = |package: &&Value| folder_name(&folder(package)) == *name;
        let package = packages.iter().find(is_it).unwrap();
        let leave = uses_that_leave(package, closed);
        assert!(leave.is_empty(), "{name}, {closed}:\n{}", leave.join("\n"));
    }
    // Another folder shows that uses are found at all.
    let surfaces = packages.iter().find(|p| folder_name(&folder(p)) == "driver-surfaces").unwrap();
    assert!(!uses_that_leave(surfaces, "filter").is_empty());
}

#[test]
fn few_types_share_their_name_with_a_type_that_they_meet() {
    let mut types = Vec::new();
    for package in packages() {
        let name = folder_name(&folder(&package));
        for modules in modules(&package) {
            let names = modules.0.into_iter().flat_map(|module| module.types);
            types.extend(names.map(|type_name| (name.clone(), type_name)));
        }
    }
    let shared = shared_names(&built(), &types);
    let count: usize = shared.iter().map(|(_, packages)| packages.len()).sum();
    let line = |(name, packages): &(String, Vec<String>)| format!("{name}: {}", packages.join(" "));
    let lines: Vec<String> = shared.iter().map(line).collect();
    assert!(
        count <= MOST_SHARED_NAMES,
        "{count} of {} types share their names:\n{}",
        types.len(),
        lines.join("\n")
    );
}

/// Writes files to a folder, and returns the circles of the library there.
fn circles_in(files: &[(&str, &str)]) -> Vec<String> {
    let place = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = place.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let modules = Modules::read(&place.path().join("lib.rs"));
    let word = |file: &&Path| file.strip_prefix(place.path()).unwrap().display().to_string();
    let words = |circle: &BTreeSet<&Path>| circle.iter().map(word).collect::<Vec<_>>().join(" ");
    circles(&modules.uses()).iter().map(words).collect()
}

#[test]
fn a_circle_of_files_is_found_by_imports_and_by_qualified_paths() {
    let lib = ("lib.rs", "mod a;\nmod b;\nmod c;\npub use a::A;\n");
    let a = ("a.rs", "use crate::b::B;\npub struct A(B);\n");
    let b = ("b.rs", "pub struct B;\nfn f() { super::c::g() }\n");
    let harmless = ("c.rs", "/// See [`crate::A`].\npub fn g() { \"crate::A\"; }\n");
    assert_eq!(circles_in(&[lib, a, b, harmless]), [""; 0]);
    for closing in ["use crate::{b::*, A};\npub fn g() {}", "pub fn g(a: &crate::a::A) {}"] {
        assert_eq!(circles_in(&[lib, a, b, ("c.rs", closing)]), ["a.rs b.rs c.rs"]);
    }
    let in_tests = ("c.rs", "pub fn g() {}\n#[cfg(test)]\nmod tests { use crate::A; }\n");
    assert_eq!(circles_in(&[lib, a, b, in_tests]), [""; 0]);
}

#[test]
fn a_parent_that_only_declares_and_exports_is_in_no_circle() {
    let parts = ("a/mod.rs", "mod part;\npub use part::Part;\npub const SIZE: u32 = 1;\n");
    let part = ("a/part.rs", "use super::SIZE;\npub struct Part([u8; SIZE as usize]);\n");
    assert_eq!(circles_in(&[("lib.rs", "mod a;\n"), parts, part]), [""; 0]);
    let user =
        ("a/mod.rs", "mod part;\npub use part::Part;\nconst SIZE: u32 = 1;\nfn f(_: Part) {}\n");
    assert_eq!(circles_in(&[("lib.rs", "mod a;\n"), user, part]), ["a/mod.rs a/part.rs"]);
}

#[test]
fn names_are_shared_by_packages_of_which_one_sees_the_other() {
    let graph = drawing("net ->\nserver -> net\nworker -> net");
    let types = |types: &[(&str, &str)]| -> Vec<(String, String)> {
        types.iter().map(|(package, name)| (package.to_string(), name.to_string())).collect()
    };
    let apart = types(&[("server", "Packet"), ("worker", "Packet"), ("net", "Frame")]);
    assert_eq!(shared_names(&graph, &apart), []);
    let below = types(&[("server", "Packet"), ("worker", "Packet"), ("net", "Packet")]);
    let found = shared_names(&graph, &below);
    assert_eq!(found[0].1, ["server", "worker", "net"]);
    let own = types(&[("net", "Frame"), ("net", "Frame")]);
    assert_eq!(shared_names(&graph, &own).len(), 1);
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
