//! One frame of a capture: rendered, perhaps measured, and turned into files.

use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

use serde_json::Value;

use super::error::CliError;
use super::outputs::{Format, ImageFile};
use super::report::{BoundEntry, ChosenEntry, ImageEntry, Measurements, PeakBytes, SetupTimes};
use super::summary::single_value;
use super::template::ImageTemplate;
use crate::capture::output::{Output, OutputError};
use crate::capture::{
    CapturedFrame, CapturedImage, FrameRenderer, FrameRequest, ImageContent, Samples, dump_file,
    exposure, exr, png,
};
use crate::scene::SceneLight;
use crate::shadow::Technique;

/// `NAME=FILE` of `--dump`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct DumpArg {
    pub(super) name: String,
    pub(super) file: ImageTemplate,
}

impl FromStr for DumpArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').filter(|(name, _)| !name.is_empty());
        let Some((name, file)) = parts else {
            return Err("give NAME=FILE, such as depth=depth.exr".into());
        };
        Ok(Self {
            name: name.into(),
            file: ImageTemplate::by_ending(file.into())?,
        })
    }
}

/// An image to write and where to.
#[derive(Clone, Debug)]
pub(super) struct Wanted {
    pub(super) content: Content,
    pub(super) file: ImageFile,
}

/// What an image shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// The shaded picture.
    Picture,
    /// Visibility of the light of that index.
    Visibility(usize),
    /// The same, as `--dump` writes it.
    DumpedVisibility(usize),
    /// The `--dump` of that place.
    Dump(usize),
}

/// How a frame is rendered.
pub(super) struct Plan<'a> {
    pub(super) number: u32,
    /// Its moment.
    pub(super) seconds: f64,
    /// What reading its scene and bringing it to the device took.
    pub(super) load_ms: f64,
    /// Warm-up and measured frames; `None` to render once.
    pub(super) repeats: Option<(u32, u32)>,
    /// Names of images to bring back.
    pub(super) dumps: Vec<&'a str>,
}

/// A rendered frame.
pub(super) struct Shot {
    pub(super) number: u32,
    pub(super) seconds: f64,
    pub(super) captured: CapturedFrame,
    pub(super) measured: Measurements,
    measured_static: Measurements,
    pub(super) is_measured: bool,
    pub(super) setup: SetupTimes,
    /// The frame's lights, in the order of the captured ones.
    pub(super) lights: Vec<SceneLight>,
    pub(super) technique: Technique,
    /// What was looked at, for people.
    pub(super) camera: String,
    peak: PeakBytes,
    /// Of each light.
    light_counters: Vec<BTreeMap<String, u64>>,
}

impl Shot {
    pub(super) fn take(
        plan: Plan<'_>,
        request: &FrameRequest,
        renderer: &mut FrameRenderer<'_>,
    ) -> Result<Self, CliError> {
        let mut captured = renderer.render_with_images(request, &plan.dumps)?;
        let first_frame = captured.frame_ms;
        let mut measured = Measurements::default();
        let mut measured_static = Measurements::default();
        match plan.repeats {
            None => measured.add(&captured),
            Some((warm_up, count)) => {
                // Measured frames are those that would be rendered without dumps.
                let images = std::mem::take(&mut captured.images);
                for number in 1..warm_up + count {
                    captured = renderer.render(request)?;
                    if number >= warm_up {
                        measured.add(&captured);
                    }
                }
                captured.images = images;
                // The first of them makes what the others keep.
                renderer.render_static(request)?;
                for _ in 0..count {
                    measured_static.add(&renderer.render_static(request)?);
                }
            }
        }
        let memory = renderer.gpu().memory_use();
        // After all that is measured: counting takes work of its own.
        let mut light_counters = vec![BTreeMap::new(); captured.lights.len()];
        if plan.repeats.is_some() {
            let counted = renderer.render_counted(request)?;
            light_counters = counted
                .lights
                .into_iter()
                .map(|light| light.counters)
                .collect();
        }
        let scene = renderer.scene();
        let lights = request.lights.iter();
        Ok(Self {
            number: plan.number,
            seconds: plan.seconds,
            measured,
            measured_static,
            is_measured: plan.repeats.is_some(),
            setup: SetupTimes {
                load: plan.load_ms,
                pipelines: None,
                first_frame,
            },
            lights: lights.map(|&light| scene.lights[light].clone()).collect(),
            technique: request.technique,
            camera: camera_text(request, scene.rebase_origin),
            peak: PeakBytes {
                device: memory.peak_device_bytes,
                host: memory.peak_host_bytes,
            },
            captured,
            light_counters,
        })
    }

    /// A picture of one single colour is what a broken set-up looks like.
    pub(super) fn refuse_single_value(&self) -> Result<(), CliError> {
        match single_value(&self.captured.color) {
            Some(value) => Err(CliError::Uniform { value }),
            None => Ok(()),
        }
    }

    /// A bound that was asked for and not reached is a failure: the files would not be what they say.
    pub(super) fn refuse_missed_bound(&self) -> Result<(), CliError> {
        for (captured, light) in self.captured.lights.iter().zip(&self.lights) {
            if let Some([asked, reached]) = self.technique.missed_bound(&captured.counters) {
                let light = light.name.clone();
                return Err(CliError::Bound {
                    light,
                    asked,
                    reached,
                });
            }
        }
        Ok(())
    }

