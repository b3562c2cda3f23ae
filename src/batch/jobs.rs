//! Jobs as a TOML file: scenes x techniques x lights x cameras x frames.

use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Deserializer, de};

use crate::light::{LightOverrides, LightProfile, LightScale, LightSize, ShapeKind, SunAngle};
use crate::scene::SceneError;
use crate::shadow::Technique;

/// Largest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct JobFile {
    #[serde(rename = "job")]
    pub jobs: Vec<Job>,
}

/// One `[[job]]`: each scene with each technique, light, camera and frame.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Job {
    /// The folder of its images.
    pub name: String,
    /// glTF files and folders of them, from the folder of the file.
    pub scenes: Vec<String>,
    /// Techniques with their options, as on the command line.
    #[serde(default = "automatic")]
    pub techniques: Vec<Text<Technique>>,
    /// Absent: all of a scene's lights in one frame.
    pub lights: Option<Lights>,
    /// Absent: a scene's first camera, or all of the scene seen.
    pub cameras: Option<Cameras>,
    /// Absent: one frame at `time`.
    pub frames: Option<Text<Frames>>,
    /// Frames per second.
    #[serde(default = "thirty")]
    pub fps: f64,
    /// The moment of frame 0, seconds.
    #[serde(default)]
    pub time: f64,
    /// Pixels.
    #[serde(default = "small")]
    pub size: Text<Pixels>,
    /// Format of the shaded picture.
    #[serde(default = "png")]
    pub picture: Kind,
    /// Format of the visibility of each light.
    #[serde(default)]
    pub visibility: Kind,
    /// A picture of one single colour is no failure.
    #[serde(default)]
    pub allow_uniform: bool,
    /// Measured frames after two that are not; absent, each is rendered once.
    pub repeat: Option<u32>,
}

/// What is written of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Kind {
    #[default]
    None,
    Png,
    Exr,
}

impl Kind {
    /// The ending of its files.
    pub fn ending(self) -> Option<&'static str> {
        match self {
            Self::None => None,
            Self::Png => Some("png"),
            Self::Exr => Some("exr"),
        }
    }
}

/// `"each"`, or a list.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "give \"each\", or a list of cameras by name or index"
)]
#[allow(missing_docs)]
pub enum Cameras {
    Each(Each),
    List(Vec<Choice>),
}

/// `"each"`, or a list.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "give \"each\", or a list of lights, each by name, index or as { name, shape, size, scale, sun-angle, profile }"
)]
#[allow(missing_docs)]
pub enum Lights {
    Each(Each),
    List(Vec<LightEntry>),
}

/// All of them, each by itself.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Each {
    Each,
}

/// By name or by index.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
#[allow(missing_docs)]
pub enum Choice {
    Index(u32),
    Name(String),
}

impl Choice {
    /// As on the command line.
    pub fn text(&self) -> String {
        match self {
            Self::Index(index) => index.to_string(),
            Self::Name(name) => name.clone(),
        }
    }
}

/// A light, perhaps with changes.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
#[allow(missing_docs)]
pub enum LightEntry {
    Plain(Choice),
    Changed(LightTable),
}

/// A light with changes; without a name, all lights.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[allow(missing_docs)]
pub struct LightTable {
    pub name: Option<Choice>,
    pub shape: Option<Text<ShapeKind>>,
    pub size: Option<Text<LightSize>>,
    pub scale: Option<f32>,
    pub sun_angle: Option<f32>,
    pub profile: Option<Text<LightProfile>>,
}

impl LightTable {
    /// The changes.
    pub fn overrides(&self) -> LightOverrides {
        LightOverrides {
            shape: self.shape.as_ref().map(|shape| shape.value),
            size: self.size.as_ref().map(|size| size.value),
            scale: self.scale.map(LightScale),
            sun_angle: self.sun_angle.map(SunAngle),
            profile: self.profile.as_ref().map(|profile| profile.value),
            weights: None,
        }
    }

