//! A figure that walks and waves a flag.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::super::document::{Document, Morph, Moving, Place};
use super::super::figures::{Body, Joint, Motion, add_skeleton, between};
use super::super::math::{Quat, V3, about, add, combined, scale, sub, unit};
use super::super::mesh::Mesh;
use super::super::shapes::{block, plane, rod};

const HIPS: usize = 0;
const SPINE: usize = 1;
const CHEST: usize = 2;
const HEAD: usize = 3;
/// Left (+X) and right.
const ARM: [usize; 2] = [4, 6];
const FOREARM: [usize; 2] = [5, 7];
const THIGH: [usize; 2] = [8, 11];
const SHIN: [usize; 2] = [9, 12];
const FOOT: [usize; 2] = [10, 13];

/// Seconds from one step of the left foot to its next.
const PERIOD: f64 = 1.2;

/// A lamp on a walker; the flag and the cap change by morph targets.
pub fn figure() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.60, 0.58, 0.55]);
    let cloth = b.material("cloth", [0.26, 0.42, 0.62]);
    let wood = b.material("wood", [0.50, 0.34, 0.20]);
    let red = b.material("red", [0.76, 0.20, 0.16]);
    let stone = b.material("stone", [0.66, 0.62, 0.54]);
    b.add("plane", ground, &plane(30.0));
    b.add(
        "step",
        stone,
        &block([0.7, 0.2, 0.9], 0.25, [1.0, 0.0, -0.1]),
    );
    b.add(
        "pillar",
        stone,
        &block([0.26, 0.9, 0.26], 0.25, [0.95, 0.0, -1.25]),
    );

    let joints = joints();
    let (body, cap) = body(&joints);
    let body = Moving {
        mesh: &body.mesh,
        influences: &body.influences,
        morph: Some(Morph::Some(cap)),
    };
    let mesh = b.moving_mesh("body", cloth, &body);
    let body = b.node(
        "body",
        &Place::default(),
        &format!(r#","mesh":{mesh},"skin":0"#),
        &[],
    );

    let (cloth, moves, turns) = flag();
    let cloth = Moving {
        mesh: &cloth,
        influences: &[],
        morph: Some(Morph::All { moves, turns }),
    };
    let mesh = b.moving_mesh("flag", red, &cloth);
    let flag = b.instance("flag", mesh, &Place::default());
    let pole = rod(8, [0.0, -0.22, 0.0], [0.0, 0.78, 0.0], 0.011, 0.008);
    let pole = b.add("pole", wood, &pole);
    let hold = Place {
        rotation: Some(about([0.0, 0.0, 1.0], 2.3)),
        ..Place::at([-0.15, -0.215, 0.0])
    };
    let hold = b.group("hand", &hold, &[pole, flag]);
    let nodes = add_skeleton(&mut b, &joints, &[(FOREARM[1], hold)]);
    let stand = Place {
        rotation: Some(about([0.0, 1.0, 0.0], 0.55)),
        ..Place::at([-0.15, 0.0, 0.1])
    };
    b.group("figure", &stand, &nodes[..1]);
    walk(&mut b, &joints, &nodes, body, flag);
    b.light(
        "disk",
        r#""type":"spot","color":[1,0.94,0.85],"intensity":95,"spot":{"innerConeAngle":0.6,"outerConeAngle":1.1},"extras":{"shape":"disk","radius":0.3}"#,
        [-2.5, 4.6, 0.5],
        [0.2, 0.6, 0.2],
    );
    b.camera("camera", 37.0, [0.6, 3.9, 5.1], [0.15, 0.92, 0.0]);
    b
}

fn joints() -> Vec<Joint> {
    let joint = |name, parent, at| Joint { name, parent, at };
    let mut joints = vec![
        joint("hips", HIPS, [0.0, 0.95, 0.0]),
        joint("spine", HIPS, [0.0, 1.10, 0.0]),
        joint("chest", SPINE, [0.0, 1.28, 0.0]),
        joint("head", CHEST, [0.0, 1.50, 0.0]),
    ];
    let names = [["left arm", "left forearm"], ["right arm", "right forearm"]];
    for ([arm, forearm], (side, x)) in names.into_iter().zip([(0, 1.0), (1, -1.0)]) {
        joints.push(joint(arm, CHEST, [0.19 * x, 1.41, 0.0]));
        joints.push(joint(forearm, ARM[side], [0.35 * x, 1.18, 0.0]));
    }
    let names = [
        ["left thigh", "left shin", "left foot"],
        ["right thigh", "right shin", "right foot"],
    ];
    for ([thigh, shin, foot], (side, x)) in names.into_iter().zip([(0, 1.0), (1, -1.0)]) {
        joints.push(joint(thigh, HIPS, [0.095 * x, 0.91, 0.0]));
        joints.push(joint(shin, THIGH[side], [0.105 * x, 0.49, 0.015]));
        joints.push(joint(foot, SHIN[side], [0.11 * x, 0.085, -0.01]));
    }
    joints
}

