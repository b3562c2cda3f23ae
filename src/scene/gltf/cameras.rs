//! Cameras, where their nodes are.

use gltf::Document;

use super::nodes::{self, PlacedNode};
use super::{Scene, SceneError, Source, element};
use crate::scene::SceneCamera;

/// Adds the perspective cameras of all nodes, in document order, and counts the others.
pub(super) fn add(
    scene: &mut Scene,
    source: Source<'_>,
    document: &Document,
    placed: &[PlacedNode],
) -> Result<(), SceneError> {
    let json = &document.as_json().cameras;
    let with_camera = placed
        .iter()
        .filter_map(|node| Some((node, json.get(node.camera?)?)));
    for (index, (node, camera)) in with_camera.enumerate() {
        let name = [node.name.as_deref(), camera.name.as_deref()]
            .into_iter()
            .flatten()
            .find(|name| !name.is_empty())
            .map_or_else(|| format!("camera {index}"), Into::into);
        let is_perspective = matches!(
            camera.type_,
            gltf::json::validation::Checked::Valid(gltf::json::camera::Type::Perspective)
        );
        if !is_perspective {
            scene.orthographic_cameras.push((index, name));
            continue;
        }
        let element = || element("camera", index, Some(&name));
        let Some(lens) = &camera.perspective else {
            return Err(source.invalid(element(), "its `perspective` is missing"));
        };
        let frame = nodes::frame(node.world.matrix3, nodes::Keep::Y);
        let camera = SceneCamera {
            node: Some(node.index),
            index,
            position: (node.world.translation - scene.rebase_origin).as_vec3(),
            right: frame.x_axis.as_vec3(),
            up: frame.y_axis.as_vec3(),
            forward: -frame.z_axis.as_vec3(),
            yfov: lens.yfov,
            znear: lens.znear,
            zfar: lens.zfar,
            name: name.clone(),
        };
        if let Some(fault) = camera.fault() {
            return Err(source.invalid(element(), fault));
        }
        scene.cameras.push(camera);
    }
    Ok(())
}
