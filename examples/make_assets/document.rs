//! A glTF 2.0 document under construction.

use std::fmt::Write as _;

use super::math::{Quat, V3, look_at, rounded};
use super::mesh::Mesh;

pub const FLOAT: u32 = 5126;
const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
/// What a buffer view is for: vertices.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Beyond its borders, an image begins anew or its border goes on.
#[derive(Clone, Copy)]
pub enum Wrap {
    Repeat = 10497,
    Clamp = 33071,
}

#[derive(Default)]
pub struct Document {
    pub skins: Vec<String>,
    pub animations: Vec<String>,
    pub binary: Vec<u8>,
    materials: Vec<String>,
    textures: Vec<String>,
    images: Vec<String>,
    samplers: Vec<String>,
    meshes: Vec<String>,
    accessors: Vec<String>,
    views: Vec<String>,
    nodes: Vec<Node>,
    lights: Vec<String>,
    area_lights: Vec<String>,
    cameras: Vec<String>,
}

struct Node {
    name: String,
    place: String,
    rest: String,
    children: Vec<usize>,
}

/// Where a node is in its parent.
#[derive(Clone, Copy, Default)]
pub struct Place {
    pub translation: Option<V3>,
    pub rotation: Option<Quat>,
    pub scale: Option<V3>,
    /// Column by column; instead of all others.
    pub matrix: Option<[f64; 16]>,
}

impl Place {
    pub fn at(translation: V3) -> Self {
        Self {
            translation: Some(translation),
            ..Self::default()
        }
    }

    fn json(&self) -> String {
        let mut json = String::new();
        let mut put = |name: &str, values: Option<&[f64]>| {
            if let Some(values) = values {
                let _ = write!(json, r#","{name}":{values:?}"#);
            }
        };
        put("translation", self.translation.as_ref().map(|v| &v[..]));
        put("rotation", self.rotation.as_ref().map(|v| &v[..]));
        put("scale", self.scale.as_ref().map(|v| &v[..]));
        put("matrix", self.matrix.as_ref().map(|v| &v[..]));
        json
    }
}

/// A material beyond plain colour.
pub struct Surface<'a> {
    pub name: &'a str,
    /// Linear.
    pub color: V3,
    pub metallic: f64,
    pub roughness: f64,
    pub texture: Option<usize>,
    /// Alpha below this is a hole.
    pub cutoff: Option<f64>,
    pub emissive: V3,
    pub double_sided: bool,
}

impl Default for Surface<'_> {
    fn default() -> Self {
        Self {
            name: "",
            color: [1.0; 3],
            metallic: 0.0,
            roughness: 1.0,
            texture: None,
            cutoff: None,
            emissive: [0.0; 3],
            double_sided: true,
        }
    }
}

/// Up to four joints and their weights, in 65535ths.
pub type Influences = ([u8; 4], [u16; 4]);

/// Where the vertices of a mesh go when its morph target has weight 1: how far each, or only some.
pub enum Morph {
    All { moves: Vec<V3>, turns: Vec<V3> },
    Some(Vec<(u16, V3)>),
}

/// A primitive with what moves it.
pub struct Moving<'a> {
    pub mesh: &'a Mesh,
    pub influences: &'a [Influences],
    pub morph: Option<Morph>,
}

impl Document {
    /// Linear colour.
    pub fn material(&mut self, name: &str, [r, g, b]: V3) -> usize {
        self.materials.push(format!(
            r#"{{"name":"{name}","pbrMetallicRoughness":{{"baseColorFactor":[{r},{g},{b},1],"metallicFactor":0}},"doubleSided":true}}"#
        ));
        self.materials.len() - 1
    }

