//! Writes the scenes of `assets/`.
//!
//! ```sh
//! cargo run --example make_assets            # into assets/
//! cargo run --example make_assets -- FOLDER
//! ```
//!
//! Coordinates are rounded before they are written, so that the last bit of a platform's sine does
//! not reach the files: the same code gives the same bytes everywhere.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

#[allow(dead_code, reason = "tests include this file as a module")]
fn main() -> std::io::Result<()> {
    let folder = std::env::args_os()
        .nth(1)
        .unwrap_or_else(|| "assets".into());
    for (name, bytes) in scenes() {
        let path = std::path::Path::new(&folder).join(name);
        std::fs::write(&path, &bytes)?;
        println!("{}: {} bytes", path.display(), bytes.len());
    }
    Ok(())
}

/// File name and content of every scene.
pub fn scenes() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("sphere_over_plane.gltf", sphere_over_plane().to_gltf()),
        ("poles.gltf", poles().to_gltf()),
        ("blockers.gltf", blockers().to_gltf()),
        ("sun_court.glb", sun_court().to_glb()),
    ]
}

type V3 = [f64; 3];

fn sphere_over_plane() -> Builder {
    let mut b = Builder::default();
    let ground = b.material("ground", [0.62, 0.60, 0.56]);
    let clay = b.material("clay", [0.80, 0.33, 0.20]);
    b.add("plane", ground, &plane(40.0));
    b.add(
        "sphere",
        clay,
        &sphere(12).scaled(0.8).moved([0.0, 1.3, 0.0]),
    );
    b.light(
        "lamp",
        r#""type":"spot","color":[1,0.95,0.86],"intensity":90,"spot":{"innerConeAngle":0.7,"outerConeAngle":1.2},"extras":{"shape":"disk","radius":0.5}"#,
        [-3.2, 4.6, 1.2],
        [0.3, 0.6, 0.0],
    );
    b.camera("camera", 36.0, [0.4, 4.5, 6.5], [0.4, 0.55, 0.0]);
    b
}

fn poles() -> Builder {
    let mut b = Builder::default();
    let ground = b.material("ground", [0.55, 0.58, 0.60]);
    let pole = b.material("pole", [0.85, 0.72, 0.38]);
    let teal = b.material("teal", [0.16, 0.48, 0.50]);
    let brick = b.material("brick", [0.62, 0.24, 0.17]);
    b.add("plane", ground, &plane(60.0));
    for i in 0..7 {
        let t = f64::from(i) / 6.0;
        let (radius, height) = (0.035 + 0.015 * t, 2.7 - 0.9 * t);
        let at = [-1.9 + 3.2 * t, 0.0, -1.8 + 0.7 * (PI * t).sin()];
        b.add(
            &format!("pole {i}"),
            pole,
            &column(16, radius, height).moved(at),
        );
    }
    let cube = |size: V3, turn: f64, at: V3| {
        cuboid(size)
            .turned(turn)
            .moved([at[0], at[1] + 0.5 * size[1], at[2]])
    };
    b.add(
        "low box",
        teal,
        &cube([0.9, 0.7, 0.9], 0.5, [-0.9, 0.0, 0.5]),
    );
    b.add(
        "tall box",
        brick,
        &cube([0.5, 1.5, 0.5], -0.3, [0.9, 0.0, 0.2]),
    );
    b.add(
        "small box",
        teal,
        &cube([0.35, 0.35, 0.35], 0.2, [-0.95, 0.7, 0.45]),
    );
    b.light(
        "panel",
        r#""type":"point","color":[1,0.97,0.92],"intensity":130,"extras":{"shape":"rect","width":1.6,"height":0.6}"#,
        [-3.6, 5.4, 1.4],
        [0.4, 0.3, -0.6],
    );
    b.camera("camera", 36.0, [0.7, 5.0, 6.8], [0.7, 0.45, -0.9]);
    b
}

fn blockers() -> Builder {
    let mut b = Builder::default();
    let ground = b.material("ground", [0.60, 0.60, 0.64]);
    let blue = b.material("blue", [0.22, 0.34, 0.68]);
    let yellow = b.material("yellow", [0.86, 0.64, 0.16]);
    b.add("plane", ground, &plane(50.0));
    // The sheet has no thickness, the slab has; seen from the light, each covers part of the other.
    let sheet = sheet(1.7, 1.1).tilted(0.45).turned(0.35);
    b.add("sheet", blue, &sheet.moved([-0.25, 1.9, -0.2]));
    let slab = cuboid([1.5, 0.08, 0.9]).tilted(-0.3).turned(-0.5);
    b.add("slab", yellow, &slab.moved([0.5, 0.85, 0.25]));
    b.light(
        "bulb",
        r#""type":"point","color":[1,0.93,0.82],"intensity":85,"extras":{"shape":"sphere","radius":0.4}"#,
        [-2.0, 4.8, 1.0],
        [0.0, 0.0, 0.0],
    );
    b.camera("camera", 36.0, [0.6, 4.6, 6.4], [0.6, 0.6, 0.0]);
    b
}

