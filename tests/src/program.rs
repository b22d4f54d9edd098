//! Finds the program under test, and the workspace.

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// Returns the workspace's root folder.
pub fn workspace() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Returns a command for the cargo that runs the tests, in the workspace's root.
pub fn cargo() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(workspace());
    command
}

/// Returns the `holodeck` program under test. `HOLODECK_PROGRAM` may name it. Otherwise it is that
/// of the tests' own profile, beside the folder of the test's executable.
///
/// Under cargo, the latter is built first, which takes no time if it is up to date. The tests share
/// its libraries, and must not meet an older protocol.
///
/// # Panics
/// If the program does not exist and cannot be built.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let program =
            std::env::var_os("HOLODECK_PROGRAM").map_or_else(program_of_profile, PathBuf::from);
        assert!(
            program.exists(),
            "there is no {}; run `cargo build -p holodeck`",
            program.display()
        );
        program
    })
}

fn program_of_profile() -> PathBuf {
    // target/PROFILE/deps/TEST
    let test = std::env::current_exe().expect("the test's executable has a path");
    let folder = test
        .parent()
        .and_then(Path::parent)
        .expect("the test's executable lies in target/PROFILE/deps");
    if std::env::var_os("CARGO").is_some() {
        build(folder);
    }
    folder.join(format!("holodeck{}", std::env::consts::EXE_SUFFIX))
}

fn build(folder: &Path) {
    let profile =
        folder.file_name().and_then(|name| name.to_str()).expect("the profile's folder has a name");
    let target = folder.parent().expect("the profile's folder lies in the target folder");
    let mut command = cargo();
    command
        .args(["build", "--quiet", "--locked", "--package", "holodeck", "--target-dir"])
        .arg(target);
    // The folder of the dev profile is called `debug`; all others have their profile's name.
    if profile != "debug" {
        command.args(["--profile", profile]);
    }
    let status = command.status().expect("cargo can be run");
    assert!(status.success(), "building holodeck failed");
}
