//! The arguments that several commands share: what to look at, how large, under which lights.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Instant;

use clap::Args;

use super::error::CliError;
use crate::batch::Sequence;
use crate::capture::FrameRequest;
use crate::light::{
    LightOverrides, LightProfile, LightScale, LightSize, LightWeights, ShapeKind, SunAngle,
};
use crate::scene::{LoadOptions, Scene, SceneCamera, SceneFile, SceneLight};
use crate::shadow::Technique;
use crate::shadow::shaft_masks::ShaftOptions;

/// Largest width and height of a picture.
const MAX_SIDE: u32 = 16384;
/// Most pixels of a picture: a gigabyte in four floats each.
const MAX_PIXELS: u64 = 1 << 26;

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Size(pub(super) [u32; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| {
            let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
            let side: Option<u32> = text.parse().ok();
            side.filter(|side| digits && (1..=MAX_SIDE).contains(side))
        };
        let (width, height) = text.split_once(['x', 'X']).unwrap_or((text, ""));
        match (side(width), side(height)) {
            (Some(w), Some(h)) if u64::from(w) * u64::from(h) <= MAX_PIXELS => Ok(Self([w, h])),
            _ => Err(format!(
                "give WxH in pixels, such as 640x480, each from 1 to {MAX_SIDE} and at most \
                 {MAX_PIXELS} together"
            )),
        }
    }
}

fn parse_technique(text: &str) -> Result<Technique, String> {
    text.parse::<Technique>().map_err(|error| error.to_string())
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text
        .parse()
        .ok()
        .filter(|seconds: &f64| seconds.is_finite());
    seconds.ok_or_else(|| "give seconds, such as 1.5".into())
}

/// What to render.
#[derive(Debug, Args)]
pub(super) struct ViewArgs {
    /// Scene, a glTF 2.0 file
    #[arg(value_name = "SCENE.{glb,gltf}")]
    scene: PathBuf,

    /// Shadow technique with its options, see `antumbra techniques`
    #[arg(long, value_name = "NAME[:key=value,..]", default_value = "auto", value_parser = parse_technique)]
    technique: Technique,

    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    size: Size,

    /// Camera of the scene; the first one by default, and a view of the whole scene if it has none
    #[arg(long, value_name = "NAME|INDEX")]
    camera: Option<String>,

    /// Render with this light alone; all lights by default
    #[arg(long, value_name = "NAME|INDEX")]
    light: Option<String>,

    /// Moment of the scene's animation, in seconds after its start
    #[arg(
        long, value_name = "S", default_value = "0", value_parser = parse_seconds,
        allow_hyphen_values = true
    )]
    time: f64,

    #[command(flatten)]
    overrides: OverrideArgs,
}

const LIGHT_HEADING: &str = "Changes to --light, else to all lights of that kind";

/// Changes to lights. They apply to `--light`, else to all lights of that kind.
#[derive(Debug, Args)]
struct OverrideArgs {
    /// Shape instead of the file's: point, disk, rect, sphere or line
    #[arg(long, value_name = "SHAPE", help_heading = LIGHT_HEADING)]
    light_shape: Option<ShapeKind>,

    /// Size in metres: R of a disk or sphere, WxH of a rect, L of a line
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true, help_heading = LIGHT_HEADING)]
    light_size: Option<LightSize>,

    /// Factor on the size
    #[arg(long, value_name = "F", allow_hyphen_values = true, help_heading = LIGHT_HEADING)]
    light_scale: Option<LightScale>,

    /// Angular diameter of suns in degrees
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, help_heading = LIGHT_HEADING)]
    sun_angle: Option<SunAngle>,

    /// Brightness along a line from its start (-x) to its end: 2 to 8 numbers at equal distances, straight
    /// between, such as 0.2,1
    #[arg(long, value_name = "A,B,..", allow_hyphen_values = true, help_heading = LIGHT_HEADING)]
    light_profile: Option<LightProfile>,

    /// Brightness over a rect: a PNG or JPEG, its left side at -x and its top at +y, of grey values as they
    /// are; means over 16x16 parts where it is larger
    #[arg(long, value_name = "FILE", value_parser = weights_in, help_heading = LIGHT_HEADING)]
    light_weights: Option<Box<LightWeights>>,
}

fn weights_in(path: &str) -> Result<Box<LightWeights>, String> {
    LightWeights::read(std::path::Path::new(path)).map(Box::new)
}

/// A scene with the command line's changes, and the frame of it that was asked for.
pub(super) struct View {
    pub(super) scene: Scene,
    pub(super) request: FrameRequest,
    /// Reading the scene, in milliseconds.
    pub(super) load_ms: f64,
}

/// A scene file that has been read, to be seen at any moment.
pub(super) struct OpenScene {
    file: SceneFile,
    /// Reading the file, in milliseconds.
    pub(super) open_ms: f64,
}

impl OpenScene {
    /// False if it is the same at all times.
    pub(super) fn is_animated(&self) -> bool {
        self.file.is_animated()
    }
}