/// The body in its rest pose, and where its cap goes when it grows.
fn body(joints: &[Joint]) -> (Body, Vec<(u16, V3)>) {
    let mut body = Body::default();
    let torso = [
        ([0.0, 0.92, 0.0], 0.15),
        ([0.0, 1.10, 0.0], 0.125),
        ([0.0, 1.28, 0.0], 0.165),
        ([0.0, 1.40, 0.0], 0.145),
        ([0.0, 1.48, 0.0], 0.055),
    ];
    let chain = [(HIPS as u8, 0), (SPINE as u8, 1), (CHEST as u8, 2)];
    body.limb(&torso, &chain, 0.09, 18);
    body.flatten(0, 0.72);
    let neck = [
        ([0.0, 1.44, 0.0], 0.05),
        ([0.0, 1.52, 0.0], 0.052),
        ([0.0, 1.60, 0.01], 0.10),
        ([0.0, 1.68, 0.01], 0.098),
    ];
    let before = body.mesh.positions.len();
    body.limb(&neck, &[(CHEST as u8, 0), (HEAD as u8, 1)], 0.04, 16);
    let head = before..body.mesh.positions.len();
    for side in 0..2 {
        let at = |joint: usize| joints[joint].at;
        let (shoulder, elbow) = (at(ARM[side]), at(FOREARM[side]));
        let wrist = add(elbow, scale(sub(elbow, shoulder), 0.9));
        let inner = sub(shoulder, [0.4 * shoulder[0], 0.0, 0.0]);
        let arm = [
            (inner, 0.055),
            (shoulder, 0.062),
            between(shoulder, elbow, 0.5, 0.052),
            (elbow, 0.043),
            between(elbow, wrist, 0.5, 0.041),
            (wrist, 0.034),
        ];
        let chain = [
            (CHEST as u8, 0),
            (ARM[side] as u8, 1),
            (FOREARM[side] as u8, 3),
        ];
        body.limb(&arm, &chain, 0.05, 12);
        let (hip, knee, ankle) = (at(THIGH[side]), at(SHIN[side]), at(FOOT[side]));
        let leg = [
            (add(hip, [-0.02, 0.05, 0.0]), 0.07),
            (hip, 0.088),
            between(hip, knee, 0.5, 0.078),
            (knee, 0.058),
            between(knee, ankle, 0.4, 0.056),
            (ankle, 0.038),
        ];
        let chain = [
            (HIPS as u8, 0),
            (THIGH[side] as u8, 1),
            (SHIN[side] as u8, 3),
        ];
        body.limb(&leg, &chain, 0.07, 12);
        let foot = [
            (add(ankle, [0.0, -0.04, -0.03]), 0.04),
            (add(ankle, [0.0, -0.04, 0.06]), 0.042),
            (add(ankle, [0.005, -0.052, 0.15]), 0.032),
        ];
        body.limb(&foot, &[(FOOT[side] as u8, 0)], 0.03, 10);
    }
    let top = |i: &usize| body.mesh.positions[*i][1] > 1.715;
    let cap = head.filter(top).map(|i| {
        let p = body.mesh.positions[i];
        let up = p[1] - 1.715;
        (i as u16, [-0.6 * p[0], 3.2 * up, -0.8 * up])
    });
    let cap = cap.collect();
    (body, cap)
}

