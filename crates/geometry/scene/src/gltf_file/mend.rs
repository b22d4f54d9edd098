//! Reduces a file's JSON to what a picture needs, before the crate `gltf` validates it.
//!
//! - Only the elements that the scene reaches are kept. Others become placeholders, so that
//!   indices stay.
//! - Only the members of the [schema](super::schema) are kept. Those with a false value are
//!   dropped, and counted.
//! - A mesh of the scene without its positions is an error.
//!
//! Invariant: every index that is kept names an element that exists and has what it requires.

use std::collections::{BTreeMap, BTreeSet};

use gltf::json::{Root, validation};
use serde_json::{Map, Value};

use super::photometry::named_by;
use super::schema::{List, Member, Members, Requirement, ValueKind};
use crate::text::excerpt;

/// A file's JSON as the crate accepts it, and counts of what was dropped or replaced.
pub(super) struct Mended {
    pub json: Root,
    pub counts: BTreeMap<String, usize>,
    /// Photometric files, by the index of the node that names them.
    pub photometry: BTreeMap<usize, String>,
}

/// Number of lists.
const LISTS: usize = List::ALL.len();

/// The lists of a file while they are reduced.
pub(super) struct Mending {
    pub lists: [Vec<Value>; LISTS],
    /// Whether an element has what it requires.
    usable: [Vec<bool>; LISTS],
    /// Whether the scene reaches an element.
    pub used: [Vec<bool>; LISTS],
    pub counts: BTreeMap<String, usize>,
    /// True if the file has a binary chunk, which is its first buffer.
    pub has_chunk: bool,
    /// Whether vertices of a material have colours, for the file's own materials.
    pub coloured: Vec<bool>,
    /// The texture without a picture that stands for textures that do not exist.
    no_texture: Option<usize>,
}

