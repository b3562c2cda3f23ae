//! What is hard, family by family.

use glam::Vec3;

use super::Case;
use super::cases::{SHAPES, lamp, usual_camera, usual_floor};
use super::mesh::{Mesh, Soup, Stage, ball, camera, cuboid, floor, patch, quad, turned_over};
use crate::light::{AreaLight, LightShape};

const DISK: LightShape = SHAPES[1];
const RECT: LightShape = SHAPES[2];
const SPHERE: LightShape = SHAPES[3];
const LINE: LightShape = SHAPES[4];
const SUN: LightShape = SHAPES[5];

fn block() -> Soup {
    cuboid(vec3(-0.6, 0.3, -0.45), vec3(0.5, 0.8, 0.2))
}

fn vec3(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

fn expect(mut case: Case, visibility: f32) -> Case {
    case.expected = Some(visibility);
    case
}

/// Where shadows fall.
pub(super) fn receivers() -> Vec<Case> {
    let low = AreaLight::new(RECT, vec3(-3.5, 0.3, 0.0), Vec3::X, Vec3::Z);
    let evening = AreaLight::new(SUN, Vec3::ZERO, vec3(1.0, -0.13, 0.1), Vec3::Z);
    let hill: Soup = (0..12)
        .flat_map(|i| {
            let (x, slope) = (0.5 * i as f32 - 3.0, 0.02 * i as f32);
            let (a, b) = (vec3(x, 0.0, -2.0), vec3(x + 0.5, slope, -2.0));
            quad([a, a + 4.0 * Vec3::Z, b + 4.0 * Vec3::Z, b])
        })
        .collect();
    vec![
        expect(
            Stage::new()
                .flat("triangle", &usual_floor()[..1].to_vec())
                .case(
                    "one-triangle",
                    "a scene of a single triangle, which nothing shadows",
                    usual_camera(),
                    lamp(DISK),
                ),
            1.0,
        ),
        expect(
            Stage::new()
                .flat("floor", &usual_floor())
                .flat(
                    "behind",
                    &cuboid(vec3(-1.0, -2.0, -1.0), vec3(1.0, -0.5, 1.0)),
                )
                .flat("above", &floor(vec3(0.4, 6.0, 0.0), 2.0, 2.0))
                .case(
                    "nothing-between",
                    "blockers below the floor and beyond the light, none between them",
                    usual_camera(),
                    lamp(SPHERE),
                ),
            1.0,
        ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("box", &cuboid(vec3(-0.6, 0.0, -0.4), vec3(0.2, 0.9, 0.4)))
            .smooth("ball", &ball(vec3(0.9, 0.4, 0.2), 0.4, 12))
            .case(
                "touching",
                "blockers that stand on the receiver",
                usual_camera(),
                lamp(DISK),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("box", &cuboid(vec3(-0.5, -0.4, -0.3), vec3(0.4, 0.6, 0.4)))
            .flat(
                "fin",
                &patch(
                    vec3(1.0, 0.0, 0.0),
                    vec3(0.3, 0.2, 0.0),
                    vec3(0.0, 0.1, 0.5),
                ),
            )
            .case(
                "through-the-floor",
                "blockers that cut through the receiver and leave it on both sides",
                usual_camera(),
                lamp(LINE),
            ),
        Stage::new().flat("hill", &hill).flat("box", &block()).case(
            "grazing",
            "receivers nearly edge-on to a low light",
            usual_camera(),
            low,
        ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("post", &cuboid(vec3(-1.0, 0.0, -0.1), vec3(-0.8, 0.5, 0.1)))
            .case(
                "evening-sun",
                "a sun whose disk touches the receiver's horizon",
                usual_camera(),
                evening,
            ),
    ]
}

/// Lights with a plane.
pub(super) fn flat_lights() -> Vec<Case> {
    let at_half_height = |shape| AreaLight::new(shape, vec3(0.2, 1.2, 0.3), Vec3::NEG_Y, Vec3::X);
    vec![
        Stage::new()
            .flat("floor", &usual_floor())
            .flat(
                "pillar",
                &cuboid(vec3(-0.8, 0.0, -0.6), vec3(-0.5, 2.5, -0.3)),
            )
            .flat(
                "blade",
                &patch(
                    vec3(1.2, 1.2, 0.0),
                    vec3(0.2, 1.0, 0.1),
                    vec3(0.0, 0.1, 0.5),
                ),
            )
            .case(
                "light-plane-cuts",
                "blockers on both sides of the light's plane, with edges through it",
                usual_camera(),
                at_half_height(DISK),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("lid", &floor(vec3(0.9, 1.2, 0.3), 0.4, 0.6))
            .flat("shelf", &floor(vec3(-0.6, 0.6, 0.3), 0.4, 0.3))
            .case(
                "in-the-light-plane",
                "a blocker in the light's own plane, beside it",
                usual_camera(),
                at_half_height(RECT),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat(
                "sheet",
                &patch(vec3(0.2, 1.25, 0.3), 0.5 * Vec3::X, vec3(0.0, 0.2, 0.5)),
            )
            .case(
                "through-the-light",
                "a blocker that cuts through the light itself",
                usual_camera(),
                at_half_height(SPHERE),
            ),
    ]
}

/// Edges in special places.
pub(super) fn edges() -> Vec<Case> {
    let slats = (0..7).flat_map(|i| floor(vec3(0.0, 0.8, 0.3 * i as f32 - 0.9), 1.0, 0.09));
    let wires = (0..9).flat_map(|i| {
        let x = 0.25 * i as f32 - 1.0;
        let width = 1.0e-4 * 2.0_f32.powi(i);
        patch(
            vec3(x, 0.7, 0.0),
            vec3(0.5 * width, 0.0, 0.0),
            vec3(0.1, 0.0, -0.8),
        )
    });
    let straight = AreaLight::new(RECT, vec3(0.0, 4.0, 0.0), Vec3::NEG_Y, Vec3::X);
    let over_pole = AreaLight::new(DISK, vec3(0.0, 3.0, 0.0), Vec3::NEG_Y, Vec3::X);
    let rays = (0..6).flat_map(|i| {
        // Each board holds a line through the light's centre.
        let (z, x) = (std::f32::consts::FRAC_PI_3 * i as f32).sin_cos();
        let foot = vec3(1.2 * x, 0.0, 1.2 * z);
        let along = (vec3(0.0, 3.0, 0.0) - foot) * 0.15;
        patch(foot + 1.6 * along, along, vec3(-0.12 * z, 0.0, 0.12 * x))
    });
    vec![
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("slats", &slats.collect())
            .case(
                "edges-parallel",
                "edges parallel to the light's plane and to its sides",
                usual_camera(),
                straight,
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("pole", &cuboid(vec3(-0.1, 0.0, -0.1), vec3(0.1, 1.0, 0.1)))
            .flat(
                "fin",
                &quad([
                    vec3(0.0, 0.0, 0.0),
                    vec3(0.8, 0.0, 0.3),
                    vec3(0.8, 0.7, 0.3),
                    vec3(0.0, 1.4, 0.0),
                ]),
            )
            .flat("rays", &rays.collect())
            .case(
                "edges-through-light",
                "edges whose lines meet the light, at its centre and elsewhere",
                usual_camera(),
                over_pole,
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("wires", &wires.collect())
            .case(
                "wires",
                "blockers from 0.1 mm, far thinner than a texel of any map, to 2.6 cm",
                usual_camera(),
                lamp(SPHERE),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("box", &block())
            .case(
                "box-under-a-point",
                "a light without size",
                usual_camera(),
                lamp(LightShape::Point),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("box", &block())
            .case(
                "box-in-the-sun",
                "a sun, whose rays are the same everywhere",
                usual_camera(),
                AreaLight::new(SUN, Vec3::ZERO, vec3(-0.4, -1.0, 0.3), Vec3::X),
            ),
    ]
}

/// Triangles in one plane.
pub(super) fn coplanar() -> Vec<Case> {
    let lid = floor(vec3(0.0, 0.6, 0.0), 0.6, 0.5);
    let shifted: Soup = floor(vec3(0.3, 0.6, 0.2), 0.6, 0.5);
    vec![
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("lid", &lid)
            .flat("the same lid", &lid)
            .flat("its back", &turned_over(&lid))
            .flat("the same floor", &usual_floor())
            .case(
                "duplicates",
                "every triangle two or three times, from both sides",
                usual_camera(),
                lamp(SPHERE),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("decal", &floor(vec3(0.2, 0.0, 0.4), 0.7, 0.3))
            .flat("lid", &lid)
            .flat("another lid", &shifted)
            .case(
                "coplanar",
                "overlapping triangles in one plane, in blocker and receiver",
                usual_camera(),
                lamp(RECT),
            ),
    ]
}

/// Triangles without area, or nearly.
pub(super) fn degenerate() -> Vec<Case> {
    let at = vec3(0.3, 1.0, 0.2);
    let mut soup = block();
    soup.extend([
        [at, at, at],
        [at, at, at + Vec3::X],
        [at, at + Vec3::X, at + 0.5 * Vec3::X],
        [at, at + vec3(1.0, 0.0, 1.0e-20), at + vec3(2.0, 0.0, 0.0)],
        // The last has an area: 1e-10 m2.
        [at, at + 1.0e-5 * Vec3::X, at + 1.0e-5 * Vec3::Z],
    ]);
    vec![
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("box and less", &soup)
            .case(
                "no-area",
                "triangles that are points or segments among others",
                usual_camera(),
                lamp(LINE),
            ),
    ]
}

/// Meshes that are no closed, orderly surfaces.
pub(super) fn odd_meshes() -> Vec<Case> {
    let open: Soup = block().into_iter().skip(4).collect();
    let mut pages = Mesh {
        positions: vec![vec3(0.0, 0.2, -0.6), vec3(0.0, 0.9, 0.6)],
        ..Mesh::default()
    };
    for page in 0..5 {
        let (y, x) = (0.4 + 0.6 * page as f32).sin_cos();
        let first = pages.positions.len() as u32;
        let out = vec3(0.9 * x, 0.5 * y, 0.0);
        let outer = [pages.positions[0] + out, pages.positions[1] + out];
        pages.positions.extend(outer);
        pages.faces.push([0, first, first + 1]);
        pages.faces.push([0, first + 1, 1]);
    }
    // A long edge against two short ones: a vertex in the middle of an edge.
    let joined: Soup = vec![
        [
            vec3(-1.0, 0.7, 0.0),
            vec3(1.0, 0.7, 0.0),
            vec3(0.0, 0.7, -0.7),
        ],
        [
            vec3(-1.0, 0.7, 0.0),
            vec3(-0.2, 0.7, 0.6),
            vec3(0.1, 0.7, 0.0),
        ],
        [
            vec3(0.1, 0.7, 0.0),
            vec3(-0.2, 0.7, 0.6),
            vec3(1.0, 0.7, 0.0),
        ],
    ];
    let mirrored = ball(vec3(0.1, 0.7, 0.0), 0.5, 12);
    let mirrored = Mesh {
        positions: (mirrored.positions.iter())
            .map(|p| vec3(-p.x, p.y, 1.3 * p.z))
            .collect(),
        ..mirrored
    };
    vec![
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("open box", &open)
            .case(
                "open",
                "a box without two of its sides",
                usual_camera(),
                lamp(RECT),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .smooth("pages", &pages)
            .case(
                "non-manifold",
                "five sheets that share one edge",
                usual_camera(),
                lamp(DISK),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("sheet", &joined)
            .case(
                "t-junction",
                "a corner of two triangles in the middle of another one's edge",
                usual_camera(),
                lamp(LINE),
            ),
        Stage::new()
            .flat("floor", &turned_over(&usual_floor()))
            .flat("box", &turned_over(&block()))
            .case(
                "inside-out",
                "all triangles seen from behind",
                usual_camera(),
                lamp(DISK),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .smooth("ball", &mirrored)
            .case(
                "mirrored",
                "a mesh under a mirroring, stretching transform: winding against normals",
                usual_camera(),
                lamp(SPHERE),
            ),
    ]
}

/// Meshes with the light inside.
pub(super) fn around_the_light() -> Vec<Case> {
    let inside = |shape| AreaLight::new(shape, vec3(0.2, 1.5, 0.1), Vec3::NEG_Y, Vec3::X);
    let shell = ball(vec3(0.2, 1.5, 0.1), 0.6, 10);
    let mut cage = shell.clone();
    let mut number = 0;
    cage.faces.retain(|_| {
        number += 1;
        number % 3 != 0
    });
    vec![
        expect(
            Stage::new()
                .flat("floor", &usual_floor())
                .smooth("shell", &shell)
                .case(
                    "shut-in",
                    "a light inside a closed mesh: dark outside",
                    camera(vec3(0.3, 2.6, 4.6), vec3(0.0, -0.8, 0.0), 0.5),
                    inside(SPHERE),
                ),
            0.0,
        ),
        Stage::new()
            .flat("floor", &usual_floor())
            .smooth("cage", &cage)
            .case(
                "cage",
                "a light inside a mesh with holes",
                usual_camera(),
                inside(LINE),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat(
                "shade",
                &cuboid(vec3(-0.1, 1.49, -0.2), vec3(0.5, 2.0, 0.4))[..4].to_vec(),
            )
            .flat("lid", &floor(vec3(0.2, 1.499, 0.1), 0.3, 0.3))
            .case(
                "close-by",
                "a blocker a millimetre from the light",
                usual_camera(),
                inside(RECT),
            ),
    ]
}

/// Closed rooms, seen and lit from inside.
pub(super) fn lit_rooms() -> Vec<Case> {
    let room = turned_over(&cuboid(vec3(-2.0, 0.0, -2.5), vec3(2.0, 3.0, 2.5)));
    let eye = camera(vec3(1.2, 1.8, 2.0), vec3(-0.6, 0.6, -1.0), 1.2);
    let small = |shape| AreaLight::new(shape, vec3(0.1, 1.6, -0.2), Vec3::NEG_Y, Vec3::X);
    vec![
        expect(
            Stage::new().flat("room", &room).case(
                "empty-room",
                "a closed room around light and camera: nothing but its own walls",
                eye.clone(),
                small(LightShape::Sphere { radius: 0.1 }),
            ),
            1.0,
        ),
        Stage::new()
            .flat("room", &room)
            .flat(
                "stool",
                &cuboid(vec3(-0.7, 0.0, -1.0), vec3(-0.2, 0.5, -0.5)),
            )
            .flat("beam", &cuboid(vec3(-1.2, 1.7, -2.0), vec3(-1.0, 1.9, 1.0)))
            .case(
                "furnished-room",
                "a light that looks all round, and shadows on every wall",
                eye,
                small(LightShape::Line { length: 0.5 }),
            ),
    ]
}

/// Thin and tiny triangles.
pub(super) fn needles() -> Vec<Case> {
    let fan: Soup = (0..40)
        .map(|i| {
            let (z, x) = (0.157 * i as f32).sin_cos();
            let tip = vec3(1.1 * x, 0.6 + 0.2 * z, 1.1 * z);
            let (a, b) = (vec3(0.0, 0.7, 0.0), vec3(0.002 * z, 0.7, 0.002 * x));
            [a, b, tip]
        })
        .collect();
    // A simple generator of pseudo-random numbers (Numerical Recipes' quick one).
    let mut state = 12_345_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32 * 2.0 - 1.0
    };
    let confetti: Soup = (0..400)
        .map(|_| {
            let at = vec3(1.2 * random(), 0.7 + 0.4 * random(), 1.2 * random());
            let mut corner = || at + 0.06 * vec3(random(), random(), random());
            [corner(), corner(), corner()]
        })
        .collect();
    vec![
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("needles", &fan)
            .case(
                "needles",
                "triangles 500 times as long as wide",
                usual_camera(),
                lamp(DISK),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("confetti", &confetti)
            .case(
                "confetti",
                "loose triangles at all angles",
                usual_camera(),
                lamp(SPHERE),
            ),
    ]
}

/// Sizes far apart.
pub(super) fn small_and_large() -> Vec<Case> {
    let tiny = cuboid(vec3(-0.01, 0.003, -0.01), vec3(0.01, 0.012, 0.01));
    vec![
        Stage::new()
            .flat("plain", &floor(Vec3::ZERO, 2000.0, 2000.0))
            .flat("tiny", &tiny)
            .flat(
                "tower",
                &cuboid(vec3(-30.0, 0.0, -90.0), vec3(-10.0, 60.0, -70.0)),
            )
            .case(
                "far-and-near",
                "a centimetre and kilometres in one picture",
                camera(vec3(0.02, 0.05, 0.08), vec3(0.0, 0.022, -0.02), 0.9),
                AreaLight::new(
                    LightShape::Sun {
                        angular_diameter: 0.05,
                    },
                    Vec3::ZERO,
                    vec3(-0.5, -1.0, -0.3),
                    Vec3::X,
                ),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("box", &block())
            .case(
                "light-of-a-micrometre",
                "an area light of hardly any size",
                usual_camera(),
                lamp(LightShape::Disk { radius: 1.0e-6 }),
            ),
        Stage::new()
            .flat("floor", &usual_floor())
            .flat("box", &block())
            .case(
                "light-larger-than-the-scene",
                "a light of 12 m over a floor of 8 m",
                usual_camera(),
                lamp(LightShape::Rect {
                    width: 12.0,
                    height: 12.0,
                }),
            ),
    ]
}