/// A flag on its pole's upper end, blown to -X, and its moves and turns to the other wave.
fn flag() -> (Mesh, Vec<V3>, Vec<V3>) {
    const N: [u32; 2] = [18, 10];
    let part = |i: u32, axis: usize| f64::from(i) / f64::from(N[axis]);
    let wave = |x: f64, y: f64, phase: f64| {
        let (s, c) = (9.0 * x - 1.2 * y + phase).sin_cos();
        let height = 0.09 * x;
        let slope = [0.09 * s + 9.0 * height * c, -1.2 * height * c];
        (height * s, slope)
    };
    let state = |i: u32, j: u32, phase: f64| {
        let (x, y) = (part(i, 0), part(j, 1));
        let (z, [sx, sy]) = wave(x, y, phase);
        let (width, height) = (0.56, 0.36);
        let at = [-width * x - 0.006, 0.40 + height * y, z];
        (at, unit([sx / width, -sy / height, 1.0]))
    };
    let mut mesh = Mesh::default();
    let (mut moves, mut turns) = (Vec::new(), Vec::new());
    for j in 0..=N[1] {
        for i in 0..=N[0] {
            let ((p, n), (q, m)) = (state(i, j, 0.4), state(i, j, 3.0));
            mesh.positions.push(p);
            mesh.normals.push(n);
            moves.push(sub(q, p));
            turns.push(sub(m, n));
        }
    }
    for j in 0..N[1] {
        for i in 0..N[0] {
            let at = |i: u32, j: u32| j * (N[0] + 1) + i;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.indices.extend([a, c, b, a, d, c]);
        }
    }
    (mesh, moves, turns)
}

fn walk(b: &mut Document, joints: &[Joint], nodes: &[usize], body: usize, flag: usize) {
    const KEYS: u32 = 12;
    let parts: Vec<f64> = (0..=KEYS).map(|i| f64::from(i) / f64::from(KEYS)).collect();
    let times: Vec<f64> = parts.iter().map(|t| t * PERIOD).collect();
    // The last key is the first one again, to the last bit.
    let turn = |t: f64| TAU * (t % 1.0) + 1.15;
    let mut motion = Motion::new(b, &times);
    let bob = |t: f64| {
        let (s, c) = turn(t).sin_cos();
        let speed = TAU / PERIOD;
        let at = add(joints[HIPS].at, [0.02 * s, -0.075 * s * s, 0.02 * c]);
        (
            at,
            [0.02 * c * speed, -0.15 * s * c * speed, -0.02 * s * speed],
        )
    };
    motion.translations(
        b,
        nodes[HIPS],
        &parts.iter().map(|t| bob(*t)).collect::<Vec<_>>(),
    );
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let mut rotate = |joint: usize, rotation: &dyn Fn(f64) -> Quat| {
        let keys: Vec<Quat> = parts.iter().map(|t| rotation(turn(*t))).collect();
        motion.rotations(b, nodes[joint], &keys);
    };
    rotate(HIPS, &|p| about(y, -0.10 * p.sin()));
    rotate(SPINE, &|p| {
        combined(about(y, 0.12 * p.sin()), about(x, 0.06))
    });
    rotate(CHEST, &|p| about(y, 0.14 * p.sin()));
    rotate(HEAD, &|p| {
        combined(about(y, -0.12 * p.sin()), about(z, 0.08 * p.cos()))
    });
    for side in 0..2 {
        let way = |p: f64| if side == 0 { p } else { p + 0.5 * TAU };
        rotate(THIGH[side], &|p| about(x, 0.04 - 0.48 * way(p).sin()));
        let knee = |p: f64| 0.08 + 0.85 * way(p).cos().max(0.0).powi(2);
        rotate(SHIN[side], &|p| about(x, knee(p)));
        rotate(FOOT[side], &|p| {
            about(x, 0.12 * way(p).sin() - 0.3 * (knee(p) - 0.08))
        });
    }
    rotate(ARM[0], &|p| {
        combined(about(x, 0.5 * p.sin()), about(z, -0.32))
    });
    rotate(FOREARM[0], &|p| about(x, -0.35 + 0.2 * p.sin()));
    rotate(ARM[1], &|p| about(z, -FRAC_PI_2 + 0.12 * p.sin()));
    rotate(FOREARM[1], &|p| about(z, -0.75 + 0.22 * p.cos()));
    let half = |t: &f64, shift: f64| 0.5 - 0.5 * (turn(*t) + shift).cos();
    motion.weights(
        b,
        flag,
        &parts.iter().map(|t| half(t, 0.0)).collect::<Vec<_>>(),
    );
    motion.weights(
        b,
        body,
        &parts.iter().map(|t| half(t, 1.5)).collect::<Vec<_>>(),
    );
    motion.finish(b, "walk");
}
