//! What can be wrong with a scene.

use std::path::PathBuf;

use crate::light::LightError;

/// A scene that cannot be read or used. Each message is one line and starts with the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file cannot be read.
    #[error("{}: cannot read the scene: {source}", file.display())]
    Read {
        /// The scene file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not glTF 2.0.
    #[error("{file}: not a glTF 2.0 file: {reason}")]
    NotGltf {
        /// The scene file.
        file: String,
        /// What is there instead.
        reason: String,
    },
    /// The JSON of the file cannot be read.
    #[cfg(feature = "cli")]
    #[error("{file}: invalid glTF JSON: {source}")]
    Json {
        /// The scene file.
        file: String,
        /// What and where.
        source: serde_json::Error,
    },
    /// A buffer cannot be read.
    #[error("{file}: {element}: cannot read its data `{uri}`: {source}")]
    Buffer {
        /// The scene file.
        file: String,
        /// The buffer.
        element: String,
        /// Where the data should be, shortened.
        uri: String,
        /// Why.
        source: std::io::Error,
    },
    /// An element of the file contradicts the format or another element.
    #[error("{file}: {element}: {reason}")]
    Invalid {
        /// The scene file, or the scene's name.
        file: String,
        /// For instance ``node 3 `lamp` ``.
        element: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The file uses something that this program does not support.
    #[error("{file}: {element}: {what} is not supported; {remedy}")]
    Unsupported {
        /// The scene file.
        file: String,
        /// Where it is used.
        element: String,
        /// What is used.
        what: String,
        /// What to do about it.
        remedy: &'static str,
    },
    /// More geometry than allowed.
    #[error("{file}: {element}: more than {limit} vertices or indices; split the scene")]
    TooLarge {
        /// The scene file.
        file: String,
        /// The element that went over the limit.
        element: String,
        /// The limit.
        limit: u64,
    },
    /// A light that cannot be, or an override that does not fit it.
    #[error("{file}: light `{light}`: {source}")]
    Light {
        /// The scene file, or the scene's name.
        file: String,
        /// The light's name.
        light: String,
        /// What is wrong with it.
        source: LightError,
    },
    /// An override that fits no light of the scene.
    #[error("{file}: {option} fits no light of the scene; it has {have}")]
    OverrideUnused {
        /// The scene file, or the scene's name.
        file: String,
        /// The option as written on the command line.
        option: &'static str,
        /// The lights there are.
        have: String,
    },
    /// Nothing to render.
    #[error("{file}: no triangles in the scene; nothing could be seen or cast a shadow")]
    NoTriangles {
        /// The scene file, or the scene's name.
        file: String,
    },
    /// A light is needed and there is none.
    #[error(
        "{file}: no light in the scene; add a node with KHR_lights_punctual or EXT_lights_area"
    )]
    NoLight {
        /// The scene file, or the scene's name.
        file: String,
    },
    /// A camera is asked for and there is none.
    #[error("{file}: no camera in the scene; leave --camera out to frame the whole scene")]
    NoCamera {
        /// The scene file, or the scene's name.
        file: String,
    },
    /// No such light or camera.
    #[error("{file}: no {kind} `{asked}`; the scene has {have}")]
    NotFound {
        /// The scene file, or the scene's name.
        file: String,
        /// `light` or `camera`.
        kind: &'static str,
        /// The name or index asked for.
        asked: String,
        /// Those there are.
        have: String,
    },
    /// Several lights or cameras of that name.
    #[error("{file}: {kind} `{asked}` is ambiguous; use an index: {have}")]
    Ambiguous {
        /// The scene file, or the scene's name.
        file: String,
        /// `light` or `camera`.
        kind: &'static str,
        /// The name asked for.
        asked: String,
        /// Those of that name.
        have: String,
    },
}

/// `` `name` `` after `kind` and `index`, short and on one line.
pub(super) fn element(kind: &str, index: usize, name: &str) -> String {
    match name {
        "" => format!("{kind} {index}"),
        name => format!("{kind} {index} `{}`", shorten(name)),
    }
}

/// At most 60 characters of `text`, none of them a control character.
pub(super) fn shorten(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short: String = (text.chars().take(LONGEST))
        .map(|c| if c.is_control() { '?' } else { c })
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push_str("...");
    }
    short
}
