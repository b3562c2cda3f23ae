//! The items of a file of jobs, in their order: job, scene, technique, light, camera, frame.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::balance::{Cost, run_of};
use super::cost::{FrameWork, load_cost};
use super::jobs::{Cameras, Choice, Job, JobFile, JobsError, Kind, LightEntry, LightTable, Lights};
use super::scene_file::{SceneFacts, scenes_in};
use super::shard::Shard;
use crate::light::LightOverrides;
use crate::scene::{LoadOptions, Scene};
use crate::shadow::Technique;

/// Frames of one view of one scene under one technique: they differ in their moment only.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// Its folder, below that of the results: `JOB/SCENE.LIGHT.CAMERA.TECHNIQUE`.
    pub name: String,
    /// The scene as the file of jobs names it.
    pub scene: String,
    /// The same from where this process runs.
    pub scene_path: PathBuf,
    /// By name or index.
    pub camera: Option<String>,
    /// By name or index; all of the scene's lights if absent.
    pub light: Option<String>,
    /// Changes to it, or to all.
    pub overrides: LightOverrides,
    /// With its options.
    pub technique: Technique,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Numbers of the frames.
    pub frames: Range<u32>,
    /// The moment of frame 0, seconds.
    pub start: f64,
    /// Frames per second.
    pub fps: f64,
    /// The shaded picture.
    pub picture: Kind,
    /// Each light's visibility.
    pub visibility: Kind,
    /// One colour is no failure.
    pub allow_uniform: bool,
    /// Measured frames.
    pub repeat: Option<u32>,
    /// Of each item, estimated.
    cost: Cost,
}

impl Sequence {
    /// The moment of a frame, seconds.
    pub fn time(&self, frame: u32) -> f64 {
        self.start + f64::from(frame) / self.fps
    }

    /// What its items cost, estimated.
    pub fn cost(&self) -> Cost {
        self.cost
    }
}

/// One frame.
#[derive(Clone, Copy, Debug)]
pub struct Item<'l> {
    /// What it is a frame of.
    pub sequence: &'l Sequence,
    /// The frame's number.
    pub frame: u32,
}

impl Item<'_> {
    /// Its name, and that of its files without their endings: `JOB/SCENE.../0007`.
    pub fn id(&self) -> String {
        format!("{}/{:04}", self.sequence.name, self.frame)
    }
}

/// All items, by number.
#[derive(Clone, Debug)]
pub struct List {
    sequences: Vec<Sequence>,
    /// The number of the first item of each sequence, and that of all items at the end.
    firsts: Vec<usize>,
}

impl List {
    /// The list of a file of jobs. Scenes are looked for in `folder`; their JSON is read, and a
    /// scene of which each light or camera is asked for is loaded.
    ///
    /// # Errors
    /// A folder or such a scene cannot be read, or two sequences would have the same name.
    pub fn new(file: &JobFile, path: &Path) -> Result<Self, JobsError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut list = Self {
            sequences: Vec::new(),
            firsts: vec![0],
        };
        let mut groups: HashMap<PathBuf, (u32, SceneFacts)> = HashMap::new();
        let mut names: HashMap<String, String> = HashMap::new();
        for job in &file.jobs {
            for given in &job.scenes {
                for scene_path in scenes_in(&folder.join(given))? {
                    let group = groups.len() as u32;
                    let (group, facts) = *groups
                        .entry(scene_path.clone())
                        .or_insert_with(|| (group, SceneFacts::read(&scene_path)));
                    let scene = shown(&scene_path, folder);
                    for sequence in views(job, &scene, &scene_path, facts, group)? {
                        let other = names.insert(sequence.name.clone(), scene.clone());
                        if let Some(other) = other {
                            return Err(JobsError::Job {
                                path: path.into(),
                                job: job.name.clone(),
                                reason: format!(
                                    "`{other}` and `{scene}` would both be written to `{}`; give \
                                     each a job of its own, or name it once",
                                    sequence.name
                                ),
                            });
                        }
                        list.push(sequence);
                    }
                }
            }
        }
        Ok(list)
    }

    fn push(&mut self, sequence: Sequence) {
        let first = self.firsts.last().copied().unwrap_or_default();
        self.firsts.push(first + sequence.frames.len());
        self.sequences.push(sequence);
    }

    /// Number of items.
    pub fn len(&self) -> usize {
        self.firsts.last().copied().unwrap_or_default()
    }

    /// No items at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// In order.
    pub fn sequences(&self) -> &[Sequence] {
        &self.sequences
    }

    /// The items of those numbers, in order; numbers beyond the list are left out.
    pub fn items(&self, numbers: Range<usize>) -> impl Iterator<Item = Item<'_>> {
        let places = self.sequences.iter().zip(&self.firsts);
        places.flat_map(move |(sequence, &first)| {
            let last = first + sequence.frames.len();
            let part = numbers.start.clamp(first, last)..numbers.end.clamp(first, last);
            let frames = part.map(move |at| sequence.frames.start + (at - first) as u32);
            frames.map(move |frame| Item { sequence, frame })
        })
    }

    /// The numbers of a shard's items.
    pub fn of_shard(&self, shard: Shard) -> Range<usize> {
        if shard == Shard::WHOLE {
            return 0..self.len();
        }
        let costs: Vec<Cost> = (self.items(0..self.len()))
            .map(|item| item.sequence.cost)
            .collect();
        run_of(&costs, shard)
    }
}