impl ViewArgs {
    /// As if a sequence's view had been asked for on the command line.
    pub(super) fn of_sequence(sequence: &Sequence) -> Self {
        let overrides = sequence.overrides;
        Self {
            scene: sequence.scene_path.clone(),
            technique: sequence.technique,
            size: Size(sequence.size),
            camera: sequence.camera.clone(),
            light: sequence.light.clone(),
            time: sequence.start,
            overrides: OverrideArgs {
                light_shape: overrides.shape,
                light_size: overrides.size,
                light_scale: overrides.scale,
                sun_angle: overrides.sun_angle,
                light_profile: overrides.profile,
                light_weights: overrides.weights.map(Box::new),
            },
        }
    }

    /// Sets an option of the technique.
    pub(super) fn set_option(&mut self, option: &str, value: &str) -> Result<(), CliError> {
        let set = self.technique.with_option(option, value);
        self.technique = set.map_err(|error| CliError::Usage(format!("--{option}: {error}")))?;
        Ok(())
    }

    /// Where the technique is to be chosen, takes the one that proves a bound and can be told how far to go.
    pub(super) fn choose_a_proof(&mut self) {
        if matches!(self.technique, Technique::Auto(_)) {
            self.technique = Technique::ShaftMasks(ShaftOptions::DEFAULT);
        }
    }

    pub(super) fn scene_path(&self) -> &PathBuf {
        &self.scene
    }

    /// `--time`, in seconds.
    pub(super) fn time(&self) -> f64 {
        self.time
    }

    /// Reads the scene file.
    pub(super) fn open(&self) -> Result<OpenScene, CliError> {
        let start = Instant::now();
        let options = LoadOptions::default();
        let file = SceneFile::open(&self.scene, &options).map_err(CliError::Scene)?;
        let open_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(OpenScene { file, open_ms })
    }

    /// Reads the scene as it is at `--time` and settles everything that the command line leaves to
    /// it.
    pub(super) fn load(&self) -> Result<View, CliError> {
        let opened = self.open()?;
        let mut view = self.at(&opened, self.time)?;
        view.load_ms += opened.open_ms;
        Ok(view)
    }

    /// As [`load`](Self::load), at any moment.
    pub(super) fn at(&self, opened: &OpenScene, seconds: f64) -> Result<View, CliError> {
        let start = Instant::now();
        let mut scene = opened.file.scene_at(seconds).map_err(CliError::Scene)?;
        let load_ms = start.elapsed().as_secs_f64() * 1e3;

        let camera = self.select_camera(&scene)?;
        let first = scene.select_light(None).map_err(CliError::Scene)?;
        let selected = match &self.light {
            Some(asked) => Some(scene.select_light(Some(asked)).map_err(CliError::Request)?),
            None => None,
        };
        let overrides = LightOverrides {
            shape: self.overrides.light_shape,
            size: self.overrides.light_size,
            scale: self.overrides.light_scale,
            sun_angle: self.overrides.sun_angle,
            profile: self.overrides.light_profile,
            weights: self.overrides.light_weights.as_deref().copied(),
        };
        scene
            .override_lights(&overrides, selected)
            .map_err(CliError::Request)?;
        let lights = match selected {
            Some(index) => vec![index],
            None => (first..scene.lights.len()).collect(),
        };
        check_shapes(&scene, &lights, self.technique)?;
        Ok(View {
            request: FrameRequest {
                camera,
                size: self.size.0,
                lights,
                technique: self.technique,
            },
            scene,
            load_ms,
        })
    }

    fn select_camera(&self, scene: &Scene) -> Result<SceneCamera, CliError> {
        let asked = self.camera.as_deref();
        let camera = scene.select_camera(asked);
        // Asked for nothing, a camera that cannot be used is the file's fault.
        camera.map_err(match asked {
            Some(_) => CliError::Request,
            None => CliError::Scene,
        })
    }
}

fn check_shapes(scene: &Scene, lights: &[usize], technique: Technique) -> Result<(), CliError> {
    for &index in lights {
        let SceneLight { name, light, .. } = &scene.lights[index];
        technique.check(light).map_err(|error| {
            let scene = scene.label();
            let remedy = "choose another with --technique, --light or --light-shape";
            CliError::Usage(format!(
                "{scene}: light {index} `{name}`: {error}; {remedy}"
            ))
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!("640x480".parse(), Ok(Size([640, 480])));
        assert_eq!("1X16384".parse(), Ok(Size([1, 16384])));
        assert_eq!("8192x8192".parse(), Ok(Size([8192, 8192])));
        for bad in [
            "",
            "x",
            "512",
            "0x1",
            "1x0",
            "-1x5",
            "+1x5",
            "1x1x1",
            "1.5x2",
            "8193x8192",
            "16385x1",
            "99999999999x1",
            " 1x1",
            "axb",
            "1x",
            "x1",
        ] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
    }
}
