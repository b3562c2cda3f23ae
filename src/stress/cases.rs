//! The cases.

use glam::Vec3;

use super::mesh::{Stage, camera, cuboid, floor, patch, waves};
use super::shapes::{
    around_the_light, coplanar, degenerate, edges, flat_lights, lit_rooms, needles, odd_meshes,
    receivers, small_and_large,
};
use super::{Case, mesh};
use crate::light::{AreaLight, LightShape};
use crate::scene::SceneCamera;

/// Cases with [`Case::fine`].
const FINE: [&str; 6] = [
    "edges-through-light",
    "wires",
    "close-by",
    "needles",
    "confetti",
    "far-and-near",
];

/// All cases, each small enough to be drawn in milliseconds.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    cases.extend(receivers());
    cases.extend(flat_lights());
    cases.extend(edges());
    cases.extend(coplanar());
    cases.extend(degenerate());
    cases.extend(odd_meshes());
    cases.extend(around_the_light());
    cases.extend(lit_rooms());
    cases.extend(needles());
    cases.extend(small_and_large());
    for case in &mut cases {
        case.fine = FINE.contains(&case.name.as_str());
    }
    cases
}

/// The camera of most cases: nothing more than 1.1 m over the middle of the floor is in the picture.
pub(super) fn usual_camera() -> SceneCamera {
    camera(Vec3::new(0.3, 2.6, 4.6), Vec3::ZERO, 0.75)
}

/// A light above the middle that shines down, a little turned.
pub(super) fn lamp(shape: LightShape) -> AreaLight {
    AreaLight::new(
        shape,
        Vec3::new(0.4, 4.0, 0.3),
        Vec3::new(-0.05, -1.0, 0.03),
        Vec3::new(1.0, 0.0, 0.2),
    )
}

/// The usual floor.
pub(super) fn usual_floor() -> mesh::Soup {
    floor(Vec3::ZERO, 4.0, 4.0)
}

/// A shape of every kind, of a size that makes wide penumbrae.
pub(super) const SHAPES: [LightShape; 6] = [
    LightShape::Point,
    LightShape::Disk { radius: 0.4 },
    LightShape::Rect {
        width: 0.9,
        height: 0.5,
    },
    LightShape::Sphere { radius: 0.4 },
    LightShape::Line { length: 0.9 },
    LightShape::Sun {
        angular_diameter: 0.2,
    },
];

/// Scenes of which each has one blocker more than the one before: a floor under a light of this
/// shape, and up to five blockers over it.
///
/// Blockers hang out of the camera's sight, within the box around the first scene, and farther from
/// the light than the first scene's only one: what a shadow map is fitted to stays the same, and so
/// does every visible surface.
pub fn steps_of_blockers(shape: LightShape) -> Vec<Case> {
    let blockers = [
        mesh::flat(
            "board",
            &patch(
                Vec3::new(-0.4, 2.2, 0.1),
                Vec3::new(0.5, 0.1, 0.0),
                Vec3::new(0.0, 0.05, 0.3),
            ),
        ),
        mesh::smooth("ball", &mesh::ball(Vec3::new(0.5, 1.9, -0.4), 0.3, 10)),
        mesh::flat(
            "wire",
            &patch(
                Vec3::new(0.2, 2.5, 0.0),
                Vec3::new(0.9, 0.0, 0.2),
                Vec3::new(0.0, 0.0, 0.01),
            ),
        ),
        mesh::flat(
            "box",
            &cuboid(Vec3::new(-0.3, 1.7, -0.7), Vec3::new(0.1, 2.0, -0.4)),
        ),
    ];
    // Frames the box, and is the nearest to the light.
    let mut stage = Stage::new().flat("floor", &usual_floor()).flat(
        "plate",
        &patch(
            Vec3::new(0.9, 3.0, 0.3),
            Vec3::new(0.0, 0.0, -0.3),
            Vec3::new(0.3, 0.0, 0.0),
        ),
    );
    let mut cases = Vec::new();
    for blocker in [None].into_iter().chain(blockers.map(Some)) {
        if let Some(blocker) = blocker {
            stage = stage.add(blocker);
        }
        cases.push(stage.clone().case(
            "blockers",
            "one blocker more than the scene before",
            // Below all blockers, and looking down.
            camera(Vec3::new(0.3, 1.5, 2.9), Vec3::new(0.0, 0.0, 0.4), 0.75),
            lamp(shape),
        ));
    }
    cases
}

/// A scene of about as many triangles as asked for: a finely divided wavy sheet in folds narrower
/// than a pixel, with a board over it.
pub fn large(triangles: usize) -> Case {
    let side = ((triangles / 2) as f64).sqrt().round().max(1.0) as u32;
    Stage::new()
        .smooth("sheet", &waves(Vec3::ZERO, 3.5, 0.25, side))
        .flat(
            "board",
            &patch(
                Vec3::new(0.2, 1.0, 0.0),
                Vec3::new(0.0, 0.0, -0.6),
                Vec3::new(0.9, 0.1, 0.0),
            ),
        )
        .case(
            "large",
            "many triangles, most of them smaller than a texel of any map",
            usual_camera(),
            lamp(LightShape::Disk { radius: 0.4 }),
        )
}
