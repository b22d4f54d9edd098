//! Rust source as words, and the modules of a package with the paths that each of them uses.
//!
//! Tests and what only they use are left out.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

/// A module: its file, its children, and the names in it.
#[derive(Debug, Default)]
pub struct Module {
    /// The file that has it. A module in braces is in its parent's file.
    pub file: PathBuf,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    /// Names of the items defined here.
    items: BTreeSet<String>,
    /// Names of the types defined here, without those in functions.
    pub types: Vec<String>,
    /// Imported names with their paths, as written.
    imports: BTreeMap<String, Vec<String>>,
    /// Paths of which all names are imported.
    globs: Vec<Vec<String>>,
    /// Paths that are used, as written.
    uses: Vec<Vec<String>>,
}

/// The modules of a library or program. The first one is the root.
#[derive(Debug, Default)]
pub struct Modules(pub Vec<Module>);

/// Words of a file: identifiers, `::`, and single signs. Lifetimes and literals are left out.
fn words(text: &str) -> Vec<String> {
    let tokens: TokenStream = text.parse().expect("the file is Rust");
    let mut words = Vec::new();
    add_words(tokens, &mut words);
    words
}

fn add_words(tokens: TokenStream, words: &mut Vec<String>) {
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        match token {
            TokenTree::Group(group) => {
                let brackets = match group.delimiter() {
                    Delimiter::Parenthesis => Some(["(", ")"]),
                    Delimiter::Brace => Some(["{", "}"]),
                    Delimiter::Bracket => Some(["[", "]"]),
                    Delimiter::None => None,
                };
                words.extend(brackets.map(|[open, _]| open.to_owned()));
                add_words(group.stream(), words);
                words.extend(brackets.map(|[_, close]| close.to_owned()));
            }
            TokenTree::Ident(name) => words.push(name.to_string()),
            TokenTree::Literal(_) => {}
            // A lifetime is a sign and a name.
            TokenTree::Punct(sign) if sign.as_char() == '\'' => _ = tokens.next(),
            TokenTree::Punct(sign) => {
                // `::` is two signs.
                let is_path = sign.as_char() == ':' && sign.spacing() == Spacing::Joint;
                words.push(if is_path { "::".to_owned() } else { sign.to_string() });
                tokens.next_if(|_| is_path);
            }
        }
    }
}

/// Returns the place after the bracket that belongs to the one at `at`.
fn after_bracket(words: &[String], at: usize) -> usize {
    let mut depth = 0;
    for (place, word) in words.iter().enumerate().skip(at) {
        match word.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return place + 1;
        }
    }
    words.len()
}

/// Returns the words without items that only tests have.
fn without_tests(words: &[String]) -> Vec<String> {
    let mut kept = Vec::new();
    let mut at = 0;
    while at < words.len() {
        let is_attribute = words[at] == "#" && words.get(at + 1).is_some_and(|word| word == "[");
        if !is_attribute {
            kept.push(words[at].clone());
            at += 1;
            continue;
        }
        let end = after_bracket(words, at + 1);
        let attribute = words[at + 2..end - 1].concat();
        if !["cfg(test)", "test"].contains(&attribute.as_str()) {
            kept.extend_from_slice(&words[at..end]);
            at = end;
            continue;
        }
        at = end;
        // The item ends with its body in braces, or with a semicolon.
        while at < words.len() {
            match words[at].as_str() {
                "{" => {
                    at = after_bracket(words, at);
                    break;
                }
                ";" => {
                    at += 1;
                    break;
                }
                "(" | "[" => at = after_bracket(words, at),
                _ => at += 1,
            }
        }
    }
    kept
}

/// An imported path: its words, and the name that it gets.
type Import = (Vec<String>, String);

