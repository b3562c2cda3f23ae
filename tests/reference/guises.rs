//! The same scene cut, turned, mirrored, scaled and moved has the same shadows.

use antumbra::light::{AreaLight, LightShape};
use antumbra::reference::{Sampling, Truth};
use antumbra::scene::{LoadOptions, Scene, SceneCamera};
use glam::{DQuat, DVec3, EulerRot, Vec3};

use super::closed_forms::ball;
use super::{cast, ground, quad, scene};

const SIZE: [u32; 2] = [64, 52];

/// Triangles, light and camera, free to be changed before they become a scene.
#[derive(Clone)]
struct Set {
    triangles: Vec<[Vec3; 3]>,
    light: AreaLight,
    camera: SceneCamera,
}

impl Set {
    /// Blockers over a ground; all coordinates are multiples of 1/64, so that sums far away are
    /// exact.
    fn new(shape: LightShape) -> Self {
        let mut triangles = ground(4.0);
        triangles.extend(ball(Vec3::new(-0.5, 0.75, 0.25), 0.5, 8));
        triangles.extend(quad([
            Vec3::new(0.25, 0.25, -0.5),
            Vec3::new(1.5, 0.75, -0.5),
            Vec3::new(1.5, 1.0, 0.5),
            Vec3::new(0.25, 0.5, 0.5),
        ]));
        for corner in triangles.iter_mut().flatten() {
            *corner = (*corner * 64.0).round() / 64.0;
        }
        let light = AreaLight::new(
            shape,
            Vec3::new(0.5, 3.0, 0.25),
            Vec3::new(-0.1, -1.0, 0.0),
            Vec3::X,
        );
        let backward = Vec3::new(0.0, 0.75, 1.0).normalize();
        let camera = SceneCamera {
            position: Vec3::new(0.0, 2.5, 3.5),
            right: Vec3::X,
            up: backward.cross(Vec3::X),
            forward: -backward,
            yfov: 0.8,
            znear: 0.125,
            zfar: None,
            ..SceneCamera::framing(&antumbra::scene::Aabb::EMPTY)
        };
        Self {
            triangles,
            light,
            camera,
        }
    }

    /// Points by `point`, directions by `turn`, lengths by `scale`.
    fn moved(
        &self,
        point: impl Fn(DVec3) -> DVec3,
        turn: impl Fn(DVec3) -> DVec3,
        scale: f32,
    ) -> Self {
        let point = |p: Vec3| point(p.as_dvec3()).as_vec3();
        let turn = |v: Vec3| turn(v.as_dvec3()).as_vec3();
        let mut out = self.clone();
        for corner in out.triangles.iter_mut().flatten() {
            *corner = point(*corner);
        }
        let light = AreaLight::new(
            self.light.shape.scaled(if self.light.shape.is_sun() {
                1.0
            } else {
                scale
            }),
            point(self.light.center),
            turn(self.light.direction),
            turn(self.light.axis_x),
        );
        out.light = light;
        out.camera.position = point(self.camera.position);
        for axis in [
            &mut out.camera.right,
            &mut out.camera.up,
            &mut out.camera.forward,
        ] {
            *axis = turn(*axis);
        }
        out.camera.znear *= scale;
        out
    }

    fn cast(&self) -> Truth {
        let scene = scene(&self.triangles);
        cast(
            &scene,
            &self.camera,
            SIZE,
            &self.light,
            Sampling::samples(256),
        )
    }
}

/// Largest and root mean square difference over what is valid in both and partly lit in either, and
/// how many pixels that is.
fn difference(a: &Truth, b: &Truth) -> (f64, f64, usize) {
    let (mut max, mut squares, mut count) = (0.0_f64, 0.0, 0);
    for i in 0..a.visibility.len() {
        let [va, vb] = [a, b].map(|t| f64::from(t.visibility[i]));
        let partial = |v: f64| v > 0.0 && v < 1.0;
        if a.valid[i] && b.valid[i] && (partial(va) || partial(vb)) {
            max = max.max((va - vb).abs());
            squares += (va - vb).powi(2);
            count += 1;
        }
    }
    (max, (squares / count.max(1) as f64).sqrt(), count)
}