/// Reduces a file's JSON.
///
/// # Errors
/// Faults of what a picture needs, in words for people.
pub(super) fn mend(root: Value, has_chunk: bool) -> Result<Mended, String> {
    let Value::Object(mut root) = root else { return Err("its JSON is no object".to_owned()) };
    let mut mending = Mending::new(&mut root, has_chunk);
    let mut kept = Map::new();
    kept.insert("asset".to_owned(), constant(r#"{"version":"2.0"}"#));
    // Some programs name extensions only as required.
    let lists = ["extensionsUsed", "extensionsRequired"].map(|list| root.remove(list));
    let all = lists.iter().flatten().filter_map(Value::as_array).flatten();
    let names: BTreeSet<&str> = all.filter_map(Value::as_str).collect();
    kept.insert("extensionsUsed".to_owned(), names.into_iter().collect());
    let animations = root.get("animations").and_then(Value::as_array).map_or(0, Vec::len);
    if animations > 0 {
        let what = "animations are ignored: the scene stands still".to_owned();
        mending.counts.insert(what, animations);
    }
    if let Some(scene) = mending.scenes(root.get("scene")) {
        kept.insert("scene".to_owned(), scene.into());
    }
    mending.nodes()?;
    let nodes = mending.lists[List::Nodes as usize].iter().enumerate();
    let photometry = nodes.filter_map(|(index, node)| Some((index, named_by(node)?))).collect();
    for list in List::ALL {
        match list {
            List::Meshes => mending.meshes()?,
            List::Materials => mending.materials(),
            List::Textures => mending.textures(),
            List::BufferViews => mending.buffer_views()?,
            _ => {}
        }
        mending.reduce(list);
    }
    mending.complete();
    for list in List::ALL {
        let elements = Value::Array(std::mem::take(&mut mending.lists[list as usize]));
        if list == List::Lights {
            let mut lights = Map::new();
            lights.insert("lights".to_owned(), elements);
            let mut extensions = Map::new();
            extensions.insert("KHR_lights_punctual".to_owned(), lights.into());
            kept.insert("extensions".to_owned(), extensions.into());
        } else {
            kept.insert(list.name().to_owned(), elements);
        }
    }
    let json: Root = serde_json::from_value(kept.into()).map_err(|error| error.to_string())?;
    validate(&json)?;
    Ok(Mended { json, counts: mending.counts, photometry })
}

/// Validates what the crate `gltf` relies on. It also demands bounds of positions, bytes of
/// accessors and strides of at least 4, which are not needed here.
fn validate(json: &Root) -> Result<(), String> {
    use validation::{Error, Validate};
    let mut first = None;
    json.validate(json, gltf::json::Path::new, &mut |path, error| {
        let path = path().to_string();
        if error != Error::Missing && !path.ends_with("byteStride") {
            first.get_or_insert(format!("{path}: {error}"));
        }
    });
    first.map_or(Ok(()), Err)
}

/// Parses JSON of this program.
pub(super) fn constant(json: &str) -> Value {
    serde_json::from_str(json).unwrap_or_default()
}

/// A reason why a value is not used, for people.
type Fault = String;

impl Mending {
    fn new(root: &mut Map<String, Value>, has_chunk: bool) -> Mending {
        let mut extensions = root.remove("extensions").unwrap_or_default();
        let mut lights = extensions.get_mut("KHR_lights_punctual").map(Value::take);
        let lists = List::ALL.map(|list| {
            let elements = match (list, &mut lights) {
                (List::Lights, Some(lights)) => lights.get_mut("lights").map(Value::take),
                (List::Lights, None) => None,
                _ => root.remove(list.name()),
            };
            match elements {
                Some(Value::Array(elements)) => elements,
                _ => Vec::new(),
            }
        });
        let used = lists.each_ref().map(|elements| vec![false; elements.len()]);
        let usable = lists.each_ref().map(|elements| vec![true; elements.len()]);
        let coloured = vec![false; lists[List::Materials as usize].len()];
        let (counts, no_texture) = (BTreeMap::new(), None);
        let mut mending = Mending { lists, usable, used, counts, has_chunk, coloured, no_texture };
        // A list's elements depend on those of later lists.
        for list in List::ALL.into_iter().rev() {
            let elements = &mending.lists[list as usize];
            let usable =
                elements.iter().map(|element| mending.is_usable(element, list.members())).collect();
            mending.usable[list as usize] = usable;
        }
        mending
    }

    pub(super) fn count(&mut self, what: impl Into<String>) {
        *self.counts.entry(what.into()).or_default() += 1;
    }

    /// Adds an element that is used.
    pub(super) fn add(&mut self, list: List, element: Value) -> usize {
        let list = list as usize;
        self.lists[list].push(element);
        self.usable[list].push(true);
        self.used[list].push(true);
        self.lists[list].len() - 1
    }

    /// Returns the element that a value names.
    pub(super) fn element(&self, list: List, index: &Value) -> Result<usize, Fault> {
        // The list itself may be taken apart at the moment.
        let count = self.usable[list as usize].len();
        let name = list.name();
        let found = whole(index).and_then(|index| usize::try_from(index).ok());
        match found.filter(|&index| index < count) {
            Some(index) if self.usable[list as usize][index] => Ok(index),
            Some(index) => Err(format!("names element {index} of `{name}`, which is not complete")),
            None => Err(format!("names element {} of `{name}`, which has {count}", shown(index))),
        }
    }

    /// Returns whether an object has what it requires.
    fn is_usable(&self, value: &Value, members: Members) -> bool {
        let is_right = |member: &Member| match value.get(member.name).filter(|v| !v.is_null()) {
            Some(value) => {
                member.need == Requirement::Optional || self.problem(value, member.kind).is_none()
            }
            None => member.need != Requirement::Required,
        };
        value.is_object() && members.iter().all(is_right)
    }

    /// Returns what is wrong with a value.
    fn problem(&self, value: &Value, kind: ValueKind) -> Option<Fault> {
        let is = |is_right: bool, what: &str| (!is_right).then(|| format!("is no {what}"));
        let numbers = |value: &Value| {
            value.as_array().filter(|list| list.iter().all(Value::is_number)).map(Vec::len)
        };
        match kind {
            ValueKind::Number => is(value.is_number(), "number"),
            ValueKind::Numbers(least) => {
                let is_right = numbers(value).is_some_and(|count| count >= least);
                (!is_right).then(|| format!("is no list of {least} numbers"))
            }
            ValueKind::AnyNumbers => is(numbers(value).is_some(), "list of numbers"),
            ValueKind::Whole => is(whole(value).is_some_and(|n| n <= u64::from(u32::MAX)), "index"),
            ValueKind::Size => is(whole(value).is_some(), "size"),
            ValueKind::Flag => is(value.is_boolean(), "`true` or `false`"),
            ValueKind::Text => is(value.is_string(), "text"),
            ValueKind::Word(words) => {
                let is_right = value.as_str().is_some_and(|word| words.contains(&word));
                (!is_right).then(|| format!("is {}, which the format does not have", shown(value)))
            }
            ValueKind::Code(codes) => {
                let is_right = whole(value).is_some_and(|code| codes.contains(&code));
                (!is_right).then(|| format!("is {}, which the format does not have", shown(value)))
            }
            ValueKind::Index(list) => self.element(list, value).err(),
            ValueKind::Indices(list) => {
                let Some(indices) = value.as_array() else { return Some("is no list".to_owned()) };
                indices.iter().find_map(|index| self.element(list, index).err())
            }
            ValueKind::Object(members) => is(self.is_usable(value, members), "complete object"),
            ValueKind::Objects(_) => is(value.is_array(), "list"),
            ValueKind::Attributes | ValueKind::Extensions(_) => is(value.is_object(), "object"),
        }
    }

    /// Replaces the elements of a list that are not used, and reduces the others.
    fn reduce(&mut self, list: List) {
        let mut elements = std::mem::take(&mut self.lists[list as usize]);
        for (index, element) in elements.iter_mut().enumerate() {
            match element.as_object_mut() {
                Some(object) if self.used[list as usize][index] => {
                    self.keep(object, list.members(), list);
                }
                _ => *element = constant(list.placeholder()),
            }
        }
        // Elements that were added meanwhile follow.
        elements.append(&mut self.lists[list as usize]);
        self.lists[list as usize] = elements;
    }

    /// Keeps the members of an object that are read and right. `list` is for messages.
    fn keep(&mut self, object: &mut Map<String, Value>, members: Members, list: List) {
        let mut kept = Map::new();
        for member in members {
            let Some(mut value) = object.remove(member.name) else { continue };
            let is_null = value.is_null();
            if is_null && !matches!(member.kind, ValueKind::Number | ValueKind::Numbers(_)) {
                continue;
            }
            match self.keep_value(&mut value, member.kind, list) {
                Ok(()) => {
                    kept.insert(member.name.to_owned(), value);
                }
                Err(fault) => {
                    let fault = if is_null { "is null".to_owned() } else { fault };
                    let (name, list) = (member.name, list.name());
                    let instead = match member.kind {
                        ValueKind::Number
                        | ValueKind::Numbers(_)
                        | ValueKind::Word(_)
                        | ValueKind::Code(_) => "the format's default is taken",
                        _ => "it is left out",
                    };
                    self.count(format!("`{name}` of {list} {fault}: {instead}"));
                }
            }
        }
        *object = kept;
    }

    fn keep_value(&mut self, value: &mut Value, kind: ValueKind, list: List) -> Result<(), Fault> {
        match (kind, &mut *value) {
            (ValueKind::Indices(of), Value::Array(indices)) => {
                let all = indices.len();
                indices.retain(|index| self.element(of, index).is_ok());
                if indices.len() < all {
                    let what = format!("`{}` of {} that do not exist", of.name(), list.name());
                    *self.counts.entry(format!("{what} are left out")).or_default() +=
                        all - indices.len();
                }
                for index in indices {
                    self.use_element(of, index);
                }
                return Ok(());
            }
            (ValueKind::Objects(members), Value::Array(objects)) => {
                let all = objects.len();
                objects.retain(|object| self.is_usable(object, members));
                if objects.len() < all {
                    let what = format!("incomplete parts of {} are left out", list.name());
                    *self.counts.entry(what).or_default() += all - objects.len();
                }
                for object in objects.iter_mut().filter_map(Value::as_object_mut) {
                    self.keep(object, members, list);
                }
                return Ok(());
            }
            (ValueKind::Object(members), Value::Object(object)) => {
                self.replace_missing_texture(object, members);
                // Its own faults are named, rather than that it is incomplete.
                if let Some(fault) = members.iter().find_map(|member| {
                    let value = object.get(member.name).filter(|value| !value.is_null());
                    let is_needed = member.need != Requirement::Optional;
                    value.filter(|_| is_needed).and_then(|value| self.problem(value, member.kind))
                }) {
                    return Err(fault);
                }
                self.keep(object, members, list);
                return self.problem(value, kind).map_or(Ok(()), Err);
            }
            (ValueKind::Extensions(members), Value::Object(object)) => {
                let mut known = Map::new();
                for member in members {
                    known.extend(object.remove_entry(member.name));
                }
                self.keep(&mut known, members, list);
                // Textures of others may be looked up.
                let others = object.values_mut().filter_map(Value::as_object_mut);
                for index in others.flat_map(|o| o.values_mut()).filter_map(|v| v.get_mut("index"))
                {
                    if self.element(List::Textures, index).is_ok() {
                        self.use_element(List::Textures, index);
                    }
                }
                object.extend(known);
                return Ok(());
            }
            (ValueKind::Attributes, Value::Object(attributes)) => {
                self.keep_attributes(attributes);
                return Ok(());
            }
            _ => {}
        }
        if let Some(fault) = self.problem(value, kind) {
            return Err(fault);
        }
        match (kind, &mut *value) {
            (ValueKind::Numbers(most), Value::Array(numbers)) => numbers.truncate(most),
            (ValueKind::Index(of), index) => self.use_element(of, index),
            // Some programs write whole numbers with a fraction of zero.
            (ValueKind::Whole | ValueKind::Size | ValueKind::Code(_), number) => {
                *number = whole(number).unwrap_or_default().into();
            }
            _ => {}
        }
        Ok(())
    }

    /// Marks an element that exists as used.
    fn use_element(&mut self, list: List, index: &mut Value) {
        let number = whole(index).unwrap_or_default();
        self.used[list as usize][number as usize] = true;
        *index = number.into();
    }

    /// Lets a texture that does not exist be one without a picture. It is then treated like a
    /// picture that cannot be read.
    fn replace_missing_texture(&mut self, info: &mut Map<String, Value>, members: Members) {
        let names_texture =
            |member: &Member| matches!(member.kind, ValueKind::Index(List::Textures));
        if !members.iter().any(names_texture) {
            return;
        }
        let index = info.get("index").cloned().unwrap_or_default();
        if self.element(List::Textures, &index).is_err() {
            let missing = match self.no_texture {
                Some(missing) => missing,
                None => self.add(List::Textures, constant("{}")),
            };
            self.no_texture = Some(missing);
            info.insert("index".to_owned(), missing.into());
        }
    }

    /// Keeps the attributes of vertices that are read.
    fn keep_attributes(&mut self, attributes: &mut Map<String, Value>) {
        let named = std::mem::take(attributes);
        for (name, mut index) in named {
            if !is_read(&name) {
                if name.starts_with('_') {
                    self.count("attributes of vertices for applications are ignored");
                }
                continue;
            }
            match self.element(List::Accessors, &index) {
                Ok(_) => {
                    self.use_element(List::Accessors, &mut index);
                    attributes.insert(name, index);
                }
                Err(fault) => {
                    let name = excerpt(&name);
                    self.count(format!("`{name}` of meshes {fault}: it is left out"));
                }
            }
        }
    }

    /// Adds the members that the crate requires and nothing here reads.
    fn complete(&mut self) {
        let mut insert = |list: List, inner: Option<&str>, name: &str, value: &str| {
            for element in &mut self.lists[list as usize] {
                let target = match inner {
                    Some(inner) => element.get_mut(inner),
                    None => Some(element),
                };
                if let Some(object) = target.and_then(Value::as_object_mut)
                    && !object.contains_key(name)
                {
                    object.insert(name.to_owned(), constant(value));
                }
            }
        };
        // Without an angle, a camera has no plausible view.
        insert(List::Cameras, None, "perspective", r#"{"yfov":0}"#);
        insert(List::Cameras, None, "orthographic", r#"{"ymag":0}"#);
        insert(List::Cameras, Some("perspective"), "znear", "1");
        for name in ["xmag", "zfar", "znear"] {
            insert(List::Cameras, Some("orthographic"), name, "1");
        }
        insert(List::Lights, None, "spot", "{}");
        insert(List::Scenes, None, "nodes", "[]");
        insert(List::Buffers, None, "byteLength", "0");
        // The crate would look for a name or a type. Types are determined from the bytes.
        for image in self.lists[List::Images as usize].iter_mut().filter_map(Value::as_object_mut) {
            if image.contains_key("bufferView") {
                image.insert("mimeType".to_owned(), "".into());
            } else {
                image.entry("uri").or_insert_with(|| "".into());
            }
        }
        // A placeholder names the first buffer.
        if self.lists[List::Buffers as usize].is_empty() {
            self.lists[List::BufferViews as usize].clear();
        }
    }
}

/// Returns whether an attribute of vertices is read.
fn is_read(name: &str) -> bool {
    let is_number = |text: &str| text.parse::<u32>().is_ok_and(|n| n.to_string() == text);
    let has_number = |kind: &str| name.strip_prefix(kind).is_some_and(is_number);
    matches!(name, "POSITION" | "NORMAL" | "COLOR_0")
        || ["TEXCOORD_", "JOINTS_", "WEIGHTS_"].into_iter().any(has_number)
}

/// Returns a whole number, which some programs write with a fraction of zero.
pub(super) fn whole(value: &Value) -> Option<u64> {
    let rounded = || value.as_f64().filter(|n| n.fract() == 0.0 && (0.0..1e15).contains(n));
    value.as_u64().or_else(|| rounded().map(|n| n as u64))
}

/// Returns a value for messages.
fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => format!("`{}`", excerpt(text)),
        other => excerpt(&other.to_string()),
    }
}