fn sun_court() -> Builder {
    let mut b = Builder::default();
    let paving = b.material("paving", [0.58, 0.52, 0.45]);
    let plaster = b.material("plaster", [0.80, 0.70, 0.56]);
    let stone = b.material("stone", [0.78, 0.76, 0.72]);
    let ochre = b.material("ochre", [0.72, 0.42, 0.24]);
    let slab = |low: V3, high: V3| {
        let mid = |i: usize| 0.5 * (low[i] + high[i]);
        let size = |i: usize| high[i] - low[i];
        cuboid([size(0), size(1), size(2)]).moved([mid(0), mid(1), mid(2)])
    };
    b.add(
        "paving",
        paving,
        &slab([-7.0, -0.3, -14.0], [7.0, 0.0, 9.0]),
    );
    b.add(
        "arch wall",
        plaster,
        &arch_wall(14.0, 8.5, 0.7, 1.3, 2.2).moved([0.0, 0.0, -5.0]),
    );
    b.add(
        "left wall",
        ochre,
        &slab([-6.5, 0.0, -4.65], [-6.0, 1.2, 9.0]),
    );
    b.add(
        "right wall",
        ochre,
        &slab([6.0, 0.0, -4.65], [6.5, 8.5, 9.0]),
    );
    b.add(
        "far wall",
        ochre,
        &slab([-7.0, 0.0, -12.5], [7.0, 7.0, -12.0]),
    );
    let shaft = column(24, 0.26, 2.9);
    for i in 0..4 {
        let at = [-2.6, 0.0, -3.2 + 2.0 * f64::from(i)];
        b.add(
            &format!("base {i}"),
            stone,
            &cuboid([0.8, 0.3, 0.8]).moved([at[0], 0.15, at[2]]),
        );
        b.add(
            &format!("shaft {i}"),
            stone,
            &shaft.moved([at[0], 0.3, at[2]]),
        );
        b.add(
            &format!("capital {i}"),
            stone,
            &cuboid([0.75, 0.2, 0.75]).moved([at[0], 3.3, at[2]]),
        );
    }
    b.add("beam", stone, &slab([-2.9, 3.4, -4.65], [-2.3, 3.85, 3.3]));
    for i in 0..3 {
        let (h, d) = (0.16 * f64::from(3 - i), 0.34 * f64::from(i));
        b.add(
            &format!("step {i}"),
            stone,
            &slab([-1.9, 0.0, -4.65], [1.9, h, -4.1 + d]),
        );
    }
    b.add(
        "plinth",
        stone,
        &cuboid([0.9, 0.6, 0.9]).moved([2.3, 0.3, 0.2]),
    );
    b.add(
        "globe",
        ochre,
        &sphere(8).scaled(0.55).moved([2.3, 1.15, 0.2]),
    );
    b.light(
        "sun",
        r#""type":"directional","color":[1,0.96,0.88],"intensity":3.8,"extras":{"angular_diameter_deg":1.5}"#,
        [-7.0, 7.0, 3.0],
        [0.0, 0.5, 0.2],
    );
    b.camera("camera", 46.0, [-1.0, 3.1, 9.6], [0.5, 1.7, -3.0]);
    b
}

/// Triangles with one normal a vertex.
#[derive(Clone, Default)]
struct Mesh {
    positions: Vec<V3>,
    normals: Vec<V3>,
    indices: Vec<u16>,
}

impl Mesh {
    /// A convex polygon, counter-clockwise from the front, with a normal for each corner.
    fn polygon(&mut self, corners: &[(V3, V3)]) {
        let first = self.positions.len() as u16;
        for (position, normal) in corners {
            self.positions.push(*position);
            self.normals.push(*normal);
        }
        for i in 2..corners.len() as u16 {
            self.indices.extend([first, first + i - 1, first + i]);
        }
    }

    fn flat(&mut self, normal: V3, corners: &[V3]) {
        let corners: Vec<_> = corners.iter().map(|corner| (*corner, normal)).collect();
        self.polygon(&corners);
    }

