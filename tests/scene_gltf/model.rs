//! Files made piece by piece: JSON and one buffer.

use serde_json::{Value, json};

use super::{data_uri, floats, push, square, square_data};

pub const F32: u32 = 5126;
pub const U8: u32 = 5121;
pub const U16: u32 = 5123;
pub const I16: u32 = 5122;

pub struct Model {
    pub json: Value,
    pub data: Vec<u8>,
}

impl Model {
    /// The unit square of `square()`: accessor 0 its corners, accessor 1 its indices.
    pub fn square() -> Self {
        Self {
            json: square(),
            data: square_data(),
        }
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.data.len(), "byteLength": bytes.len()});
        self.data.extend(bytes);
        self.push("bufferViews", view)
    }

    pub fn accessor(&mut self, component: u32, kind: &str, bytes: &[u8]) -> usize {
        let width = match component {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        };
        let components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": component, "type": kind,
                   "count": bytes.len() / (width * components)}),
        )
    }

    pub fn normalized(&mut self, component: u32, kind: &str, bytes: &[u8]) -> usize {
        let index = self.accessor(component, kind, bytes);
        self.json["accessors"][index]["normalized"] = json!(true);
        index
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        self.accessor(F32, kind, &floats(values))
    }

    /// Appends to a list of the document, which is made if it is not there.
    pub fn push(&mut self, list: &str, element: Value) -> usize {
        if self.json[list].is_null() {
            self.json[list] = json!([]);
        }
        push(&mut self.json, list, element);
        self.json[list].as_array().map_or(0, |list| list.len() - 1)
    }

    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    pub fn attribute(&mut self, name: &str, accessor: usize) {
        self.primitive()["attributes"][name] = json!(accessor);
    }

    /// A channel of animation 0 with keys at `times`.
    pub fn channel(&mut self, node: usize, path: &str, how: &str, times: &[f32], output: usize) {
        let input = self.floats("SCALAR", times);
        if self.json["animations"].is_null() {
            self.json["animations"] = json!([{"channels": [], "samplers": []}]);
        }
        let animation = &mut self.json["animations"][0];
        let sampler = animation["samplers"].as_array().map_or(0, Vec::len);
        push(
            animation,
            "samplers",
            json!({"input": input, "output": output, "interpolation": how}),
        );
        push(
            animation,
            "channels",
            json!({"sampler": sampler, "target": {"node": node, "path": path}}),
        );
    }

    /// As .gltf, all in one.
    pub fn text(&self) -> Value {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.data.len(), "uri": data_uri(&self.data)}]);
        json
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.data.len()}]);
        glb(&json, &self.data)
    }
}

pub fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((12 + 8 + text.len() + 8 + bin.len()) as u32).to_le_bytes());
    for (kind, data) in [(b"JSON", &text[..]), (b"BIN\0", bin)] {
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(data);
    }
    bytes
}

pub fn png(width: u32, height: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    encoded(width, height, texels, image::ImageFormat::Png)
}

pub fn jpeg(width: u32, height: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    encoded(width, height, texels, image::ImageFormat::Jpeg)
}

fn encoded(width: u32, height: u32, texels: &[[u8; 4]], format: image::ImageFormat) -> Vec<u8> {
    let image = image::RgbaImage::from_raw(width, height, texels.as_flattened().to_vec());
    let image = image::DynamicImage::from(image.expect("as many texels as width times height"));
    let image = match format {
        image::ImageFormat::Jpeg => image.into_rgb8().into(),
        _ => image,
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("room in memory");
    bytes.into_inner()
}