#[track_caller]
fn assert_same(what: &str, a: &Truth, b: &Truth) {
    let (max, rms, count) = difference(a, b);
    let error = a.standard_error.unwrap().rms;
    println!("{what:24} max {max:.1e}  rms {rms:.1e}  over {count}, standard error {error:.1e}");
    assert!(count > 200, "{what}: {count} pixels");
    // Two estimates differ by the root of two of their errors where samples are others.
    assert!(rms <= 1.5 * error, "{what}: rms {rms}");
    assert!(max <= 8.0 * error, "{what}: max {max}");
    let differ = a.valid.iter().zip(&b.valid).filter(|(a, b)| a != b).count();
    assert!(differ <= 4, "{what}: {differ} pixels are valid in one only");
}

const SHAPES: [LightShape; 3] = [
    LightShape::Disk { radius: 0.5 },
    LightShape::Sphere { radius: 0.4 },
    LightShape::Sun {
        angular_diameter: 0.4,
    },
];

#[test]
fn split_triangles() {
    for shape in SHAPES {
        let set = Set::new(shape);
        let mut split = set.clone();
        split.triangles.clear();
        for &[a, b, c] in &set.triangles {
            let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
            split
                .triangles
                .extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        assert_same("split", &set.cast(), &split.cast());
    }
}

#[test]
fn doubled_and_turned_over() {
    let set = Set::new(SHAPES[0]);
    let truth = set.cast();
    let mut doubled = set.clone();
    doubled.triangles.extend(set.triangles.clone());
    assert_eq!(doubled.cast().visibility, truth.visibility);
    let mut over = set;
    for [_, b, c] in &mut over.triangles {
        std::mem::swap(b, c);
    }
    assert_same("turned over", &truth, &over.cast());
}

#[test]
fn mirrored() {
    for shape in SHAPES {
        let set = Set::new(shape);
        let mirror = |v: DVec3| DVec3::new(-v.x, v.y, v.z);
        let mut mirrored = set.moved(mirror, mirror, 1.0);
        // The frame of a camera is right-handed: its picture comes out mirrored instead.
        mirrored.camera.right = -mirrored.camera.right;
        let mut found = mirrored.cast();
        let width = SIZE[0] as usize;
        found
            .visibility
            .chunks_mut(width)
            .for_each(<[f32]>::reverse);
        found.valid.chunks_mut(width).for_each(<[bool]>::reverse);
        assert_same("mirrored", &set.cast(), &found);
    }
}

#[test]
fn rotated() {
    for (number, shape) in SHAPES.into_iter().enumerate() {
        let set = Set::new(shape);
        let angle = 0.7 + number as f64;
        let turn = DQuat::from_euler(EulerRot::XYZ, angle, 2.0 * angle, -0.4);
        let turn = |v: DVec3| turn * v;
        assert_same("rotated", &set.cast(), &set.moved(turn, turn, 1.0).cast());
    }
}

#[test]
fn scaled() {
    for shape in SHAPES {
        let set = Set::new(shape);
        let truth = set.cast();
        for scale in [1e-3_f64, 0.1, 3.0, 1e4] {
            let scaled = set.moved(|p| p * scale, |v| v, scale as f32).cast();
            assert_same(&format!("scaled by {scale:e}"), &truth, &scaled);
        }
    }
}

#[test]
fn a_hundred_kilometres_away() {
    // Even without a rebase: the vertices are exact there, and so is what is done with them.
    for shape in SHAPES {
        let set = Set::new(shape);
        let far = DVec3::new(98_304.0, -65_536.0, 81_920.0);
        let moved = set.moved(|p| p + far, |v| v, 1.0).cast();
        assert_same("moved", &set.cast(), &moved);
    }
}

#[test]
fn a_file_a_hundred_kilometres_away() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/blockers.gltf");
    let load = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut file = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        change(&mut file);
        let bytes = serde_json::to_vec(&file).unwrap();
        Scene::load_slice(path, &bytes, &LoadOptions::default()).unwrap()
    };
    let shadows = |scene: &Scene| {
        let (camera, light) = (&scene.cameras[0], &scene.lights[0].light);
        cast(scene, camera, SIZE, light, Sampling::samples(256))
    };
    let near = load(&|_| ());
    let far = load(&|file| {
        let nodes = file["nodes"].as_array_mut().unwrap();
        let children: Vec<usize> = (0..nodes.len()).collect();
        let number = nodes.len();
        nodes.push(serde_json::json!({
            "translation": [1.0e5, -2.0e4, 7.0e4],
            "children": children,
        }));
        file["scenes"][0]["nodes"] = serde_json::json!([number]);
    });
    assert!(far.rebase_origin.length() > 1.0e5);
    assert_same("a file far away", &shadows(&near), &shadows(&far));
}