    fn map(&self, position: impl Fn(V3) -> V3, normal: impl Fn(V3) -> V3) -> Self {
        Self {
            positions: self.positions.iter().map(|p| position(*p)).collect(),
            normals: self.normals.iter().map(|n| normal(*n)).collect(),
            indices: self.indices.clone(),
        }
    }

    fn moved(&self, by: V3) -> Self {
        self.map(|p| add(p, by), |n| n)
    }

    fn scaled(&self, by: f64) -> Self {
        self.map(|p| p.map(|x| x * by), |n| n)
    }

    /// Turned about +Y.
    fn turned(&self, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        let turn = |[x, y, z]: V3| [c * x + s * z, y, c * z - s * x];
        self.map(turn, turn)
    }

    /// Turned about +Z.
    fn tilted(&self, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        let turn = |[x, y, z]: V3| [c * x - s * y, s * x + c * y, z];
        self.map(turn, turn)
    }
}

/// A square in the XZ plane that faces up.
fn plane(size: f64) -> Mesh {
    sheet(size, size)
}

fn sheet(width: f64, depth: f64) -> Mesh {
    let (x, z) = (0.5 * width, 0.5 * depth);
    let mut mesh = Mesh::default();
    let corners = [[-x, 0.0, z], [x, 0.0, z], [x, 0.0, -z], [-x, 0.0, -z]];
    mesh.flat([0.0, 1.0, 0.0], &corners);
    mesh
}

/// A box about the origin.
fn cuboid(size: V3) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |a: f64, b: f64| {
                let mut p = [0.0; 3];
                p[axis] = 0.5 * size[axis] * sign;
                p[u] = 0.5 * size[u] * a * sign;
                p[v] = 0.5 * size[v] * b;
                p
            };
            let mut normal = [0.0; 3];
            normal[axis] = sign;
            let corners = [
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ];
            mesh.flat(normal, &corners);
        }
    }
    mesh
}

/// A round column that stands on the XZ plane, closed above and below.
fn column(sides: u32, radius: f64, height: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let rim = |i: u32, y: f64| {
        let (s, c) = (TAU * f64::from(i % sides) / f64::from(sides)).sin_cos();
        ([radius * c, y, -radius * s], [c, 0.0, -s])
    };
    for i in 0..sides {
        let corners = [
            rim(i, 0.0),
            rim(i + 1, 0.0),
            rim(i + 1, height),
            rim(i, height),
        ];
        mesh.polygon(&corners);
    }
    let ring = |y: f64| (0..sides).map(move |i| rim(i, y).0);
    mesh.flat([0.0, 1.0, 0.0], &ring(height).collect::<Vec<_>>());
    mesh.flat([0.0, -1.0, 0.0], &ring(0.0).rev().collect::<Vec<_>>());
    mesh
}

