//! The JSON and the binary chunk of a `.gltf` or `.glb` file.

use std::borrow::Cow;

use serde_json::Value;

use crate::foreign;
use crate::text::utf16;

/// Bytes of the header of a `.glb`.
const GLB_HEADER_BYTES: u32 = 12;

/// Returns the JSON of a file, and the binary chunk of a `.glb`.
///
/// # Errors
/// Damage, or another format, in words for people.
pub(super) fn open(bytes: &[u8]) -> Result<(Value, Option<Vec<u8>>), String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let invalid = |what: String| format!("it is not valid glTF: {what}");
    let (json, chunk) = match bytes.first_chunk() {
        Some(&[b'g', b'l', b'T', b'F', _, _, _, _, a, b, c, d]) => {
            // The crate assumes that a .glb is no shorter than its header.
            let (length, found) = (u32::from_le_bytes([a, b, c, d]), bytes.len());
            if length < GLB_HEADER_BYTES || length as usize > found {
                let what = format!("it says that it has {length} bytes in all, and has {found}");
                return Err(invalid(format!("{what}: copy or export it again")));
            }
            if bytes[4..8] == [1, 0, 0, 0] {
                return Err(FIRST_VERSION.to_owned());
            }
            let glb = gltf::Glb::from_slice(bytes).map_err(|error| invalid(error.to_string()))?;
            (glb.json, glb.bin.map(Cow::into_owned))
        }
        _ => match utf16(bytes) {
            Some(text) => (Cow::Owned(text.into_bytes()), None),
            None => (Cow::Borrowed(bytes), None),
        },
    };
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&json);
    // Some programs pad with zeros instead of blanks.
    let end = json.iter().rposition(|byte| !matches!(byte, 0 | b' ' | b'\n' | b'\r' | b'\t'));
    let json = &json[..end.map_or(0, |end| end + 1)];
    let root: Value = serde_json::from_slice(json)
        .or_else(|error| serde_json::from_str(&lenient(json)).map_err(|_| error))
        .map_err(|error| match foreign::format(&String::from_utf8_lossy(json)) {
            Some(what) => what.to_owned(),
            None => invalid(error.to_string()),
        })?;
    match is_first_version(&root) {
        true => Err(FIRST_VERSION.to_owned()),
        false => Ok((root, chunk)),
    }
}

const FIRST_VERSION: &str = "it is glTF 1.0, which is not read: export it as glTF 2.0";

/// Returns whether a file has the format's first version. In that version, lists are objects.
fn is_first_version(json: &Value) -> bool {
    let of_first = |version: &Value| match version {
        Value::String(words) => words.starts_with('1'),
        number => number.as_f64() == Some(1.0),
    };
    // The version's place was optional.
    let version = json.pointer("/asset/version");
    version.map_or_else(|| json.get("meshes").is_some_and(Value::is_object), of_first)
}

/// Returns JSON in which `null` stands for numbers that JSON does not have, such as `NaN`,
/// `-Infinity`, `1e999` and `-nan(ind)`. Bytes that are not UTF-8 become U+FFFD.
fn lenient(json: &[u8]) -> String {
    let json = String::from_utf8_lossy(json);
    let mut clean = String::with_capacity(json.len());
    let mut rest = &*json;
    while let Some(first) = rest.chars().next() {
        let is_part = |c: char| c.is_ascii_alphanumeric() || "+-.#()".contains(c);
        let length = match first {
            '"' => text_length(rest),
            first if is_part(first) => rest.find(|c| !is_part(c)).unwrap_or(rest.len()),
            first => first.len_utf8(),
        };
        let (token, after) = rest.split_at(length);
        let is_known = !is_part(first) || serde_json::from_str::<Value>(token).is_ok();
        clean.push_str(if is_known { token } else { "null" });
        rest = after;
    }
    clean
}

/// Returns the length of the text in quotes with which `json` begins.
fn text_length(json: &str) -> usize {
    let mut is_escaped = true;
    for (at, byte) in json.bytes().enumerate() {
        match byte {
            b'"' if !is_escaped => return at + 1,
            b'\\' => is_escaped = !is_escaped,
            _ => is_escaped = false,
        }
    }
    json.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_json_does_not_have_are_null() {
        let json = br#"{"a":[NaN,-Infinity,1e999,1.5,-nan(ind),true],"b \" NaN":"NaN"}"#;
        let expected = r#"{"a":[null,null,null,1.5,null,true],"b \" NaN":"NaN"}"#;
        assert_eq!(lenient(json), expected);
        assert_eq!(lenient(b"{\"a\":\"\\"), "{\"a\":\"\\");
        assert_eq!(lenient(b"\"\xfc\""), "\"\u{fffd}\"");
    }
}