    /// The report's entries: one a light.
    pub(super) fn entries<'s>(
        &'s self,
        scene: &'s Path,
        driver: &'s str,
    ) -> impl Iterator<Item = ImageEntry> + 's {
        let (frame, measured) = (&self.captured, &self.measured);
        let lights = frame.lights.iter().zip(&self.lights);
        let lights = lights.zip(&self.light_counters).enumerate();
        lights.map(move |(at, ((light, scene_light), counters))| ImageEntry {
            scene: scene.display().to_string(),
            frame: u64::from(self.number),
            light: scene_light.name.clone(),
            technique: light.choice.technique.name(),
            options: options(light.choice.technique),
            chosen: (self.technique != light.choice.technique).then(|| ChosenEntry {
                by: self.technique.name(),
                spec: light.choice.spec(),
                reason: light.choice.reason.clone(),
                expected_rmse: light.choice.expected.map(|expected| expected.rmse),
                expected_ms: light.choice.expected.map(|expected| expected.ms),
            }),
            driver: driver.to_owned(),
            width: frame.size[0],
            height: frame.size[1],
            frame_ms: measured.frame(),
            frame_ms_static: self.measured_static.frame(),
            visibility_ms: measured.sum_of(&light.passes),
            passes: measured.passes(frame),
            setup_ms: self.setup,
            peak_bytes: self.peak,
            counters: frame
                .counters
                .iter()
                .chain(counters)
                .map(|(k, n)| (k.clone(), *n))
                .collect(),
            remark: light.choice.technique.remark(counters),
            // It is the first light's.
            bound: self.bound().filter(|_| at == 0),
        })
    }

    /// Of the image of bounds, if there is one.
    fn bound(&self) -> Option<BoundEntry> {
        let mut images = self.captured.images.iter();
        let image = images.find(|image| image.name == "visibility_bound")?;
        match image.planes.first()? {
            Samples::Float(values) => BoundEntry::of(values),
            Samples::Uint(_) => None,
        }
    }

    /// The bytes of a file.
    pub(super) fn encode(&self, wanted: &Wanted) -> Result<(Output, Vec<u8>), CliError> {
        let format = wanted.file.format;
        let bytes = match wanted.content {
            Content::Picture => self.encode_picture(format)?,
            Content::Visibility(light) => {
                let [width, height] = self.captured.size;
                let values = self.visibility(light);
                match format {
                    Format::Exr => exr::encode_y(width, height, values)?,
                    Format::Png => png::encode_grey16(width, height, values)?,
                }
            }
            Content::DumpedVisibility(light) => {
                let [width, height] = self.captured.size;
                let image = CapturedImage {
                    name: "visibility".into(),
                    width,
                    height,
                    layers: vec![0],
                    content: ImageContent::Values,
                    planes: vec![Samples::Float(self.visibility(light).to_vec())],
                };
                encode_dump(&image, format)?
            }
            Content::Dump(at) => encode_dump(&self.captured.images[at], format)?,
        };
        Ok((Output::from(wanted.file.path.clone()), bytes))
    }

    /// The renderer makes the visibility of every light that it was asked for.
    fn visibility(&self, light: usize) -> &[f32] {
        let mut lights = self.captured.lights.iter();
        let found = lights.find(|captured| captured.light == light);
        found.map(|light| &light.visibility[..]).unwrap_or_default()
    }

    fn encode_picture(&self, format: Format) -> Result<Vec<u8>, OutputError> {
        let frame = &self.captured;
        let [width, height] = frame.size;
        let scale = match format {
            Format::Png => exposure(&frame.color),
            Format::Exr => 1.0,
        };
        let rgb: Vec<[f32; 3]> = (frame.color.iter())
            .map(|pixel| [pixel[0] * scale, pixel[1] * scale, pixel[2] * scale])
            .collect();
        match format {
            Format::Png => png::encode_linear_rgb(width, height, &rgb),
            Format::Exr => exr::encode_rgb(width, height, &rgb),
        }
    }
}

/// Every option with its value, numbers as such.
fn options(technique: Technique) -> BTreeMap<String, Value> {
    let values = technique.option_values().into_iter();
    let json = values.map(|(name, value)| {
        let number = value.parse().ok().filter(|v: &f64| v.is_finite());
        let json = match (value.parse::<u64>(), number) {
            (Ok(whole), _) => Value::from(whole),
            (_, Some(number)) => Value::from(number),
            _ => Value::from(value),
        };
        (name.to_string(), json)
    });
    json.collect()
}

fn encode_dump(image: &CapturedImage, format: Format) -> Result<Vec<u8>, OutputError> {
    match format {
        Format::Exr => dump_file::to_exr(image.clone()),
        Format::Png => dump_file::to_png(image),
    }
}

fn camera_text(request: &FrameRequest, rebase_origin: glam::DVec3) -> String {
    let camera = &request.camera;
    if camera.node.is_some() {
        return format!("{} `{}`", camera.index, camera.name);
    }
    let eye = camera.position.as_dvec3() + rebase_origin;
    let forward = camera.forward;
    format!(
        "none in the scene; the whole of it from ({:.4}, {:.4}, {:.4}) along ({:.4}, {:.4}, {:.4}), \
         yfov {:.4} radians",
        eye.x, eye.y, eye.z, forward.x, forward.y, forward.z, camera.yfov
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dumps_are_a_name_and_a_file() {
        let parse = |text: &str| text.parse::<DumpArg>();
        let map = parse("hard.map_depth 0:lamp[2]=a=b.exr");
        let map = map.map(|dump| (dump.name, dump.file.text()));
        assert_eq!(
            map,
            Ok(("hard.map_depth 0:lamp[2]".into(), "a=b.exr".into()))
        );
        for bad in [
            "",
            "depth",
            "=a.exr",
            "depth=",
            "depth=a.jpg",
            "depth=-",
            "depth=a{frame:}.exr",
        ] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