    pub fn surface(&mut self, surface: &Surface<'_>) -> usize {
        let Surface { name, color, .. } = surface;
        let [r, g, b] = color;
        let (metallic, roughness) = (surface.metallic, surface.roughness);
        let mut json = format!(
            r#"{{"name":"{name}","pbrMetallicRoughness":{{"baseColorFactor":[{r},{g},{b},1],"metallicFactor":{metallic},"roughnessFactor":{roughness}"#
        );
        if let Some(texture) = surface.texture {
            let _ = write!(json, r#","baseColorTexture":{{"index":{texture}}}"#);
        }
        json.push('}');
        if let Some(cutoff) = surface.cutoff {
            let _ = write!(json, r#","alphaMode":"MASK","alphaCutoff":{cutoff}"#);
        }
        if surface.emissive != [0.0; 3] {
            let _ = write!(json, r#","emissiveFactor":{:?}"#, surface.emissive);
        }
        if surface.double_sided {
            json.push_str(r#","doubleSided":true"#);
        }
        json.push('}');
        self.materials.push(json);
        self.materials.len() - 1
    }

    /// A texture of an embedded PNG.
    pub fn texture(&mut self, name: &str, png: &[u8], wrap: Wrap) -> usize {
        let view = self.view(png, "");
        self.images.push(format!(
            r#"{{"name":"{name}","mimeType":"image/png","bufferView":{view}}}"#
        ));
        let wrap = wrap as u32;
        self.samplers.push(format!(
            r#"{{"magFilter":9729,"minFilter":9729,"wrapS":{wrap},"wrapT":{wrap}}}"#
        ));
        let (image, sampler) = (self.images.len() - 1, self.samplers.len() - 1);
        self.textures.push(format!(
            r#"{{"name":"{name}","sampler":{sampler},"source":{image}}}"#
        ));
        self.textures.len() - 1
    }

    /// A mesh of one primitive, and a node for it.
    pub fn add(&mut self, name: &str, material: usize, mesh: &Mesh) -> usize {
        let mesh = self.mesh(name, &[(material, mesh)]);
        self.instance(name, mesh, &Place::default())
    }

    pub fn instance(&mut self, name: &str, mesh: usize, place: &Place) -> usize {
        self.node(name, place, &format!(r#","mesh":{mesh}"#), &[])
    }

    /// A mesh of some primitives: a material and triangles each.
    pub fn mesh(&mut self, name: &str, primitives: &[(usize, &Mesh)]) -> usize {
        let primitives: Vec<_> = primitives
            .iter()
            .map(|(material, mesh)| {
                let moving = Moving {
                    mesh,
                    influences: &[],
                    morph: None,
                };
                self.primitive(*material, &moving)
            })
            .collect();
        self.meshes.push(format!(
            r#"{{"name":"{name}","primitives":[{}]}}"#,
            primitives.join(",")
        ));
        self.meshes.len() - 1
    }

    /// A mesh of one primitive that moves.
    pub fn moving_mesh(&mut self, name: &str, material: usize, moving: &Moving<'_>) -> usize {
        let primitive = self.primitive(material, moving);
        let weights = moving.morph.as_ref().map_or("", |_| r#","weights":[0]"#);
        self.meshes.push(format!(
            r#"{{"name":"{name}","primitives":[{primitive}]{weights}}}"#
        ));
        self.meshes.len() - 1
    }

    fn primitive(&mut self, material: usize, moving: &Moving<'_>) -> String {
        let mesh = moving.mesh;
        let position = self.vectors(&mesh.positions, 1e5, true);
        let mut attributes = format!(r#""POSITION":{position}"#);
        if !mesh.normals.is_empty() {
            let normal = self.vectors(&mesh.normals, 1e6, false);
            let _ = write!(attributes, r#","NORMAL":{normal}"#);
        }
        if !mesh.uvs.is_empty() {
            let uv = self.uvs(&mesh.uvs);
            let _ = write!(attributes, r#","TEXCOORD_0":{uv}"#);
        }
        if !moving.influences.is_empty() {
            let count = moving.influences.len();
            let joints = moving.influences.iter().flat_map(|(joints, _)| *joints);
            let joints = self.accessor(
                &joints.collect::<Vec<_>>(),
                VERTICES,
                &format!(r#""componentType":{U8},"count":{count},"type":"VEC4""#),
            );
            let weights = moving.influences.iter().flat_map(|(_, weights)| *weights);
            let weights = self.accessor(
                &weights.flat_map(u16::to_le_bytes).collect::<Vec<_>>(),
                VERTICES,
                &format!(
                    r#""componentType":{U16},"normalized":true,"count":{count},"type":"VEC4""#
                ),
            );
            let _ = write!(attributes, r#","JOINTS_0":{joints},"WEIGHTS_0":{weights}"#);
        }
        let indices = mesh.indices.iter();
        let (kind, data): (u32, Vec<u8>) = match mesh.positions.len() {
            0..=0xffff => (
                U16,
                indices.flat_map(|i| (*i as u16).to_le_bytes()).collect(),
            ),
            _ => (U32, indices.flat_map(|i| i.to_le_bytes()).collect()),
        };
        let count = mesh.indices.len();
        let indices = self.accessor(
            &data,
            INDICES,
            &format!(r#""componentType":{kind},"count":{count},"type":"SCALAR""#),
        );
        let targets = match &moving.morph {
            None => String::new(),
            Some(Morph::All { moves, turns }) => {
                let moves = self.vectors(moves, 1e5, true);
                let turns = self.vectors(turns, 1e6, false);
                format!(r#","targets":[{{"POSITION":{moves},"NORMAL":{turns}}}]"#)
            }
            Some(Morph::Some(moves)) => {
                let moves = self.sparse(mesh.positions.len(), moves);
                format!(r#","targets":[{{"POSITION":{moves}}}]"#)
            }
        };
        format!(
            r#"{{"attributes":{{{attributes}}},"indices":{indices},"material":{material}{targets}}}"#
        )
    }

    /// Three floats each.
    fn vectors(&mut self, vectors: &[V3], per_unit: f64, bounds: bool) -> usize {
        let vectors = vectors
            .iter()
            .map(|v| v.map(|x| rounded(x, per_unit) as f32));
        let vectors: Vec<[f32; 3]> = vectors.collect();
        let count = vectors.len();
        let mut rest = format!(r#""componentType":{FLOAT},"count":{count},"type":"VEC3""#);
        if bounds {
            rest.push_str(&bounds_json(&vectors));
        }
        let bytes = |v: &[f32; 3]| v.map(f32::to_le_bytes).concat();
        let data: Vec<u8> = vectors.iter().flat_map(bytes).collect();
        self.accessor(&data, VERTICES, &rest)
    }

    /// Zero but for some.
    fn sparse(&mut self, count: usize, some: &[(u16, V3)]) -> usize {
        let indices: Vec<u8> = some.iter().flat_map(|(i, _)| i.to_le_bytes()).collect();
        let values = some.iter().map(|(_, v)| v.map(|x| rounded(x, 1e5) as f32));
        let mut values: Vec<[f32; 3]> = values.collect();
        let data: Vec<u8> = values
            .iter()
            .flat_map(|v| v.map(f32::to_le_bytes).concat())
            .collect();
        let (indices, data) = (self.view(&indices, ""), self.view(&data, ""));
        if values.len() < count {
            values.push([0.0; 3]);
        }
        let bounds = bounds_json(&values);
        let some = some.len();
        self.accessors.push(format!(
            r#"{{"componentType":{FLOAT},"count":{count},"type":"VEC3"{bounds},"sparse":{{"count":{some},"indices":{{"bufferView":{indices},"componentType":{U16}}},"values":{{"bufferView":{data}}}}}}}"#
        ));
        self.accessors.len() - 1
    }

    /// As small integers where they fit.
    fn uvs(&mut self, uvs: &[[f64; 2]]) -> usize {
        let count = uvs.len();
        let all = || uvs.iter().flatten();
        if all().all(|x| (0.0..=1.0).contains(x)) {
            let data: Vec<u8> = all()
                .flat_map(|x| ((x * 65535.0).round() as u16).to_le_bytes())
                .collect();
            self.accessor(
                &data,
                VERTICES,
                &format!(
                    r#""componentType":{U16},"normalized":true,"count":{count},"type":"VEC2""#
                ),
            )
        } else {
            let data: Vec<u8> = all()
                .flat_map(|x| (rounded(*x, 1e5) as f32).to_le_bytes())
                .collect();
            self.accessor(
                &data,
                VERTICES,
                &format!(r#""componentType":{FLOAT},"count":{count},"type":"VEC2""#),
            )
        }
    }

    fn accessor(&mut self, data: &[u8], target: u32, rest: &str) -> usize {
        let view = self.view(data, &format!(r#","target":{target}"#));
        self.push_accessor(view, rest)
    }

    /// Floats that are no vertices: `rest` is the accessor's JSON but for the view and their type.
    pub fn floats(&mut self, values: impl IntoIterator<Item = f64>, rest: &str) -> usize {
        let bytes = values
            .into_iter()
            .flat_map(|x| ((x + 0.0) as f32).to_le_bytes());
        let view = self.view(&bytes.collect::<Vec<_>>(), "");
        self.push_accessor(view, &format!(r#""componentType":{FLOAT},{rest}"#))
    }

    fn push_accessor(&mut self, view: usize, rest: &str) -> usize {
        self.accessors
            .push(format!(r#"{{"bufferView":{view},{rest}}}"#));
        self.accessors.len() - 1
    }

    fn view(&mut self, data: &[u8], rest: &str) -> usize {
        let offset = self.binary.len();
        self.binary.extend(data);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let length = data.len();
        self.views.push(format!(
            r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{rest}}}"#
        ));
        self.views.len() - 1
    }

    /// `rest` is more JSON, each member after a comma.
    pub fn node(&mut self, name: &str, place: &Place, rest: &str, children: &[usize]) -> usize {
        self.nodes.push(Node {
            name: name.into(),
            place: place.json(),
            rest: rest.into(),
            children: children.into(),
        });
        self.nodes.len() - 1
    }

    /// A node over others.
    pub fn group(&mut self, name: &str, place: &Place, children: &[usize]) -> usize {
        self.node(name, place, "", children)
    }

    /// The nodes without a parent.
    pub fn roots(&self) -> Vec<usize> {
        let is_child = |i: &usize| self.nodes.iter().any(|node| node.children.contains(i));
        (0..self.nodes.len()).filter(|i| !is_child(i)).collect()
    }

    /// A light that looks from `at` to `target`, its width level.
    pub fn light(&mut self, name: &str, json: &str, at: V3, target: V3) -> usize {
        self.light_up(name, json, at, target, [0.0, 1.0, 0.0])
    }

    /// A light with `up` along its height.
    pub fn light_up(&mut self, name: &str, json: &str, at: V3, target: V3, up: V3) -> usize {
        self.lights.push(format!(r#"{{"name":"{name}",{json}}}"#));
        let extension = format!(
            r#","extensions":{{"KHR_lights_punctual":{{"light":{}}}}}"#,
            self.lights.len() - 1
        );
        let place = Place {
            rotation: Some(look_at(at, target, up)),
            ..Place::at(at)
        };
        self.node(name, &place, &extension, &[])
    }

    /// A light of EXT_lights_area under a node scaled by `scale`.
    pub fn area_light(&mut self, name: &str, json: &str, place: &Place) -> usize {
        self.area_lights
            .push(format!(r#"{{"name":"{name}",{json}}}"#));
        let extension = format!(
            r#","extensions":{{"EXT_lights_area":{{"light":{}}}}}"#,
            self.area_lights.len() - 1
        );
        self.node(name, place, &extension, &[])
    }

    /// `yfov` in degrees.
    pub fn camera(&mut self, name: &str, yfov: f64, at: V3, target: V3) -> usize {
        let yfov = rounded(yfov.to_radians(), 1e6);
        self.cameras.push(format!(
            r#"{{"name":"{name}","type":"perspective","perspective":{{"yfov":{yfov},"znear":0.1,"zfar":100}}}}"#
        ));
        let camera = format!(r#","camera":{}"#, self.cameras.len() - 1);
        let place = Place {
            rotation: Some(look_at(at, target, [0.0, 1.0, 0.0])),
            ..Place::at(at)
        };
        self.node(name, &place, &camera, &[])
    }

    /// One element a line; `uri` says where the buffer is, if not in the .glb.
    pub fn json(&self, uri: &str) -> String {
        let mut json = String::from(
            "{\n\"asset\":{\"version\":\"2.0\",\"generator\":\"antumbra make_assets\"},\n",
        );
        let extensions = [
            ("KHR_lights_punctual", &self.lights),
            ("EXT_lights_area", &self.area_lights),
        ];
        let used = extensions.iter().filter(|(_, list)| !list.is_empty());
        let names: Vec<_> = used.clone().map(|(name, _)| format!("{name:?}")).collect();
        let lists: Vec<_> = used
            .map(|(name, list)| format!(r#""{name}":{{"lights":[{}]}}"#, list.join(",\n")))
            .collect();
        let _ = writeln!(json, r#""extensionsUsed":[{}],"#, names.join(","));
        let _ = writeln!(json, r#""extensions":{{{}}},"#, lists.join(",\n"));
        let roots: Vec<_> = self.roots().iter().map(ToString::to_string).collect();
        let _ = writeln!(
            json,
            "\"scene\":0,\n\"scenes\":[{{\"nodes\":[{}]}}],",
            roots.join(",")
        );
        let nodes: Vec<_> = self.nodes.iter().map(Node::json).collect();
        for (key, list) in [
            ("nodes", &nodes),
            ("cameras", &self.cameras),
            ("materials", &self.materials),
            ("textures", &self.textures),
            ("images", &self.images),
            ("samplers", &self.samplers),
            ("meshes", &self.meshes),
            ("skins", &self.skins),
            ("animations", &self.animations),
            ("accessors", &self.accessors),
            ("bufferViews", &self.views),
        ] {
            if !list.is_empty() {
                let _ = writeln!(json, "\"{key}\":[\n{}\n],", list.join(",\n"));
            }
        }
        let length = self.binary.len();
        let _ = write!(json, "\"buffers\":[{{\"byteLength\":{length}{uri}}}]\n}}\n");
        json
    }
}

impl Node {
    fn json(&self) -> String {
        let Self {
            name, place, rest, ..
        } = self;
        let children = match &self.children[..] {
            [] => String::new(),
            children => format!(r#","children":{children:?}"#),
        };
        format!(r#"{{"name":"{name}"{place}{rest}{children}}}"#)
    }
}

fn bounds_json(vectors: &[[f32; 3]]) -> String {
    let bound = |pick: fn(f32, f32) -> f32| {
        let all = vectors.iter().copied();
        all.reduce(|a, b| [pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2])])
            .unwrap_or_default()
    };
    format!(
        r#","min":{:?},"max":{:?}"#,
        bound(f32::min),
        bound(f32::max)
    )
}
