//! Lights: KHR_lights_punctual with the shape in `extras`, and the EXT_lights_area draft.

use glam::Vec3;
use gltf::Document;
use gltf::khr_lights_punctual::{Kind, Light};
use serde_json::{Map, Value};

use super::document::{AreaLightJson, Side};
use super::nodes::{self, Keep, PlacedNode};
use super::{Scene, SceneError, Source, element, shorten};
use crate::light::{
    AreaLight, DEFAULT_SUN_ANGLE, IntensityUnit, LightShape, LightWeights, SpotCone,
};
use crate::scene::SceneLight;

/// What a light is apart from where it is.
struct Emitter {
    name: Option<String>,
    shape: LightShape,
    color: [f32; 3],
    intensity: f32,
    unit: IntensityUnit,
    range: Option<f32>,
    spot: Option<SpotCone>,
    weights: LightWeights,
}

/// Adds the lights of all nodes, in document order.
pub(super) fn add(
    scene: &mut Scene,
    source: Source<'_>,
    document: &Document,
    side: &Side,
    placed: &[PlacedNode],
) -> Result<(), SceneError> {
    let area_lights = (side.extensions.as_ref())
        .and_then(|extensions| extensions.area_lights.as_ref())
        .map_or(&[][..], |area| &area.lights);
    for node in placed {
        let invalid = |reason: String| {
            source.invalid(element("node", node.index, node.name.as_deref()), reason)
        };
        let area = (side.nodes.get(node.index))
            .and_then(|node| node.extensions.as_ref()?.area_light.as_ref());
        // An area light says more than a punctual one on the same node, so it is the one.
        let emitter = if let Some(reference) = area {
            let light = area_lights.get(reference.light).ok_or_else(|| {
                invalid(format!(
                    "EXT_lights_area light {} is missing",
                    reference.light
                ))
            })?;
            from_area(light, nodes::largest_scale(node.world.matrix3)).map_err(invalid)?
        } else if let Some(light) = document
            .nodes()
            .nth(node.index)
            .and_then(|node| node.light())
        {
            from_punctual(&light).map_err(invalid)?
        } else {
            continue;
        };
        let name = [node.name.as_deref(), emitter.name.as_deref()]
            .into_iter()
            .flatten()
            .find(|name| !name.is_empty())
            .map_or_else(|| format!("light {}", scene.lights.len()), Into::into);
        let frame = nodes::frame(node.world.matrix3, Keep::X);
        let center = (node.world.translation - scene.rebase_origin).as_vec3();
        let direction = -frame.z_axis.as_vec3();
        let light = AreaLight {
            color: Vec3::from_array(emitter.color),
            intensity: emitter.intensity,
            unit: emitter.unit,
            range: emitter.range,
            spot: emitter.spot,
            weights: emitter.weights,
            ..AreaLight::new(emitter.shape, center, direction, frame.x_axis.as_vec3())
        };
        light.validate().map_err(|error| SceneError::Light {
            file: source.label(),
            light: shorten(&name),
            source: error,
        })?;
        scene.lights.push(SceneLight {
            name,
            node: Some(node.index),
            light,
        });
    }
    Ok(())
}

fn from_area(light: &AreaLightJson, scale: f64) -> Result<Emitter, String> {
    let size = light.size.unwrap_or(1.0) * scale;
    let aspect = light
        .rect
        .as_ref()
        .and_then(|rect| rect.aspect)
        .unwrap_or(1.0);
    Ok(Emitter {
        name: light.name.clone(),
        shape: match light.kind.as_str() {
            "rect" => LightShape::Rect {
                width: (size * aspect) as f32,
                height: size as f32,
            },
            "disk" => LightShape::Disk {
                radius: (0.5 * size) as f32,
            },
            other => {
                return Err(format!(
                    "EXT_lights_area light of type `{}`; it must be `rect` or `disk`",
                    shorten(other)
                ));
            }
        },
        color: light.color.unwrap_or([1.0; 3]),
        intensity: light.intensity.unwrap_or(1000.0),
        unit: IntensityUnit::Nits,
        range: None,
        spot: None,
        weights: LightWeights::EVEN,
    })
}

