//! MTL text, checked and simplified before `tobj` parses it.
//!
//! `tobj` panics at a colour of one number. It gives up a file at `Kd spectral`, an `illum` beyond
//! 255 or a material without name. It accepts NaN, knows one case of each keyword, and reports no
//! lines. So it receives only [`COLOURS`] of three finite numbers and [`NUMBERS`] of one, in the
//! words of the file. Materials are named by numbers. Lines and names are remembered here.

use crate::SceneError;
use crate::exporter::Exporter;
use crate::habits;
use crate::limits::{MAX_MATERIALS, MAX_NAME_BYTES};
use crate::mtl::{MtlMaterial, Stated};
use crate::mtl_maps::{MapSlot, MapStatement};
use crate::text::{excerpt, keyword, logical_lines, loose_number, number, without_comment};
use crate::warnings::Warnings;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Colours, in the spelling of `tobj`.
const COLOURS: [&str; 4] = ["Kd", "Ks", "Ke", "Tf"];
/// Single numbers, with `illum`.
const NUMBERS: [&str; 7] = ["Ns", "Ni", "d", "Tr", "illum", "Pr", "Pm"];
/// Most unknown statements that are named for one file.
const MAX_UNKNOWN: usize = 32;

/// Reads MTL text; `path` is for messages.
pub(crate) fn parse_mtl(
    path: &Path,
    text: &str,
    warnings: &mut Warnings,
) -> Result<Vec<MtlMaterial>, SceneError> {
    let mut clean =
        CleanMtl { path, clean: String::new(), headers: Vec::new(), unknown: HashSet::new() };
    for (line, content) in logical_lines(text) {
        clean.statement(line, &content, warnings)?;
    }
    let parsed = tobj::load_mtl_buf(&mut clean.clean.as_bytes());
    let (materials, _) =
        parsed.map_err(|source| SceneError::Parser { path: path.to_owned(), source })?;
    let whole = |(header, material): (MaterialFacts, _)| header.with(path, material);
    let mut materials: Vec<MtlMaterial> =
        clean.headers.into_iter().zip(materials).map(whole).collect();
    let program = habits::program(text, &materials);
    materials.iter_mut().for_each(|material| material.program = program);
    let is_affected = |material: &&MtlMaterial| material.illum.is_some_and(|i| i.value == 7);
    let first = materials.iter().find(is_affected).filter(|_| program == Exporter::Cinema4d);
    if let Some(first) = first {
        let count = materials.iter().filter(is_affected).count();
        let text = format!(
            "`illum 7` counts as 1 ({count} in the file): Cinema 4D writes it for everything"
        );
        warnings.push(path, first.illum.map(|illum| illum.line), text);
    }
    Ok(materials)
}

/// Facts about a material that `tobj` does not report.
struct MaterialFacts {
    name: String,
    line: usize,
    /// The line of each statement; the last one if there are several.
    lines: HashMap<&'static str, usize>,
    maps: Vec<MapStatement>,
    ies: Option<Stated<(String, f64)>>,
}

/// The clean text of an MTL file, and what it leaves out.
struct CleanMtl<'a> {
    path: &'a Path,
    clean: String,
    headers: Vec<MaterialFacts>,
    unknown: HashSet<String>,
}

impl CleanMtl<'_> {
    /// Checks a statement, and writes what `tobj` should parse to `clean`.
    fn statement(
        &mut self,
        line: usize,
        content: &str,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let (keyword, rest) = keyword(content);
        let statement = Statement { path: self.path, line, values: without_comment(rest) };
        let lower = keyword.to_ascii_lowercase();
        let same = |known: &&&str| known.eq_ignore_ascii_case(keyword);
        let colour = COLOURS.iter().find(same);
        if let Some(property) = colour.or(NUMBERS.iter().find(same)) {
            let Some(header) = self.headers.last_mut() else {
                let text = format!("`{keyword}` comes before any `newmtl`; it is left out");
                warnings.push(self.path, Some(line), text);
                return Ok(());
            };
            let values = match *property {
                _ if colour.is_some() => statement.colour(),
                "illum" => statement.illum(),
                "d" => statement.without_halo().number(),
                _ => statement.number(),
            };
            match values {
                Ok(values) => {
                    header.lines.insert(property, line);
                    self.clean.extend([property, " ", &values, "\n"]);
                }
                Err(problem) => {
                    let text = format!("`{keyword}` {problem}; it is left out");
                    warnings.push(self.path, Some(line), text);
                }
            }
        } else if lower == "newmtl" {
            if self.headers.len() == MAX_MATERIALS {
                return Err(statement.limit("materials", MAX_MATERIALS));
            }
            if rest.len() > MAX_NAME_BYTES {
                return Err(statement.limit("bytes in a name", MAX_NAME_BYTES));
            }
            self.clean.extend(["newmtl ", &self.headers.len().to_string(), "\n"]);
            let (name, lines) = (rest.to_owned(), HashMap::new());
            self.headers.push(MaterialFacts { name, line, lines, maps: Vec::new(), ies: None });
        } else if lower == "ies"
            && let Some(header) = self.headers.last_mut()
        {
            match photometric_file(statement.values) {
                Some(value) => header.ies = Some(Stated { value, line }),
                None => {
                    let text = "`ies` takes a file, or `-turn DEGREES` and a file; it is left out";
                    warnings.push(self.path, Some(line), text.to_owned());
                }
            }
        } else if let Some(slot) = MapSlot::of(&lower)
            && let Some(header) = self.headers.last_mut()
            && let Some(map) = MapStatement::read(slot, line, rest)
        {
            header.maps.retain(|earlier| earlier.slot != slot);
            header.maps.push(map);
        } else if is_texture(&lower) {
            let text = format!("`{}` is ignored: this texture is not supported", excerpt(content));
            warnings.push(self.path, Some(line), text);
        } else if !["ka", "sharpness"].contains(&lower.as_str())
            && self.unknown.len() < MAX_UNKNOWN
            && self.unknown.insert(lower)
        {
            let text = format!("`{}` is unknown and ignored (reported once)", excerpt(keyword));
            warnings.push(self.path, Some(line), text);
        }
        Ok(())
    }
}

