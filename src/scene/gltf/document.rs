//! The JSON: parsed and validated by the `gltf` crate, plus what that crate does not keep.

use std::collections::BTreeMap;

use gltf::Document;
use gltf::json::validation::{Checked, Validate};
use gltf::json::{self, Root};
use serde::Deserialize;
use serde_json::Value;

use super::{SceneError, Source, container, shorten};

/// Parts of the JSON that the `gltf` crate drops (EXT_lights_area) or rounds to `f32` (transforms).
#[derive(Debug, Default, Deserialize)]
pub(super) struct Side {
    #[serde(default)]
    pub(super) nodes: Vec<SideNode>,
    pub(super) extensions: Option<RootExtensions>,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct SideNode {
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) extensions: Option<NodeExtensions>,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_lights_area")]
    pub(super) area_light: Option<AreaLightReference>,
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
}

/// Copies of a node's mesh.
#[derive(Debug, Deserialize)]
pub(super) struct Instancing {
    /// From TRANSLATION, ROTATION and SCALE to accessors.
    #[serde(default)]
    pub(super) attributes: BTreeMap<String, Value>,
}

#[derive(Debug, Deserialize)]
pub(super) struct AreaLightReference {
    pub(super) light: usize,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct RootExtensions {
    #[serde(rename = "EXT_lights_area")]
    pub(super) area_lights: Option<AreaLights>,
}

#[derive(Debug, Deserialize)]
pub(super) struct AreaLights {
    #[serde(default)]
    pub(super) lights: Vec<AreaLightJson>,
}

/// A light of the EXT_lights_area draft.
#[derive(Debug, Deserialize)]
pub(super) struct AreaLightJson {
    pub(super) name: Option<String>,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) color: Option<[f32; 3]>,
    /// Nits.
    pub(super) intensity: Option<f32>,
    /// Height of a rectangle, diameter of a disk, before the node's scale.
    pub(super) size: Option<f64>,
    pub(super) rect: Option<AreaLightRect>,
}

#[derive(Debug, Deserialize)]
pub(super) struct AreaLightRect {
    /// Width over height.
    pub(super) aspect: Option<f64>,
}

/// Parses and validates.
pub(super) fn parse(source: Source<'_>, text: &[u8]) -> Result<(Document, Side), SceneError> {
    let json_error = |error| SceneError::Json {
        file: source.label(),
        source: error,
    };
    check_version(source, text).map_err(json_error)??;
    let mut root = parse_root(source, text).map_err(json_error)?;
    let side: Side = json::deserialize::from_slice(text).map_err(json_error)?;
    check_required_extensions(source, &mut root)?;
    check_position_accessors(source, &root)?;
    validate(source, &root)?;
    Ok((Document::from_json_without_validation(root), side))
}

/// Without the animation channels that move no node (KHR_animation_pointer, or nothing at all),
/// which the format allows and the `gltf` crate does not.
fn parse_root(source: Source<'_>, text: &[u8]) -> Result<Root, json::Error> {
    let error = match json::deserialize::from_slice(text) {
        Ok(root) => return Ok(root),
        Err(error) => error,
    };
    let mut value: Value = json::deserialize::from_slice(text)?;
    let animations = value.get_mut("animations").and_then(Value::as_array_mut);
    let mut left_out = 0;
    for animation in animations.into_iter().flatten() {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            let all = channels.len();
            channels.retain(|channel| {
                let target = channel.get("target");
                target.is_none_or(|target| target.get("node").is_some())
            });
            left_out += all - channels.len();
        }
    }
    // The error that names line and column.
    if left_out == 0 {
        return Err(error);
    }
    let label = source.label();
    log::warn!("{label}: {left_out} animation channels that move no node are left out");
    json::deserialize::from_slice(value.to_string().as_bytes())
}

/// Older and newer files have other types in the same places, which would make obscure messages.
fn check_version(source: Source<'_>, text: &[u8]) -> Result<Result<(), SceneError>, json::Error> {
    #[derive(Deserialize)]
    struct Head {
        asset: Option<Asset>,
    }
    #[derive(Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Asset {
        version: Option<String>,
        min_version: Option<String>,
    }
    let head: Head = json::deserialize::from_slice(text)?;
    let reason = match head.asset {
        None => "its JSON has no `asset`".into(),
        Some(asset) => match asset.min_version.or(asset.version) {
            None => "its `asset` has no `version`".into(),
            Some(version) if version == "2.0" => return Ok(Ok(())),
            // A minor version of 2 stays readable unless minVersion says otherwise.
            Some(version) if version.starts_with("2.") => {
                log::warn!("{}: glTF {version}, read as 2.0", source.label());
                return Ok(Ok(()));
            }
            Some(version) => format!("it is version {}", shorten(&version)),
        },
    };
    Ok(Err(container::not_gltf(source, reason)))
}

/// Refuses what cannot be rendered rightly, and takes the names of all others out, because the
/// `gltf` crate would refuse those that it does not know itself.
fn check_required_extensions(source: Source<'_>, root: &mut Root) -> Result<(), SceneError> {
    const KNOWN: [&str; 6] = [
        "EXT_lights_area",
        "EXT_mesh_gpu_instancing",
        "KHR_lights_punctual",
        "KHR_mesh_quantization",
        "KHR_xmp_json_ld",
        "KHR_texture_transform",
    ];
    let known = |name: &str| KNOWN.contains(&name) || name.starts_with("KHR_materials_");
    if let Some(name) = root.extensions_required.iter().find(|name| !known(name)) {
        return Err(SceneError::Unsupported {
            file: source.label(),
            element: "extensionsRequired".into(),
            what: shorten(name),
            remedy: if name.contains("draco") || name.contains("meshopt") {
                "export the file without mesh compression"
            } else {
                "export the file without it"
            },
        });
    }
    root.extensions_required.clear();
    Ok(())
}

/// The validation of the `gltf` crate indexes with this one before it has checked it.
fn check_position_accessors(source: Source<'_>, root: &Root) -> Result<(), SceneError> {
    for (mesh, json) in root.meshes.iter().enumerate() {
        for (primitive, json) in json.primitives.iter().enumerate() {
            let semantic = Checked::Valid(json::mesh::Semantic::Positions);
            let position = json.attributes.get(&semantic);
            if let Some(accessor) = position.filter(|index| index.value() >= root.accessors.len()) {
                return Err(source.invalid(
                    format!("mesh {mesh}, primitive {primitive}"),
                    format!(
                        "POSITION names accessor {}, which is missing",
                        accessor.value()
                    ),
                ));
            }
        }
    }
    Ok(())
}

fn validate(source: Source<'_>, root: &Root) -> Result<(), SceneError> {
    let mut first = None;
    let mut more = 0u32;
    root.validate(root, json::Path::new, &mut |path, error| {
        let path = path().to_string();
        // The format asks for the bounds of POSITION; nothing here depends on them.
        if path.ends_with(".min") || path.ends_with(".max") {
            return;
        }
        if first.is_none() {
            first = Some((path, error));
        } else {
            more += 1;
        }
    });
    match first {
        None => Ok(()),
        Some((path, error)) => {
            let mut reason = error.to_string().to_lowercase();
            if more > 0 {
                reason.push_str(&format!(" (and {more} more such errors)"));
            }
            Err(source.invalid(shorten(&path), reason))
        }
    }
}
