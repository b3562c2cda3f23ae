//! The bytes of buffers: BIN chunk, data URI, or a file beside the scene.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Component, Path, PathBuf};

use base64::Engine as _;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::Document;

use super::{SceneError, Source, element, shorten};

/// Reads every buffer; each holds at least as many bytes as it declares.
pub(super) fn load<'a>(
    source: Source<'_>,
    document: &Document,
    bin: Option<&'a [u8]>,
) -> Result<Vec<Cow<'a, [u8]>>, SceneError> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let index = buffer.index();
        let element = element("buffer", index, buffer.name());
        let length = buffer.length();
        let data = match (buffer.source(), bin) {
            (gltf::buffer::Source::Uri(uri), _) => {
                let data = read_uri(source.path, uri, length as u64);
                Cow::Owned(data.map_err(|error| SceneError::Buffer {
                    file: source.label(),
                    element: element.clone(),
                    uri: shorten(uri),
                    source: error,
                })?)
            }
            (gltf::buffer::Source::Bin, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (gltf::buffer::Source::Bin, _) => {
                let reason = "it has no `uri`, and the file has no BIN chunk for it";
                return Err(source.invalid(element, reason));
            }
        };
        if data.len() < length {
            let reason = format!("it declares {length} bytes and has {}", data.len());
            return Err(source.invalid(element, reason));
        }
        buffers.push(data);
    }
    Ok(buffers)
}

/// The bytes behind `uri`; of a file at most `length`.
pub(super) fn read_uri(scene: &Path, uri: &str, length: u64) -> io::Result<Vec<u8>> {
    if let Some(data) = uri.strip_prefix("data:") {
        return decode_data_uri(data);
    }
    let path = scene.with_file_name("").join(relative_path(uri)?);
    let file = File::open(&path)?;
    // A pipe or a device could be without end.
    if !file.metadata()?.is_file() {
        return Err(invalid("not a regular file"));
    }
    let mut data = Vec::new();
    file.take(length).read_to_end(&mut data)?;
    Ok(data)
}

/// `[media type][;base64],data`
fn decode_data_uri(uri: &str) -> io::Result<Vec<u8>> {
    let (head, data) = (uri.split_once(',')).ok_or_else(|| invalid("data URI without a comma"))?;
    if !head.ends_with(";base64") {
        return Ok(percent_decode(data));
    }
    let config =
        GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    GeneralPurpose::new(&base64::alphabet::STANDARD, config)
        .decode(data)
        .map_err(|error| invalid(&format!("invalid base64: {error}")))
}

/// A path that stays in the folder of the scene: a scene that someone sent must not be able to name
/// any file of this machine.
fn relative_path(uri: &str) -> io::Result<PathBuf> {
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    let is_scheme = |s: &str| {
        s.chars()
            .all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    };
    if scheme.is_some_and(is_scheme) {
        return Err(invalid("only data URIs and relative paths are read"));
    }
    let path = String::from_utf8(percent_decode(uri))
        .map(PathBuf::from)
        .map_err(|_| invalid("the decoded path is not UTF-8"))?;
    let inside = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    if path.as_os_str().is_empty() || !path.components().all(inside) {
        return Err(invalid(
            "the path leaves the folder of the scene; put the data beside the scene file",
        ));
    }
    Ok(path)
}

fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let hex = |at: usize| -> Option<u8> {
        let digit = char::from(*bytes.get(at)?).to_digit(16)?;
        u8::try_from(digit).ok()
    };
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        match (byte, hex(at + 1), hex(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push(16 * high + low);
                at += 3;
            }
            _ => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    decoded
}

fn invalid(reason: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, reason)
}