/// Reads the tree of a `use` from `at` on, and returns the place after it.
fn use_tree(words: &[String], mut at: usize, path: &[String], found: &mut Vec<Import>) -> usize {
    let mut path = path.to_vec();
    while at < words.len() {
        match words[at].as_str() {
            "{" => {
                at += 1;
                while words[at] != "}" {
                    at = use_tree(words, at, &path, found);
                    if words[at] == "," {
                        at += 1;
                    }
                }
                return at + 1;
            }
            "," | ";" | "}" => break,
            "as" => {
                found.push((path, words[at + 1].clone()));
                return at + 2;
            }
            "::" => at += 1,
            word => {
                path.push(word.to_owned());
                at += 1;
            }
        }
    }
    if path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    if let Some(name) = path.last().cloned() {
        found.push((path, name));
    }
    at
}

impl Modules {
    /// Reads the modules of a library or program from its root file.
    pub fn read(root: &Path) -> Modules {
        let mut modules = Modules::default();
        let folder = root.parent().unwrap().to_owned();
        modules.0.push(Module { file: root.to_owned(), ..Module::default() });
        let words = without_tests(&words(&std::fs::read_to_string(root).unwrap()));
        modules.fill(0, &words, &folder);
        modules
    }

    /// Reads the body of a module. Its children's files are in `folder`.
    fn fill(&mut self, this: usize, words: &[String], folder: &Path) {
        let (mut at, mut depth) = (0, 0);
        // Files elsewhere, named by an attribute, are shared by tests.
        let mut is_elsewhere = false;
        // Paths of re-exports count if the module uses their names itself.
        let mut exports: Vec<Import> = Vec::new();
        let mut names = BTreeSet::new();
        while at < words.len() {
            let next = words.get(at + 1).cloned().unwrap_or_default();
            let before = at.checked_sub(1).map_or("", |before| words[before].as_str());
            match words[at].as_str() {
                "#" if next == "[" => {
                    let end = after_bracket(words, at + 1);
                    is_elsewhere |= words[at + 2] == "path";
                    at = end;
                }
                "mod" => {
                    let child = self.0.len();
                    let file = self.0[this].file.clone();
                    let module = Module { file, parent: Some(this), ..Module::default() };
                    self.0.push(module);
                    self.0[this].children.insert(next.clone(), child);
                    let inner = folder.join(&next);
                    if words[at + 2] == "{" {
                        let end = after_bracket(words, at + 2);
                        self.fill(child, &words[at + 3..end - 1], &inner);
                        at = end;
                    } else {
                        let files = [folder.join(format!("{next}.rs")), inner.join("mod.rs")];
                        let file = files.into_iter().find(|file| file.is_file());
                        let is_here = !std::mem::take(&mut is_elsewhere);
                        if let Some(file) = file.filter(|_| is_here) {
                            let text = std::fs::read_to_string(&file).unwrap();
                            self.0[child].file = file;
                            self.fill(child, &without_tests(&self::words(&text)), &inner);
                        }
                        at += 3;
                    }
                }
                "use" if next != "<" => {
                    let mut found = Vec::new();
                    let is_export = before == "pub" || before == ")";
                    at = use_tree(words, at + 1, &[], &mut found);
                    for (path, name) in found {
                        let module = &mut self.0[this];
                        if name == "*" {
                            module.globs.push(path[..path.len() - 1].to_vec());
                        } else {
                            module.imports.insert(name.clone(), path.clone());
                        }
                        if is_export {
                            exports.push((path, name));
                        } else {
                            module.uses.push(path);
                        }
                    }
                }
                "{" => (depth, at) = (depth + 1, at + 1),
                "}" => (depth, at) = (depth - 1, at + 1),
                "::" => at += 1,
                word => {
                    let defines =
                        ["struct", "enum", "trait", "union", "fn", "const", "static", "type"];
                    let is_name =
                        |word: &str| word.starts_with(|c: char| c.is_alphabetic() || c == '_');
                    if depth == 0 && defines.contains(&before) {
                        let module = &mut self.0[this];
                        module.items.insert(word.to_owned());
                    }
                    if ["struct", "enum", "trait", "union"].contains(&before)
                        && is_name(word)
                        && word.starts_with(char::is_uppercase)
                    {
                        self.0[this].types.push(word.to_owned());
                    }
                    if is_name(word) && before != "::" && before != "." {
                        let mut path = vec![word.to_owned()];
                        let mut end = at + 1;
                        while words.get(end).is_some_and(|word| word == "::")
                            && words.get(end + 1).is_some_and(|word| is_name(word))
                        {
                            path.push(words[end + 1].clone());
                            end += 2;
                        }
                        names.insert(word.to_owned());
                        if path.len() > 1 {
                            self.0[this].uses.push(path);
                        }
                        at = end;
                    } else {
                        at += 1;
                    }
                }
            }
        }
        let used = exports.into_iter().filter(|(_, name)| names.contains(name));
        let used: Vec<_> = used.map(|(path, _)| path).collect();
        self.0[this].uses.extend(used);
    }