fn from_punctual(light: &Light<'_>) -> Result<Emitter, String> {
    let extras = extras(light)?;
    let mut emitter = Emitter {
        name: light.name().map(Into::into),
        shape: LightShape::Point,
        color: light.color(),
        intensity: light.intensity(),
        unit: IntensityUnit::Candela,
        range: light.range(),
        spot: None,
        weights: weights(&extras)?,
    };
    match light.kind() {
        Kind::Directional => {
            let degrees = number(&extras, "angular_diameter_deg")?;
            emitter.shape = LightShape::Sun {
                angular_diameter: degrees
                    .map_or(DEFAULT_SUN_ANGLE, |degrees| degrees.to_radians() as f32),
            };
            emitter.unit = IntensityUnit::Lux;
            emitter.range = None;
        }
        Kind::Point => emitter.shape = shape(&extras)?,
        Kind::Spot {
            inner_cone_angle,
            outer_cone_angle,
        } => {
            emitter.shape = shape(&extras)?;
            // Exporters write inner = outer for a hard edge, and 90 degrees with rounding.
            let outer = outer_cone_angle.min(std::f32::consts::FRAC_PI_2);
            emitter.spot = Some(SpotCone {
                inner: inner_cone_angle.clamp(0.0, outer.max(0.0)),
                outer,
            });
        }
    }
    Ok(emitter)
}

/// The light's `extras` if they are an object; other programs may put anything there.
fn extras(light: &Light<'_>) -> Result<Map<String, Value>, String> {
    let Some(raw) = light.extras() else {
        return Ok(Map::new());
    };
    match serde_json::from_str(raw.get()) {
        Ok(Value::Object(map)) => Ok(map),
        Ok(_) => Ok(Map::new()),
        Err(error) => Err(format!("the extras of its light cannot be read: {error}")),
    }
}

fn shape(extras: &Map<String, Value>) -> Result<LightShape, String> {
    let Some(shape) = extras.get("shape") else {
        return Ok(LightShape::Point);
    };
    let size = |key: &str| -> Result<f32, String> {
        match number(extras, key)? {
            Some(metres) => Ok(metres as f32),
            None => Err(format!("its light has a shape without `{key}`")),
        }
    };
    match shape.as_str() {
        Some("point") => Ok(LightShape::Point),
        Some("disk") => Ok(LightShape::Disk {
            radius: size("radius")?,
        }),
        Some("rect") => Ok(LightShape::Rect {
            width: size("width")?,
            height: size("height")?,
        }),
        Some("sphere") => Ok(LightShape::Sphere {
            radius: size("radius")?,
        }),
        Some("line") => Ok(LightShape::Line {
            length: size("length")?,
        }),
        _ => Err(format!(
            "its light has the shape {}; it must be \"disk\", \"rect\", \"sphere\" or \"line\"",
            shorten(&shape.to_string())
        )),
    }
}

/// `"weights": [[1, 0], [0, 1]]`: brightness over a rectangle, rows from the top.
fn weights(extras: &Map<String, Value>) -> Result<LightWeights, String> {
    let Some(value) = extras.get("weights") else {
        return Ok(LightWeights::EVEN);
    };
    let row = |row: &Value| -> Option<Vec<f32>> {
        let numbers = row.as_array()?.iter();
        numbers.map(|v| v.as_f64().map(|v| v as f32)).collect()
    };
    let rows: Option<Vec<Vec<f32>>> =
        (value.as_array()).and_then(|rows| rows.iter().map(row).collect());
    rows.filter(|rows| rows.windows(2).all(|pair| pair[0].len() == pair[1].len()))
        .and_then(|rows| LightWeights::new(rows.first()?.len(), &rows.concat()))
        .ok_or_else(|| {
            format!(
                "`weights` of its light is {}; give rows of equally many numbers of 0 or more, not all 0",
                shorten(&value.to_string())
            )
        })
}

fn number(extras: &Map<String, Value>, key: &str) -> Result<Option<f64>, String> {
    match extras.get(key) {
        None => Ok(None),
        Some(value) => value.as_f64().map(Some).ok_or_else(|| {
            format!(
                "`{key}` of its light is {}, not a number",
                shorten(&value.to_string())
            )
        }),
    }
}
