//! The .glb container and the .gltf text, told apart by their first bytes.

use super::{SceneError, Source};

/// The two parts of a glTF file.
pub(super) struct Parts<'a> {
    pub(super) json: &'a [u8],
    /// The .glb's BIN chunk.
    pub(super) bin: Option<&'a [u8]>,
}

const MAGIC: &[u8] = b"glTF";
const CHUNK_JSON: &[u8] = b"JSON";
const CHUNK_BIN: &[u8] = b"BIN\0";

/// Finds the JSON and the BIN chunk. The JSON is not parsed.
pub(super) fn split<'a>(source: Source<'_>, bytes: &'a [u8]) -> Result<Parts<'a>, SceneError> {
    if bytes.starts_with(MAGIC) {
        return split_glb(bytes).map_err(|reason| not_gltf(source, reason));
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match text.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'{') => Ok(Parts {
            json: text,
            bin: None,
        }),
        Some(_) => Err(not_gltf(
            source,
            "it starts neither with `glTF` (.glb) nor with `{` (.gltf)",
        )),
        None => Err(not_gltf(source, "it is empty")),
    }
}

pub(super) fn not_gltf(source: Source<'_>, reason: impl Into<String>) -> SceneError {
    SceneError::NotGltf {
        file: source.label(),
        reason: reason.into(),
    }
}

fn split_glb(bytes: &[u8]) -> Result<Parts<'_>, String> {
    let word = |at: usize| -> Option<u32> {
        let four = bytes.get(at..at.checked_add(4)?)?;
        four.try_into().ok().map(u32::from_le_bytes)
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(format!(
            "the .glb header is cut off after {} bytes",
            bytes.len()
        ));
    };
    if version != 2 {
        return Err(format!("the .glb header says version {version}, not 2"));
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(format!(
            "the .glb is truncated: its header says {length} bytes, the file has {}",
            bytes.len()
        ));
    }
    let mut chunks = Vec::new();
    let mut at = 12;
    // Chunks after the second are for extensions; the format says to skip them.
    while at < length && chunks.len() < 2 {
        let (Some(size), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) else {
            return Err(format!("the .glb chunk at byte {at} is cut off"));
        };
        let (start, size) = (at + 8, size as usize);
        let data = (start.checked_add(size))
            .filter(|&end| end <= length)
            .and_then(|end| bytes.get(start..end))
            .ok_or_else(|| {
                format!("the .glb chunk at byte {at} says {size} bytes, more than are left")
            })?;
        chunks.push((kind, data));
        at = (start + size).next_multiple_of(4);
    }
    let mut chunks = chunks.into_iter();
    match (chunks.next(), chunks.next()) {
        (Some((CHUNK_JSON, json)), second) => Ok(Parts {
            json,
            bin: second
                .filter(|(kind, _)| *kind == CHUNK_BIN)
                .map(|(_, bin)| bin),
        }),
        _ => Err("the first chunk of the .glb is not JSON".into()),
    }
}