/// From the folder of the file of jobs, so that it is the same wherever that lies.
fn shown(scene: &Path, folder: &Path) -> String {
    scene
        .strip_prefix(folder)
        .unwrap_or(scene)
        .display()
        .to_string()
}

/// The sequences of one scene, all in one group.
fn views(
    job: &Job,
    scene: &str,
    scene_path: &Path,
    facts: SceneFacts,
    group: u32,
) -> Result<Vec<Sequence>, JobsError> {
    let (lights, cameras) = choices(job, scene_path)?;
    let size = job.size.value.0;
    let frames = job
        .frames
        .as_ref()
        .map_or(0..1, |frames| frames.value.0.clone());
    let mut found = Vec::new();
    for technique in &job.techniques {
        for light in &lights {
            for camera in &cameras {
                let work = FrameWork {
                    facts,
                    size,
                    lights: if light.name.is_some() {
                        1
                    } else {
                        facts.lights
                    },
                    technique: technique.value,
                    times: job.repeat.map_or(1, |repeat| u64::from(repeat) + 2),
                };
                let camera = camera.as_ref().map(Choice::text);
                let stem = scene_path.file_stem().unwrap_or_default().to_string_lossy();
                let parts = [
                    Some(stem.into_owned()),
                    Some(light.label()).filter(|_| job.lights.is_some()),
                    camera.clone(),
                    Some(technique.text.clone()),
                ];
                let parts: Vec<String> = parts.into_iter().flatten().map(|p| plain(&p)).collect();
                found.push(Sequence {
                    name: format!("{}/{}", job.name, parts.join(".")),
                    scene: scene.into(),
                    scene_path: scene_path.into(),
                    camera,
                    light: light.name.as_ref().map(Choice::text),
                    overrides: light.overrides(),
                    technique: technique.value,
                    size,
                    frames: frames.clone(),
                    start: job.time,
                    fps: job.fps,
                    picture: job.picture,
                    visibility: job.visibility,
                    allow_uniform: job.allow_uniform,
                    repeat: job.repeat,
                    cost: Cost {
                        item: work.cost(),
                        ready: load_cost(facts),
                        group,
                    },
                });
            }
        }
    }
    Ok(found)
}

type Choices = (Vec<LightTable>, Vec<Option<Choice>>);