    /// For the names of folders: `lamp+size=0.5`.
    pub fn label(&self) -> String {
        let mut label = self.name.as_ref().map_or("all".into(), Choice::text);
        let parts = [
            ("shape", self.shape.as_ref().map(|shape| shape.text.clone())),
            ("size", self.size.as_ref().map(|size| size.text.clone())),
            ("scale", self.scale.map(|scale| scale.to_string())),
            ("sun", self.sun_angle.map(|angle| angle.to_string())),
            ("profile", self.profile.as_ref().map(|p| p.text.clone())),
        ];
        for (name, part) in parts {
            if let Some(part) = part {
                label.push_str(&format!("+{name}={part}"));
            }
        }
        label
    }
}

/// A value that is written as text, with that text.
#[derive(Clone, Debug, PartialEq)]
pub struct Text<T> {
    /// The value.
    pub value: T,
    /// As it was written.
    pub text: String,
}

impl<T: FromStr> FromStr for Text<T> {
    type Err = T::Err;

    fn from_str(text: &str) -> Result<Self, T::Err> {
        let value = text.parse()?;
        Ok(Self {
            value,
            text: text.into(),
        })
    }
}

impl<'de, T: FromStr<Err: std::fmt::Display>> Deserialize<'de> for Text<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse()
            .map_err(|error| de::Error::custom(format!("`{text}`: {error}")))
    }
}

/// `A..B`: frames A to B - 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames(pub Range<u32>);

impl FromStr for Frames {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, &'static str> {
        let range = text.split_once("..").and_then(|(first, end)| {
            let number = |text: &str| {
                let digits = text.bytes().all(|byte| byte.is_ascii_digit());
                text.parse().ok().filter(|_| digits)
            };
            Some(number(first)?..number(end)?)
        });
        match range {
            Some(range) if !range.is_empty() => Ok(Self(range)),
            _ => Err("give A..B with B above A for the frames A to B - 1, such as 0..24"),
        }
    }
}

/// `WxH`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pixels(pub [u32; 2]);

impl FromStr for Pixels {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| {
            let digits = text.bytes().all(|byte| byte.is_ascii_digit());
            let side = text.parse().ok();
            side.filter(|side| digits && (1..=MAX_SIDE).contains(side))
        };
        let sides = text.split_once('x');
        let sides = sides.and_then(|(width, height)| Some([side(width)?, side(height)?]));
        let wrong = || format!("give WxH in pixels, such as 640x480, each from 1 to {MAX_SIDE}");
        sides.map(Self).ok_or_else(wrong)
    }
}

fn automatic() -> Vec<Text<Technique>> {
    "auto".parse().into_iter().collect()
}

fn thirty() -> f64 {
    30.0
}

fn small() -> Text<Pixels> {
    Text {
        value: Pixels([512, 512]),
        text: "512x512".into(),
    }
}

fn png() -> Kind {
    Kind::Png
}

/// Why there is no list of items.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum JobsError {
    #[error("{}: cannot be read: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// No TOML, or an entry that is not known or of the wrong form.
    #[error("{}: {reason}", path.display())]
    Form { path: PathBuf, reason: String },
    /// Values that do not go together.
    #[error("{}: job `{job}`: {reason}", path.display())]
    Job {
        path: PathBuf,
        job: String,
        reason: String,
    },
    #[error("{}: cannot list the scenes: {source}", path.display())]
    Folder { path: PathBuf, source: io::Error },
    #[error("{}: the folder has no .glb or .gltf file", path.display())]
    EmptyFolder { path: PathBuf },
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl JobFile {
    /// Reads and checks the file; scenes are not opened.
    ///
    /// # Errors
    /// [`JobsError`], with file, line and what is wrong.
    pub fn read(path: &Path) -> Result<Self, JobsError> {
        let text = fs::read_to_string(path);
        let text = text.map_err(|source| JobsError::Read {
            path: path.into(),
            source,
        })?;
        let file = Self::parse(&text);
        let file = file.map_err(|reason| JobsError::Form {
            path: path.into(),
            reason,
        })?;
        for (at, job) in file.jobs.iter().enumerate() {
            let before = &file.jobs[..at];
            if let Some(reason) = job.fault(before) {
                let job = job.name.clone();
                return Err(JobsError::Job {
                    path: path.into(),
                    job,
                    reason,
                });
            }
        }
        Ok(file)
    }

    fn parse(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            let line = text
                .get(..at)
                .map_or(1, |before| before.matches('\n').count() + 1);
            format!("line {line}: {}", error.message())
        })
    }
}

