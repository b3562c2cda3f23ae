//! One scene under one light, with all contenders.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::cell::{Cell, GpuRunner, RivalRunner, Runner, measure_in_turn};
use super::contender::{Contender, ContenderError, Method};
use super::pictures;
use super::results::{
    CaseEntry, Entry, Failure, FailureKind, ReferenceEntry, StandardError, rounded,
};
use super::rival::{Engine, Rival};
use crate::capture::FrameRequest;
use crate::capture::output::{Output, OutputError};
use crate::gpu::Gpu;
use crate::light::{LightOverrides, LightScale};
use crate::measure::{PENUMBRA, measure};
use crate::message::line;
use crate::reference::{Cache, Reference, ReferenceError, Sampling, Settings, Truth};
use crate::renderer::{NamedLight, SceneBuffers, cases};
use crate::scene::{LoadOptions, Scene, SceneCamera, SceneError, SceneLight};
use crate::stress;

/// What to measure in one process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// The scene file; of a suite's scene its name.
    pub scene: PathBuf,
    /// Place in [`stress::suite`], for a scene that is no file.
    pub case: Option<usize>,
    /// Index into [`Scene::lights`].
    pub light: usize,
    /// The light's name, for messages.
    pub light_name: String,
    /// Factor on its size, 1e-6 to 1e6.
    pub light_scale: f32,
    /// Camera by name or index; the first one by default.
    pub camera: Option<String>,
    /// Labels of the contenders.
    pub contenders: Vec<String>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rounds.
    pub repeat: u32,
    /// Light samples of the truth.
    pub samples: u32,
    /// A cell whose rounds took this long together is not measured again, seconds.
    pub cell_seconds: f64,
    /// Vulkan device by name or index; the first that fits by default.
    pub device: Option<String>,
    /// The folder of the results.
    pub out: PathBuf,
    /// Cells that are not to be tried again, and why.
    pub dead: Vec<(String, Failure)>,
}

/// What came of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupResult {
    /// The truth.
    pub reference: ReferenceEntry,
    /// The cells, in the order of the contenders.
    pub entries: Vec<Entry>,
}

