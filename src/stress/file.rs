//! Cases as files: glTF in memory.

use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::Case;
use crate::light::{AreaLight, LightShape};
use crate::scene::{LoadOptions, Primitive, Scene, SceneCamera, SceneError};

const FLOAT: u32 = 5126;
const UINT: u32 = 5125;

/// A file whose animation goes wrong at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedFile {
    /// The file, .glb.
    pub bytes: Vec<u8>,
    /// Times of its frames, seconds.
    pub moments: Vec<f64>,
    /// Which of them cannot be shown.
    pub broken: usize,
}

/// A document with its binary part.
#[derive(Default)]
struct Document {
    accessors: Vec<Value>,
    views: Vec<Value>,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    binary: Vec<u8>,
}

impl Document {
    fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        self.views.push(json!({
            "buffer": 0,
            "byteOffset": self.binary.len(),
            "byteLength": bytes.len(),
        }));
        self.binary.extend(bytes);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1,
            "componentType": component,
            "type": kind,
            "count": count,
        }));
        self.accessors.len() - 1
    }

    fn vectors(&mut self, vectors: &[Vec3]) -> usize {
        let bytes: Vec<u8> = (vectors.iter())
            .flat_map(|v| v.to_array())
            .flat_map(f32::to_le_bytes)
            .collect();
        self.accessor(FLOAT, "VEC3", vectors.len(), &bytes)
    }

    fn scalars(&mut self, scalars: &[f32]) -> usize {
        let bytes: Vec<u8> = scalars.iter().flat_map(|s| s.to_le_bytes()).collect();
        self.accessor(FLOAT, "SCALAR", scalars.len(), &bytes)
    }

    fn mesh(&mut self, primitive: &Primitive) -> usize {
        let positions = self.vectors(&primitive.positions);
        let (low, high) = primitive
            .positions
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                (low.min(*p), high.max(*p))
            });
        self.accessors[positions]["min"] = json!(low.to_array());
        self.accessors[positions]["max"] = json!(high.to_array());
        let normals = self.vectors(&primitive.normals);
        let bytes: Vec<u8> = (primitive.indices.iter())
            .flat_map(|index| index.to_le_bytes())
            .collect();
        let indices = self.accessor(UINT, "SCALAR", primitive.indices.len(), &bytes);
        self.meshes.push(json!({"primitives": [{
            "attributes": {"POSITION": positions, "NORMAL": normals},
            "indices": indices,
            "material": 0,
        }]}));
        self.meshes.len() - 1
    }

    fn glb(self, mut json: Value) -> Vec<u8> {
        json["asset"] = json!({"version": "2.0"});
        json["scene"] = json!(0);
        json["accessors"] = Value::Array(self.accessors);
        json["bufferViews"] = Value::Array(self.views);
        json["nodes"] = Value::Array(self.nodes);
        json["meshes"] = Value::Array(self.meshes);
        json["materials"] = json!([{"doubleSided": true,
            "pbrMetallicRoughness": {"metallicFactor": 0}}]);
        json["buffers"] = json!([{"byteLength": self.binary.len()}]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bytes = b"glTF\x02\0\0\0".to_vec();
        let length = 12 + 8 + text.len() + 8 + self.binary.len();
        bytes.extend((length as u32).to_le_bytes());
        for (kind, data) in [(b"JSON", &text), (b"BIN\0", &self.binary)] {
            bytes.extend((data.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(data);
        }
        bytes
    }
}

/// Columns of a transform.
fn matrix(x: Vec3, y: Vec3, z: Vec3, at: Vec3) -> Value {
    let columns = [x.extend(0.0), y.extend(0.0), z.extend(0.0), at.extend(1.0)];
    json!(columns.map(|column| column.to_array()).as_flattened())
}

fn light(light: &AreaLight) -> Value {
    let (kind, extras) = match light.shape {
        LightShape::Point => ("point", Value::Null),
        LightShape::Disk { radius } => ("point", json!({"shape": "disk", "radius": radius})),
        LightShape::Rect { width, height } => {
            let extras = json!({"shape": "rect", "width": width, "height": height});
            ("point", extras)
        }
        LightShape::Sphere { radius } => ("point", json!({"shape": "sphere", "radius": radius})),
        LightShape::Line { length } => ("point", json!({"shape": "line", "length": length})),
        LightShape::Sun { angular_diameter } => {
            let degrees = f64::from(angular_diameter).to_degrees();
            ("directional", json!({"angular_diameter_deg": degrees}))
        }
    };
    let mut json = json!({
        "type": kind,
        "color": light.color.to_array(),
        "intensity": light.intensity,
    });
    if !extras.is_null() {
        json["extras"] = extras;
    }
    json
}

fn camera(camera: &SceneCamera) -> Value {
    json!({"type": "perspective", "perspective": {"yfov": camera.yfov, "znear": camera.znear}})
}

impl Case {
    /// The case as a .glb file in which everything stands under one node at `origin`, metres.
    pub fn to_glb(&self, origin: DVec3) -> Vec<u8> {
        let mut document = Document::default();
        for primitive in &self.scene.primitives {
            let mesh = document.mesh(primitive);
            let node = json!({"name": primitive.name, "mesh": mesh});
            document.nodes.push(node);
        }
        let lamp = self.area_light();
        document.nodes.push(json!({
            "name": "lamp",
            "matrix": matrix(lamp.axis_x, lamp.axis_y, -lamp.direction, lamp.center),
            "extensions": {"KHR_lights_punctual": {"light": 0}},
        }));
        let eye = &self.camera;
        document.nodes.push(json!({
            "name": "eye",
            "matrix": matrix(eye.right, eye.up, -eye.forward, eye.position),
            "camera": 0,
        }));
        let children: Vec<usize> = (0..document.nodes.len()).collect();
        document
            .nodes
            .push(json!({"translation": origin.to_array(), "children": children}));
        let root = children.len();
        document.glb(json!({
            "scenes": [{"nodes": [root]}],
            "cameras": [camera(eye)],
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": [light(lamp)]}},
        }))
    }

    /// The case written to a file at `origin` and read again: in scene space it is where it was but
    /// for [`Scene::rebase_origin`].
    ///
    /// # Errors
    /// What the loader refuses.
    pub fn through_file(&self, origin: DVec3) -> Result<Self, SceneError> {
        let name = format!("{}.glb", self.name);
        let scene = Scene::load_slice(name, &self.to_glb(origin), &LoadOptions::default())?;
        let camera = scene.cameras.first().unwrap_or(&self.camera).clone();
        Ok(Self {
            name: format!("{}, read at {origin}", self.name),
            light: 0,
            camera,
            scene,
            ..self.clone()
        })
    }
}

/// A triangle over a floor that moves for ten frames, with one frame in which a morph target throws a
/// vertex beyond the numbers there are.
pub fn broken_frame() -> AnimatedFile {
    const BROKEN: usize = 5;
    let moments: Vec<f32> = (0..10).map(|frame| 0.25 * frame as f32).collect();
    let corners = [
        Vec3::new(-1.0, 1.0, 0.0),
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::new(0.0, 1.0, 1.0),
    ];
    let triangle = Primitive {
        positions: corners.to_vec(),
        normals: vec![Vec3::Y; 3],
        indices: vec![0, 1, 2],
        ..Primitive::default()
    };
    let floor = Primitive {
        positions: corners.map(|p| 4.0 * (p - Vec3::Y)).to_vec(),
        ..triangle.clone()
    };
    let mut document = Document::default();
    for primitive in [&floor, &triangle] {
        let mesh = document.mesh(primitive);
        document.nodes.push(json!({"mesh": mesh}));
    }
    let moves = document.vectors(&[Vec3::X, Vec3::ZERO, Vec3::Y]);
    document.meshes[1]["primitives"][0]["targets"] = json!([{"POSITION": moves}]);
    let weights: Vec<f32> = (0..moments.len())
        .map(|frame| match frame {
            BROKEN => 3.0e38,
            _ => 0.1 * frame as f32,
        })
        .collect();
    let (input, output) = (document.scalars(&moments), document.scalars(&weights));
    // Each key holds until the next, so that only one frame is wrong.
    let bytes = document.glb(json!({
        "scenes": [{"nodes": [0, 1]}],
        "animations": [{
            "channels": [{"sampler": 0, "target": {"node": 1, "path": "weights"}}],
            "samplers": [{"input": input, "output": output, "interpolation": "STEP"}],
        }],
    }));
    AnimatedFile {
        bytes,
        moments: moments.into_iter().map(f64::from).collect(),
        broken: BROKEN,
    }
}