    /// Returns the module in which a path ends that is written in module `at`. `None` if the path
    /// leads out of the package.
    fn target(&self, at: usize, path: &[String], depth: usize) -> Option<usize> {
        let (first, rest) = path.split_first()?;
        let module = &self.0[at];
        match first.as_str() {
            "crate" => self.within(0, rest, depth),
            "self" => self.within(at, rest, depth),
            "super" => self.target_above(module.parent?, rest, depth),
            name if module.children.contains_key(name) => self.within(at, path, depth),
            name => {
                let import = module.imports.get(name).filter(|import| import[0] != *name)?;
                let whole: Vec<_> = import.iter().chain(rest).cloned().collect();
                (depth > 0).then(|| self.target(at, &whole, depth - 1))?
            }
        }
    }

    /// Continues a path after `super`.
    fn target_above(&self, above: usize, rest: &[String], depth: usize) -> Option<usize> {
        match rest.split_first() {
            Some((first, more)) if first == "super" => {
                self.target_above(self.0[above].parent?, more, depth)
            }
            _ => self.within(above, rest, depth),
        }
    }

    /// Follows a path downwards from a module, through its imports.
    fn within(&self, at: usize, path: &[String], depth: usize) -> Option<usize> {
        let module = &self.0[at];
        let Some((first, rest)) = path.split_first() else { return Some(at) };
        if let Some(child) = module.children.get(first) {
            return self.within(*child, rest, depth);
        }
        if depth == 0 || module.items.contains(first) {
            return Some(at);
        }
        if let Some(import) = module.imports.get(first) {
            let whole: Vec<_> = import.iter().chain(rest).cloned().collect();
            return self.target(at, &whole, depth - 1);
        }
        let globs = module.globs.iter().filter_map(|glob| self.target(at, glob, depth - 1));
        let mut found = globs.filter(|glob| *glob != at && self.0[*glob].items.contains(first));
        Some(found.next().unwrap_or(at))
    }

    /// For each file, the other files that it uses.
    pub fn uses(&self) -> BTreeMap<&Path, BTreeSet<&Path>> {
        /// Most imports that a name passes.
        const DEPTH: usize = 8;
        let mut uses: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
        for (at, module) in self.0.iter().enumerate() {
            let targets = module.uses.iter().filter_map(|path| self.target(at, path, DEPTH));
            let files = targets.map(|target| self.0[target].file.as_path());
            let others = files.filter(|file| *file != module.file);
            uses.entry(&module.file).or_default().extend(others);
        }
        uses
    }
}

/// Returns the circles: each a set of at least two places that all lead to each other.
pub fn circles<T: Ord + Copy>(uses: &BTreeMap<T, BTreeSet<T>>) -> Vec<BTreeSet<T>> {
    let reached = |from: T| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(place) = open.pop() {
            let next = uses.get(&place).into_iter().flatten();
            open.extend(next.copied().filter(|next| reached.insert(*next)));
        }
        reached
    };
    let reached: BTreeMap<T, BTreeSet<T>> =
        uses.keys().map(|place| (*place, reached(*place))).collect();
    let mut circles: Vec<BTreeSet<T>> = Vec::new();
    for (place, others) in &reached {
        let both = |other: &&T| reached.get(other).is_some_and(|back| back.contains(place));
        let circle: BTreeSet<T> = others.iter().filter(both).copied().collect();
        if circle.len() > 1 && !circles.contains(&circle) {
            circles.push(circle);
        }
    }
    circles
}