/// Why a job has no result at all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GroupError {
    /// The scene cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene has changed.
    #[error("{scene}: light {light} is gone")]
    NoLight {
        /// The scene.
        scene: String,
        /// Index.
        light: usize,
    },
    /// The suite has changed.
    #[error("the suite has no scene {case}")]
    NoCase {
        /// Place in the suite.
        case: usize,
    },
    /// A label that is no contender.
    #[error(transparent)]
    Contender(#[from] ContenderError),
    /// No truth.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// A picture cannot be encoded.
    #[error("picture: {0}")]
    Picture(#[from] image::ImageError),
    /// A picture cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl Job {
    /// The beginning of the names of its pictures, the same for the same scene and light.
    fn stem(&self) -> String {
        let name = self.scene.file_stem().unwrap_or_default().to_string_lossy();
        let name: String = (name.chars().take(40))
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        // Scenes of different folders may share a name. FNV-1a.
        let path = self.scene.as_os_str().as_encoded_bytes();
        let hash = path.iter().fold(0x811c_9dc5_u32, |hash, &byte| {
            (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
        });
        format!("images/{name}-{hash:08x}-{}", self.light)
    }

    fn write(&self, name: &str, png: &[u8]) -> Result<(), OutputError> {
        Output::File(self.out.join(name)).write(png)
    }
}

/// Runs a job in this process. `on_step` is told a contender's label before anything is done with
/// it; `on_device` is given each new Vulkan device.
///
/// # Errors
/// [`GroupError`]. What a single cell has to say is in its entry instead.
pub fn run(
    job: &Job,
    on_step: &dyn Fn(&str),
    on_device: &dyn Fn(&mut Gpu),
) -> Result<GroupResult, GroupError> {
    let (scene, camera) = open(job)?;
    let Some(light) = scene.lights.get(job.light) else {
        return Err(GroupError::NoLight {
            scene: scene.label(),
            light: job.light,
        });
    };
    let contenders = (job.contenders.iter())
        .map(|label| label.parse())
        .collect::<Result<Vec<Contender>, _>>()?;
    let (truth, reference) = cast_truth(job, &scene, &camera, light)?;

    let mut engines = Engines {
        scene: &scene,
        built: Vec::new(),
    };
    let mut cells: Vec<Cell<'_>> = Vec::new();
    for contender in &contenders {
        let dead = job.dead.iter().find(|(label, _)| *label == contender.label);
        let runner = match dead {
            Some((_, failure)) => Err(failure.clone()),
            None => runner(job, &mut engines, &camera, light, contender, on_device),
        };
        cells.push(Cell::new(&contender.label, runner));
    }
    measure_in_turn(&mut cells, job.repeat, job.cell_seconds, on_step);

    let mut entries = Vec::new();
    for (at, (cell, contender)) in cells.iter().zip(&contenders).enumerate() {
        entries.push(entry(job, light, &truth, at, cell, contender)?);
    }
    Ok(GroupResult { reference, entries })
}

fn open(job: &Job) -> Result<(Scene, SceneCamera), GroupError> {
    if let Some(case) = job.case {
        let found = stress::suite().into_iter().nth(case);
        let found = found.ok_or(GroupError::NoCase { case })?;
        return Ok((found.scene, found.camera));
    }
    let mut scene = Scene::load(&job.scene, &LoadOptions::default())?;
    let camera = scene.select_camera(job.camera.as_deref())?;
    if job.light_scale != 1.0 && job.light < scene.lights.len() {
        let overrides = LightOverrides {
            scale: Some(LightScale(job.light_scale)),
            ..LightOverrides::default()
        };
        scene.override_lights(&overrides, Some(job.light))?;
    }
    Ok((scene, camera))
}

fn cast_truth(
    job: &Job,
    scene: &Scene,
    camera: &SceneCamera,
    light: &SceneLight,
) -> Result<(Truth, ReferenceEntry), GroupError> {
    let sampling = Sampling::samples(job.samples);
    let settings = Settings {
        camera,
        size: job.size,
        light: &light.light,
        sampling: &sampling,
    };
    let start = Instant::now();
    let (truth, is_kept) = match Cache::of_user() {
        Some(cache) => cache.render(scene, &settings, &|_| {})?,
        None => (Reference::new(scene)?.render(&settings, &|_| {})?, false),
    };
    let cast_ms = (!is_kept).then(|| rounded(start.elapsed().as_secs_f64() * 1e3));
    let measures = measure(&truth.visibility, &truth.visibility, &truth.valid);
    let measures = measures.unwrap_or_default();
    let (image, valid_image) = (
        format!("{}-truth.png", job.stem()),
        format!("{}-valid.png", job.stem()),
    );
    let valid: Vec<f32> = (truth.valid.iter())
        .map(|&valid| f32::from(u8::from(valid)))
        .collect();
    job.write(&image, &pictures::grey(job.size, &truth.visibility)?)?;
    job.write(&valid_image, &pictures::grey(job.size, &valid)?)?;
    let entry = ReferenceEntry {
        scene: job.scene.display().to_string(),
        light: light.name.clone(),
        light_index: job.light,
        light_shape: light.light.shape.to_string(),
        width: job.size[0],
        height: job.size[1],
        samples: job.samples,
        standard_error: truth.standard_error.map(|error| StandardError {
            rms: error.rms,
            max: error.max,
        }),
        valid_pixels: measures.valid.pixels,
        penumbra_pixels: measures.penumbra.pixels,
        rays: truth.rays,
        cast_ms,
        image,
        valid_image,
        case: Some(case(job, scene, camera, light)),
    };
    Ok((truth, entry))
}

fn case(job: &Job, scene: &Scene, camera: &SceneCamera, light: &SceneLight) -> CaseEntry {
    let named = NamedLight {
        name: light.name.clone(),
        light: light.light,
    };
    let buffers = SceneBuffers::plan_only(scene, false);
    let case = cases(&buffers, camera, job.size, &[named])[0];
    CaseEntry {
        angle: case.angle,
        cone: case.cone,
        triangles: case.triangles,
        holes: case.holes,
    }
}

/// Rivals with their hierarchies, each built once.
struct Engines<'s> {
    scene: &'s Scene,
    built: Vec<(Engine, Result<Built<'s>, String>)>,
}

#[derive(Clone)]
struct Built<'s> {
    rival: Rc<RefCell<Box<dyn Rival + 's>>>,
    ms: f64,
}

impl<'s> Engines<'s> {
    fn get(&mut self, engine: Engine) -> Result<Built<'s>, String> {
        if let Some((_, built)) = self.built.iter().find(|(other, _)| *other == engine) {
            return built.clone();
        }
        let start = Instant::now();
        let rival = engine.prepare(self.scene);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let built = match rival {
            Ok(rival) => Ok(Built {
                rival: Rc::new(RefCell::new(rival)),
                ms,
            }),
            Err(error) => Err(line(&*error)),
        };
        self.built.push((engine, built.clone()));
        built
    }
}