/// A unit sphere: each face of an icosahedron split into `n * n` triangles.
fn sphere(n: u32) -> Mesh {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let faces = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut mesh = Mesh::default();
    let mut known = BTreeMap::new();
    for [a, b, c] in faces {
        let mut vertex = |i: u32, j: u32| -> u16 {
            let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            let along = |k: usize| {
                let (a, b, c): (f64, f64, f64) = (corners[a][k], corners[b][k], corners[c][k]);
                a + u * (b - a) + v * (c - a)
            };
            let p = unit([along(0), along(1), along(2)]);
            // Neighbouring faces meet in the same vertices.
            let key = p.map(|x| (1e6 * x).round() as i64);
            *known.entry(key).or_insert_with(|| {
                mesh.positions.push(p);
                mesh.normals.push(p);
                (mesh.positions.len() - 1) as u16
            })
        };
        let mut triangles = Vec::new();
        for j in 0..n {
            for i in 0..n - j {
                triangles.extend([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
                if i + j + 1 < n {
                    triangles.extend([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
                }
            }
        }
        mesh.indices.extend(triangles);
    }
    mesh
}

/// A wall that stands on the XZ plane, centred in X and Z, with a round-arched gate in the middle.
fn arch_wall(width: f64, height: f64, depth: f64, radius: f64, spring: f64) -> Mesh {
    const STEPS: u32 = 16;
    let mut mesh = Mesh::default();
    let (w, d) = (0.5 * width, 0.5 * depth);
    // The outline of the gate, from its left foot over the arch to its right foot, with the
    // direction into the opening.
    let mut gate = vec![([-radius, 0.0], [1.0, 0.0])];
    for i in 0..=STEPS {
        let (s, c) = (PI * (1.0 - f64::from(i) / f64::from(STEPS))).sin_cos();
        gate.push(([radius * c, spring + radius * s], [-c, -s]));
    }
    gate.push(([radius, 0.0], [-1.0, 0.0]));
    let mut face = |x0: f64, y0: f64, x1: f64, y1: f64| {
        let front = [[x0, y0, d], [x1, y1, d], [x1, height, d], [x0, height, d]];
        mesh.flat([0.0, 0.0, 1.0], &front);
        let back = [
            [x1, y1, -d],
            [x0, y0, -d],
            [x0, height, -d],
            [x1, height, -d],
        ];
        mesh.flat([0.0, 0.0, -1.0], &back);
    };
    face(-w, 0.0, -radius, 0.0);
    face(radius, 0.0, w, 0.0);
    for pair in gate[1..gate.len() - 1].windows(2) {
        face(pair[0].0[0], pair[0].0[1], pair[1].0[0], pair[1].0[1]);
    }
    for pair in gate.windows(2) {
        let corner = |at: usize, z: f64| {
            let ([x, y], [nx, ny]) = pair[at];
            ([x, y, z], [nx, ny, 0.0])
        };
        mesh.polygon(&[corner(0, d), corner(0, -d), corner(1, -d), corner(1, d)]);
    }
    mesh.flat(
        [0.0, 1.0, 0.0],
        &[
            [-w, height, d],
            [w, height, d],
            [w, height, -d],
            [-w, height, -d],
        ],
    );
    for x in [-w, w] {
        let s = x.signum();
        let side = [
            [x, 0.0, -s * d],
            [x, height, -s * d],
            [x, height, s * d],
            [x, 0.0, s * d],
        ];
        mesh.flat([s, 0.0, 0.0], &side);
    }
    mesh
}

fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(v: V3) -> V3 {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|x| x / length)
}

/// `x` without the digits in which platforms differ, and without a minus before 0.
fn rounded(x: f64, per_unit: f64) -> f64 {
    (x * per_unit).round() / per_unit + 0.0
}

/// The rotation that turns -Z from `eye` to `target`, with +Y as far up as can be.
fn look_at(eye: V3, target: V3) -> [f64; 4] {
    let z = unit([eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]]);
    let x = unit(cross([0.0, 1.0, 0.0], z));
    let y = cross(z, x);
    // Of the four ways to take a quaternion out of a matrix, each is exact where its divisor is
    // large; no view here is turned by nearly half a turn, so the one by the trace does.
    let w = 0.5 * (1.0 + x[0] + y[1] + z[2]).sqrt();
    assert!(w > 0.1, "nearly half a turn from {eye:?} to {target:?}");
    [y[2] - z[1], z[0] - x[2], x[1] - y[0], 4.0 * w * w].map(|q| rounded(q / (4.0 * w), 1e9))
}

/// A glTF document under construction.
#[derive(Default)]
struct Builder {
    materials: Vec<String>,
    meshes: Vec<String>,
    accessors: Vec<String>,
    views: Vec<String>,
    nodes: Vec<String>,
    lights: Vec<String>,
    cameras: Vec<String>,
    binary: Vec<u8>,
}

impl Builder {
    /// Linear colour.
    fn material(&mut self, name: &str, [r, g, b]: V3) -> usize {
        self.materials.push(format!(
            r#"{{"name":"{name}","pbrMetallicRoughness":{{"baseColorFactor":[{r},{g},{b},1],"metallicFactor":0}},"doubleSided":true}}"#
        ));
        self.materials.len() - 1
    }

    fn add(&mut self, name: &str, material: usize, mesh: &Mesh) {
        let coordinates = |v: &V3, per_unit: f64| v.map(|x| rounded(x, per_unit) as f32);
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| coordinates(p, 1e5)).collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            let all = positions.iter().copied();
            all.reduce(|a, b| [pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2])])
                .unwrap_or_default()
        };
        let bounds = format!(
            r#","min":{:?},"max":{:?}"#,
            bound(f32::min),
            bound(f32::max)
        );
        let bytes = |v: &[f32; 3]| v.map(f32::to_le_bytes).concat();
        let data: Vec<u8> = positions.iter().flat_map(bytes).collect();
        let count = positions.len();
        let position = self.accessor(
            &data,
            34962,
            &format!(r#""componentType":5126,"count":{count},"type":"VEC3"{bounds}"#),
        );
        let normals = mesh.normals.iter().map(|n| coordinates(n, 1e6));
        let data: Vec<u8> = normals.flat_map(|n| bytes(&n)).collect();
        let normal = self.accessor(
            &data,
            34962,
            &format!(r#""componentType":5126,"count":{count},"type":"VEC3""#),
        );
        let data: Vec<u8> = mesh.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let count = mesh.indices.len();
        let indices = self.accessor(
            &data,
            34963,
            &format!(r#""componentType":5123,"count":{count},"type":"SCALAR""#),
        );
        self.meshes.push(format!(
            r#"{{"name":"{name}","primitives":[{{"attributes":{{"POSITION":{position},"NORMAL":{normal}}},"indices":{indices},"material":{material}}}]}}"#
        ));
        self.nodes.push(format!(
            r#"{{"name":"{name}","mesh":{}}}"#,
            self.meshes.len() - 1
        ));
    }

    fn accessor(&mut self, data: &[u8], target: u32, rest: &str) -> usize {
        let offset = self.binary.len();
        self.binary.extend(data);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.views.push(format!(
            r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{},"target":{target}}}"#,
            data.len()
        ));
        self.accessors.push(format!(
            r#"{{"bufferView":{},{rest}}}"#,
            self.views.len() - 1
        ));
        self.accessors.len() - 1
    }

    fn light(&mut self, name: &str, json: &str, at: V3, target: V3) {
        self.lights.push(format!(r#"{{"name":"{name}",{json}}}"#));
        let extension = format!(
            r#""extensions":{{"KHR_lights_punctual":{{"light":{}}}}}"#,
            self.lights.len() - 1
        );
        self.placed(name, at, target, &extension);
    }

    /// `yfov` in degrees.
    fn camera(&mut self, name: &str, yfov: f64, at: V3, target: V3) {
        let yfov = rounded(yfov.to_radians(), 1e6);
        self.cameras.push(format!(
            r#"{{"name":"{name}","type":"perspective","perspective":{{"yfov":{yfov},"znear":0.1,"zfar":100}}}}"#
        ));
        let camera = format!(r#""camera":{}"#, self.cameras.len() - 1);
        self.placed(name, at, target, &camera);
    }

    fn placed(&mut self, name: &str, at: V3, target: V3, rest: &str) {
        let rotation = look_at(at, target);
        self.nodes.push(format!(
            r#"{{"name":"{name}","translation":{at:?},"rotation":{rotation:?},{rest}}}"#
        ));
    }

    /// One element a line; `uri` says where the buffer is, if not in the .glb.
    fn json(&self, uri: &str) -> String {
        let mut json = String::from(
            "{\n\"asset\":{\"version\":\"2.0\",\"generator\":\"antumbra make_assets\"},\n",
        );
        json.push_str("\"extensionsUsed\":[\"KHR_lights_punctual\"],\n");
        let lights = self.lights.join(",\n");
        let _ = writeln!(
            json,
            r#""extensions":{{"KHR_lights_punctual":{{"lights":[{lights}]}}}},"#
        );
        let nodes: Vec<_> = (0..self.nodes.len()).map(|i| i.to_string()).collect();
        let _ = writeln!(
            json,
            "\"scene\":0,\n\"scenes\":[{{\"nodes\":[{}]}}],",
            nodes.join(",")
        );
        for (key, list) in [
            ("nodes", &self.nodes),
            ("cameras", &self.cameras),
            ("materials", &self.materials),
            ("meshes", &self.meshes),
            ("accessors", &self.accessors),
            ("bufferViews", &self.views),
        ] {
            let _ = writeln!(json, "\"{key}\":[\n{}\n],", list.join(",\n"));
        }
        let length = self.binary.len();
        let _ = write!(json, "\"buffers\":[{{\"byteLength\":{length}{uri}}}]\n}}\n");
        json
    }

    fn to_gltf(&self) -> Vec<u8> {
        let data = base64(&self.binary);
        let uri = format!(r#","uri":"data:application/octet-stream;base64,{data}""#);
        self.json(&uri).into_bytes()
    }

    fn to_glb(&self) -> Vec<u8> {
        let mut json = self.json("").into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + json.len() + 8 + self.binary.len();
        let mut glb = b"glTF".to_vec();
        glb.extend(2u32.to_le_bytes());
        glb.extend((total as u32).to_le_bytes());
        for (kind, data) in [(b"JSON", &json), (b"BIN\0", &self.binary)] {
            glb.extend((data.len() as u32).to_le_bytes());
            glb.extend(kind);
            glb.extend(data);
        }
        glb
    }
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