fn choices(job: &Job, scene: &Path) -> Result<Choices, JobsError> {
    let each = matches!(job.lights, Some(Lights::Each(_)))
        || matches!(job.cameras, Some(Cameras::Each(_)));
    let loaded = match each {
        true => Some(Scene::load(scene, &LoadOptions::default())?),
        false => None,
    };
    // Names need not be unique, indices are.
    let light = |index: usize| LightTable {
        name: Some(Choice::Index(index as u32)),
        ..LightTable::default()
    };
    let lights = match (&job.lights, &loaded) {
        (None, _) => vec![LightTable::default()],
        (Some(Lights::List(list)), _) => (list.iter())
            .map(|entry| match entry {
                LightEntry::Plain(name) => LightTable {
                    name: Some(name.clone()),
                    ..LightTable::default()
                },
                LightEntry::Changed(table) => table.clone(),
            })
            .collect(),
        (Some(Lights::Each(_)), loaded) => {
            let lights = loaded.as_ref().map_or(0, |scene| scene.lights.len());
            (0..lights).map(light).collect()
        }
    };
    let cameras = match (&job.cameras, &loaded) {
        (None, _) => vec![None],
        (Some(Cameras::List(list)), _) => list.iter().cloned().map(Some).collect(),
        (Some(Cameras::Each(_)), loaded) => {
            let cameras = loaded.iter().flat_map(|scene| &scene.cameras);
            cameras
                .map(|camera| Some(Choice::Index(camera.index as u32)))
                .collect()
        }
    };
    Ok((lights, cameras))
}

/// What every file system takes.
fn plain(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=+,".contains(c);
    text.chars()
        .map(|c| if plain(c) { c } else { '_' })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    type Done = Result<(), Box<dyn std::error::Error>>;

    fn list(jobs: &str) -> Result<List, Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        for (name, text) in [
            (
                "a.gltf",
                r#"{"accessors": [{"count": 30}], "meshes": [{"primitives": [{"indices": 0}]}], "nodes": [{"mesh": 0}]}"#,
            ),
            ("b.gltf", "{}"),
        ] {
            fs::create_dir_all(folder.path().join("scenes"))?;
            fs::write(folder.path().join("scenes").join(name), text)?;
        }
        let path = folder.path().join("jobs.toml");
        fs::write(&path, jobs)?;
        Ok(List::new(&JobFile::read(&path)?, &path)?)
    }

    #[test]
    fn items_come_in_the_order_of_the_lists() -> Done {
        let list = list(
            "[[job]]\nname = \"sweep\"\nscenes = [\"scenes\"]\nframes = \"8..10\"\nfps = 4\n\
             techniques = [\"hard\", \"pcss:taps=8\"]\nlights = [\"lamp\", { size = \"2x0.5\" }]\n\
             [[job]]\nname = \"one\"\nscenes = [\"scenes/b.gltf\"]\ncameras = [\"the front\"]\n",
        )?;
        assert_eq!(list.len(), 2 * 2 * 2 * 2 + 1);
        let ids: Vec<String> = list.items(0..list.len()).map(|item| item.id()).collect();
        assert_eq!(ids[0], "sweep/a.lamp.hard/0008");
        assert_eq!(ids[1], "sweep/a.lamp.hard/0009");
        assert_eq!(ids[2], "sweep/a.all+size=2x0_5.hard/0008");
        assert_eq!(ids[4], "sweep/a.lamp.pcss_taps=8/0008");
        assert_eq!(ids[8], "sweep/b.lamp.hard/0008");
        assert_eq!(ids[16], "one/b.the_front.auto/0000");
        let middle: Vec<String> = list.items(3..9).map(|item| item.id()).collect();
        assert_eq!(middle, ids[3..9]);
        let first = &list.sequences()[0];
        assert_eq!(
            (first.scene.as_str(), first.time(9)),
            ("scenes/a.gltf", 2.25)
        );
        // One scene is one group, in whatever job.
        let groups: Vec<u32> = list.sequences().iter().map(|s| s.cost().group).collect();
        assert_eq!(groups, [0, 0, 0, 0, 1, 1, 1, 1, 1]);
        let shards = (1..=3).filter_map(|index| Shard::new(index, 3));
        let parts: Vec<_> = shards.map(|shard| list.of_shard(shard)).collect();
        assert_eq!((parts[0].start, parts[2].end), (0, 17));
        assert!(parts[0].end == parts[1].start && parts[1].end == parts[2].start);
        Ok(())
    }

    #[test]
    fn items_of_one_name_are_refused() {
        let error = list("[[job]]\nname = \"x\"\nscenes = [\"scenes\", \"scenes/a.gltf\"]\n");
        let error = error
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default();
        assert!(
            error.contains("job `x`") && error.contains("`x/a.auto`"),
            "{error}"
        );
    }
}