impl Job {
    fn fault(&self, before: &[Self]) -> Option<String> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let empty = |what: &str| Some(format!("`{what}` is empty; name one, or leave it out"));
        if self.name.is_empty() || !self.name.chars().all(is_plain) {
            Some("a name is of letters, digits, - and _: it becomes a folder".into())
        } else if before.iter().any(|other| other.name == self.name) {
            Some("two jobs have this name".into())
        } else if self.scenes.is_empty() {
            empty("scenes")
        } else if self.techniques.is_empty() {
            empty("techniques")
        } else if matches!(&self.lights, Some(Lights::List(list)) if list.is_empty()) {
            empty("lights")
        } else if matches!(&self.cameras, Some(Cameras::List(list)) if list.is_empty()) {
            empty("cameras")
        } else if !(self.fps > 0.0 && self.fps.is_finite() && self.time.is_finite()) {
            Some("`fps` has to be above 0, `time` a number of seconds".into())
        } else if self.repeat == Some(0) {
            Some("`repeat` has to be 1 or more".into())
        } else if self.picture == Kind::None && self.visibility == Kind::None {
            Some("neither `picture` nor `visibility` is written; ask for one".into())
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_has_defaults_and_lists() -> Result<(), String> {
        let file = JobFile::parse(
            "[[job]]\nname = \"a\"\nscenes = [\"x.glb\"]\n[[job]]\nname = \"b\"\nscenes = [\"y\"]\n\
             techniques = [\"hard\", \"pcss:taps=8\"]\ncameras = [\"front\", 1]\nsize = \"64x32\"\n\
             lights = [\"lamp\", 2, { name = \"lamp\", size = \"0.5\", shape = \"disk\" }]\n\
             frames = \"3..5\"\npicture = \"exr\"\nvisibility = \"png\"\n",
        )?;
        let [a, b] = &file.jobs[..] else {
            return Err("two jobs".into());
        };
        assert!(a.lights.is_none() && a.frames.is_none() && a.techniques.len() == 1);
        assert_eq!((a.picture, a.visibility), (Kind::Png, Kind::None));
        assert_eq!(b.techniques[1].text, "pcss:taps=8");
        assert_eq!(b.size.value, Pixels([64, 32]));
        assert_eq!(
            b.frames.as_ref().map(|frames| frames.value.0.clone()),
            Some(3..5)
        );
        let Some(Lights::List(lights)) = &b.lights else {
            return Err("lights".into());
        };
        let LightEntry::Changed(table) = &lights[2] else {
            return Err("a table".into());
        };
        assert_eq!(table.label(), "lamp+shape=disk+size=0.5");
        assert!(b.fault(&file.jobs[..1]).is_none());
        assert!(
            b.fault(&file.jobs[1..])
                .is_some_and(|reason| reason.contains("two jobs"))
        );
        Ok(())
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let with = |line: &str| {
            let text = format!("[[job]]\nname = \"a\"\nscenes = [\"x.glb\"]\n{line}\n");
            JobFile::parse(&text).err().unwrap_or_default()
        };
        for (line, part) in [
            ("tecniques = []", "unknown field `tecniques`"),
            ("techniques = [\"soft\"]", "unknown technique `soft`"),
            ("frames = \"5..5\"", "A..B"),
            ("size = \"64\"", "WxH"),
            ("size = \"0x64\"", "WxH"),
            ("lights = \"all\"", "give \"each\""),
            ("picture = \"jpg\"", "jpg"),
            ("name = \"b\"", "duplicate"),
        ] {
            let error = with(line);
            assert!(
                error.contains(part) && error.starts_with("line 4"),
                "{line}: {error}"
            );
        }
        let none = JobFile::parse("").err().unwrap_or_default();
        assert!(none.contains("job"), "{none}");
    }
}
