//! The page docs/options.md, which is made from the help of every command.

use std::path::Path;

use clap::CommandFactory;
use clap_markdown::{MarkdownOptions, help_markdown_command_custom};

use crate::Program;

const BEGINNING: &str = "# Every option

This page is made from the help that `holodeck COMMAND --help` prints. `WRITE_DOCS=1 cargo test -p
holodeck options_page` writes it again. The [manual](manual.md) explains how to use the commands.

";

/// Returns the page for the command line of this program.
fn page() -> String {
    let options = MarkdownOptions::new().show_footer(false).show_aliases(false);
    let help = help_markdown_command_custom(&Program::command(), &options);
    // The library's own title and its list of commands come first.
    let start = help.find("## `holodeck`").unwrap_or(0);
    let lines: Vec<String> = help[start..].lines().map(line).collect();
    let mut page = format!("{BEGINNING}{}", lines.join("\n"));
    while page.contains("\n\n\n") {
        page = page.replace("\n\n\n", "\n\n");
    }
    page.trim_end().to_owned() + "\n"
}

/// Returns a line of the help as Markdown: examples of commands are shown as they are typed.
fn line(line: &str) -> String {
    let line = line.trim_end();
    match line {
        "Example:" | "Examples:" => format!("{line}\n"),
        _ if line.starts_with("  holo") => format!("  {line}"),
        _ => line.to_owned(),
    }
}

#[test]
fn docs_options_md_is_what_the_commands_help_says() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/options.md");
    let page = page();
    if std::env::var_os("WRITE_DOCS").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    let written = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(written == page, "write docs/options.md again: WRITE_DOCS=1 cargo test -p holodeck");
}