fn runner<'s>(
    job: &Job,
    engines: &mut Engines<'s>,
    camera: &SceneCamera,
    light: &SceneLight,
    contender: &Contender,
    on_device: &'s dyn Fn(&mut Gpu),
) -> Result<Box<dyn Runner + 's>, Failure> {
    let request = |technique| FrameRequest {
        camera: camera.clone(),
        size: job.size,
        lights: vec![job.light],
        technique,
    };
    match contender.method {
        Method::Technique(technique) => {
            technique.check(&light.light).map_err(|error| Failure {
                kind: FailureKind::Unsupported,
                reason: error.to_string(),
            })?;
            Ok(Box::new(GpuRunner {
                scene: engines.scene,
                request: request(technique),
                device: job.device.clone(),
                on_device,
                renderer: None,
            }))
        }
        Method::Rival(engine, rays) => {
            let built = engines.get(engine).map_err(|reason| Failure {
                kind: FailureKind::Failed,
                reason,
            })?;
            Ok(Box::new(RivalRunner {
                rival: built.rival,
                build_ms: built.ms,
                camera: camera.clone(),
                light: light.light,
                size: job.size,
                rays,
            }))
        }
    }
}

fn entry(
    job: &Job,
    light: &SceneLight,
    truth: &Truth,
    at: usize,
    cell: &Cell<'_>,
    contender: &Contender,
) -> Result<Entry, GroupError> {
    let mut entry = blank_entry(job, contender);
    entry.light.clone_from(&light.name);
    entry.light_shape = light.light.shape.kind().name().into();
    entry.failure.clone_from(&cell.failure);
    entry.driver = cell.driver();
    entry.setup_ms = cell.setup;
    entry.repeats = cell.repeats();
    entry.frame_ms = cell.frame_ms();
    entry.visibility_ms = cell.visibility_ms();
    entry.passes = cell.passes();
    entry.peak_bytes = cell.peak();
    entry.counters = cell.counters();
    entry.chosen = cell.chosen();
    if cell.repeats() == 0 {
        return Ok(entry);
    }
    entry.identical = Some(cell.identical);
    match measure(&cell.visibility, &truth.visibility, &truth.valid) {
        Ok(measures) => {
            entry.error = Some(measures);
            entry.penumbra_mean = penumbra_mean(&cell.visibility, truth);
        }
        // An earlier failure says more.
        Err(error) => {
            entry.failure.get_or_insert(Failure {
                kind: FailureKind::Failed,
                reason: error.to_string(),
            });
        }
    }
    let image = format!("{}-{at}.png", job.stem());
    if let Ok(png) = pictures::grey(job.size, &cell.visibility) {
        job.write(&image, &png)?;
        entry.image = Some(image);
    }
    Ok(entry)
}

/// Over the valid pixels that are penumbra in truth.
fn penumbra_mean(visibility: &[f32], truth: &Truth) -> Option<f64> {
    let all = visibility.iter().zip(&truth.visibility).zip(&truth.valid);
    let (mut sum, mut count) = (0.0, 0_u64);
    for ((&value, wanted), &valid) in all {
        if valid && *wanted > PENUMBRA.start && *wanted < PENUMBRA.end {
            sum += f64::from(value);
            count += 1;
        }
    }
    (count > 0).then(|| sum / count as f64)
}

/// An entry of which nothing was measured.
pub(super) fn blank_entry(job: &Job, contender: &Contender) -> Entry {
    Entry {
        scene: job.scene.display().to_string(),
        frame: 0,
        light: job.light_name.clone(),
        light_index: job.light,
        light_shape: String::new(),
        technique: contender.name().into(),
        label: contender.label.clone(),
        options: contender.options(),
        chosen: None,
        driver: None,
        width: job.size[0],
        height: job.size[1],
        repeats: 0,
        frame_ms: None,
        frame_ms_static: None,
        visibility_ms: None,
        passes: Vec::new(),
        setup_ms: None,
        peak_bytes: None,
        counters: Default::default(),
        identical: None,
        samples: job.samples,
        error: None,
        penumbra_mean: None,
        failure: None,
        image: None,
    }
}

/// The lights of a scene file, as jobs see them: index and name.
///
/// # Errors
/// The scene cannot be read, or has no light or no camera of use.
pub fn lights(scene: &Path, camera: Option<&str>) -> Result<Vec<(usize, String)>, SceneError> {
    let scene = Scene::load(scene, &LoadOptions::default())?;
    scene.select_light(None)?;
    scene.select_camera(camera)?;
    let names = scene.lights.iter().map(|light| light.name.clone());
    Ok(names.enumerate().collect())
}
