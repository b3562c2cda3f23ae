//! .gltf and .glb files.

use super::document::Document;

/// A whole file: .glb, or .gltf with its buffer as base64.
pub fn bytes(document: &Document, binary: bool) -> Vec<u8> {
    if binary {
        glb(document)
    } else {
        let data = base64(&document.binary);
        let uri = format!(r#","uri":"data:application/octet-stream;base64,{data}""#);
        document.json(&uri).into_bytes()
    }
}

fn glb(document: &Document) -> Vec<u8> {
    let mut json = document.json("").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = &document.binary;
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let mut glb = b"glTF".to_vec();
    glb.extend(2u32.to_le_bytes());
    glb.extend((total as u32).to_le_bytes());
    for (kind, data) in [(b"JSON", &json), (b"BIN\0", binary)] {
        glb.extend((data.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(data);
    }
    glb
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= chunk.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    text
}