fn is_texture(keyword: &str) -> bool {
    keyword.starts_with("map_") || ["bump", "disp", "decal", "refl", "norm"].contains(&keyword)
}

/// Returns the file of `ies`, and the degrees by which its luminaires are turned.
fn photometric_file(values: &str) -> Option<(String, f64)> {
    let values = values.trim();
    let (turn, name) = match values.strip_prefix("-turn") {
        None => (0.0, values),
        Some(rest) => {
            let (turn, name) = rest.trim_start().split_once(char::is_whitespace)?;
            (number(turn).filter(|turn| turn.abs() <= 360.0)?, name.trim())
        }
    };
    (!name.is_empty()).then(|| (name.trim_matches('"').to_owned(), turn))
}

/// A line that sets a property.
#[derive(Clone, Copy)]
struct Statement<'a> {
    path: &'a Path,
    line: usize,
    values: &'a str,
}

impl<'a> Statement<'a> {
    fn limit(&self, what: &'static str, limit: usize) -> SceneError {
        SceneError::FileLimit { path: self.path.to_owned(), line: self.line, what, limit }
    }

    /// Drops `-halo`, which lets the edge differ from the centre: there is no such surface here.
    fn without_halo(self) -> Self {
        let values = self.values.strip_prefix("-halo").map_or(self.values, str::trim_ascii_start);
        Statement { values, ..self }
    }

    /// Returns the only value, a finite number. Errors are for people.
    fn number(&self) -> Result<String, String> {
        let mut tokens = self.values.split_ascii_whitespace();
        let (first, more) = (tokens.next(), tokens.count());
        let Some(token) = first.filter(|_| more == 0) else {
            let found = if first.is_some() { 1 + more } else { 0 };
            return Err(format!("takes one number, found {found}"));
        };
        plain(token).ok_or_else(|| format!("takes a finite number, found `{}`", excerpt(token)))
    }

    /// Returns an integer. `tobj` accepts 0 to 255; all others are equally unknown here.
    fn illum(&self) -> Result<String, String> {
        let illum =
            number(&self.number()?).filter(|value| value.fract() == 0.0 && value.abs() <= 1e6);
        let illum =
            illum.ok_or_else(|| format!("takes an integer, found `{}`", excerpt(self.values)))?;
        let unknown = f64::from(u8::MAX);
        Ok(if (0.0..unknown).contains(&illum) { illum.abs() } else { unknown }.to_string())
    }

    /// Returns three numbers; one stands for three.
    fn colour(&self) -> Result<String, String> {
        let mut numbers = Vec::new();
        for token in self.values.split_ascii_whitespace() {
            if numbers.is_empty() && (token == "spectral" || token == "xyz") {
                return Err(format!("takes RGB colours, and this is `{token}`"));
            }
            let number = plain(token);
            numbers.push(
                number
                    .ok_or_else(|| format!("takes finite numbers, found `{}`", excerpt(token)))?,
            );
        }
        match &numbers[..] {
            [all] => Ok([all.as_str(); 3].join(" ")),
            // Some exporters write an alpha after the colour.
            [r, g, b] | [r, g, b, _] => Ok([r.as_str(), g, b].join(" ")),
            _ => Err(format!("takes three numbers, found {}", numbers.len())),
        }
    }
}

/// Returns a finite number as `tobj` reads it: the token itself if possible.
fn plain(token: &str) -> Option<String> {
    if number(token).is_some() {
        return Some(token.to_owned());
    }
    loose_number(token).map(|number| number.to_string())
}

impl MaterialFacts {
    /// Returns the whole material.
    fn with(self, path: &Path, parsed: tobj::Material) -> MtlMaterial {
        // Properties without a field in `tobj` come as text, which is that of the clean text.
        let text = |property| parsed.unknown_param.get(property).map(String::as_str);
        let tf = text("Tf").and_then(numbers);
        let single = |property| text(property).and_then(numbers).map(|[number]| number);
        let (tr, pr, pm) = (single("Tr"), single("Pr"), single("Pm"));
        MtlMaterial {
            kd: self.stated("Kd", parsed.diffuse),
            ks: self.stated("Ks", parsed.specular),
            ke: self.stated("Ke", parsed.emissive),
            tf: self.stated("Tf", tf),
            ns: self.stated("Ns", parsed.shininess),
            ni: self.stated("Ni", parsed.optical_density),
            d: self.stated("d", parsed.dissolve),
            tr: self.stated("Tr", tr),
            pr: self.stated("Pr", pr),
            pm: self.stated("Pm", pm),
            illum: self.stated("illum", parsed.illumination_model),
            maps: self.maps,
            ies: self.ies,
            name: self.name,
            program: Exporter::default(),
            path: path.to_owned(),
            line: self.line,
        }
    }

    fn stated<T>(&self, property: &str, value: Option<T>) -> Option<Stated<T>> {
        let line = self.lines.get(property).copied().unwrap_or(self.line);
        value.map(|value| Stated { value, line })
    }
}

/// Returns `N` numbers of a text that has as many.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text.split_ascii_whitespace().map(number).collect();
    numbers?.try_into().ok()
}
