//! What can be told of a scene file without loading it: its size in triangles, for estimates, and
//! its content, for recognising it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::jobs::JobsError;
use crate::scene::SceneFile;

/// Of a glTF file, from its JSON alone. A file that is none has no facts: that it is broken shows
/// when it is loaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneFacts {
    /// Triangles of all nodes' meshes.
    pub triangles: u64,
    /// Nodes with a light.
    pub lights: u64,
    /// It has animations.
    pub is_animated: bool,
}

impl SceneFacts {
    /// Reads the file's JSON.
    pub fn read(path: &Path) -> Self {
        let facts = fs::read(path).ok().and_then(|bytes| {
            let json = SceneFile::json_of(path, &bytes).ok()?;
            Some(Self::of(&serde_json::from_slice(json).ok()?))
        });
        facts.unwrap_or_default()
    }

    fn of(json: &Value) -> Self {
        let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
        let accessors = list(&json["accessors"]);
        let count = |index: &Value| {
            let index = index.as_u64().and_then(|index| usize::try_from(index).ok());
            let accessor = index.and_then(|index| accessors.get(index));
            accessor.and_then(|accessor| accessor["count"].as_u64())
        };
        let mesh = |mesh: &Value| -> u64 {
            let primitives = list(&mesh["primitives"]).into_iter();
            let corners = primitives.filter_map(|primitive| {
                count(&primitive["indices"]).or_else(|| count(&primitive["attributes"]["POSITION"]))
            });
            corners
                .map(|corners| corners / 3)
                .fold(0, u64::saturating_add)
        };
        let meshes: Vec<u64> = list(&json["meshes"]).iter().map(mesh).collect();
        let mut facts = Self {
            is_animated: !list(&json["animations"]).is_empty(),
            ..Self::default()
        };
        for node in list(&json["nodes"]) {
            let index = node["mesh"]
                .as_u64()
                .and_then(|index| usize::try_from(index).ok());
            let triangles = index
                .and_then(|index| meshes.get(index))
                .copied()
                .unwrap_or(0);
            let extensions = &node["extensions"];
            let instances = &extensions["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"];
            let copies = count(instances).unwrap_or(1);
            facts.triangles = facts
                .triangles
                .saturating_add(triangles.saturating_mul(copies));
            let is_light = ["KHR_lights_punctual", "EXT_lights_area"]
                .iter()
                .any(|name| extensions[*name].is_object());
            facts.lights += u64::from(is_light);
        }
        facts
    }
}

/// SHA-256 of a scene file and of the files that it names, in that order.
///
/// # Errors
/// The file cannot be read. Of those it names, one that cannot be read counts as empty: that it is
/// missing shows when the scene is loaded.
pub fn digest(path: &Path) -> io::Result<String> {
    let bytes = fs::read(path)?;
    let mut hash = Sha256::new();
    let mut add = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    add(&bytes);
    let json = SceneFile::json_of(path, &bytes).ok();
    let json: Option<Value> = json.and_then(|json| serde_json::from_slice(json).ok());
    for kind in ["buffers", "images"] {
        let named = json.as_ref().and_then(|json| json[kind].as_array());
        for element in named.into_iter().flatten() {
            let uri = element["uri"]
                .as_str()
                .filter(|uri| !uri.starts_with("data:"));
            if let Some(uri) = uri {
                add(&SceneFile::read_named(path, uri).unwrap_or_default());
            }
        }
    }
    Ok(hex(&hash.finalize()))
}

/// In hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A file as it is; of a folder its glTF files by name.
///
/// # Errors
/// The folder cannot be read, or has none.
pub fn scenes_in(path: &Path) -> Result<Vec<PathBuf>, JobsError> {
    if !path.is_dir() {
        return Ok(vec![path.into()]);
    }
    let fault = |source| JobsError::Folder {
        path: path.into(),
        source,
    };
    let mut scenes = Vec::new();
    for entry in fs::read_dir(path).map_err(fault)? {
        let file = entry.map_err(fault)?.path();
        let ending = file.extension().and_then(|ending| ending.to_str());
        if matches!(ending, Some("glb" | "gltf")) {
            scenes.push(file);
        }
    }
    scenes.sort();
    match scenes.is_empty() {
        true => Err(JobsError::EmptyFolder { path: path.into() }),
        false => Ok(scenes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asset(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("assets")
            .join(name)
    }

    #[test]
    fn facts_are_those_of_the_loaded_scene() -> Result<(), Box<dyn std::error::Error>> {
        for name in [
            "sphere_over_plane.gltf",
            "sun_court.glb",
            "figure.glb",
            "lights.gltf",
        ] {
            let facts = SceneFacts::read(&asset(name));
            let scene = crate::scene::Scene::load(asset(name), &Default::default())?;
            assert_eq!(facts.triangles, scene.triangle_count() as u64, "{name}");
            assert_eq!(facts.lights, scene.lights.len() as u64, "{name}");
        }
        assert!(SceneFacts::read(&asset("figure.glb")).is_animated);
        assert!(!SceneFacts::read(&asset("sun_court.glb")).is_animated);
        assert_eq!(
            SceneFacts::read(&asset("sun_court.png")),
            SceneFacts::default()
        );
        Ok(())
    }

    #[test]
    fn named_files_are_part_of_the_content() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let scene = folder.path().join("a.gltf");
        fs::write(
            &scene,
            r#"{"buffers": [{"uri": "a%20b.bin"}], "images": [{"uri": "data:,x"}]}"#,
        )?;
        let at = |content: &str| -> io::Result<String> {
            fs::write(folder.path().join("a b.bin"), content)?;
            digest(&scene)
        };
        let (first, second) = (at("one")?, at("two")?);
        assert_eq!(first.len(), 64);
        assert_ne!(first, second);
        assert_eq!(first, at("one")?);
        Ok(())
    }
}
