//! Items one after the other on one device: a scene is loaded once, and pipelines are made once.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value;

use super::args::{OpenScene, View, ViewArgs};
use super::capture::driver_text;
use super::error::CliError;
use super::outputs::ImageFile;
use super::pipeline_cache;
use super::progress::Progress;
use super::shot::{Content, Plan, Shot, Wanted};
use crate::batch::jobs::Kind;
use crate::batch::record::{ItemFailure, SCHEMA, content_hash};
use crate::batch::{FileEntry, Item, List, Record, Sequence, scene_file};
use crate::bench::FailureKind;
use crate::capture::output::Output;
use crate::capture::{CaptureError, FrameRenderer, FrameRequest};
use crate::gpu::{Gpu, GpuError, GpuOptions};

const WARM_UP_FRAMES: u32 = 2;

/// A file aside that is older was left by a process that was killed: writing takes far less.
const STALE: Duration = Duration::from_secs(3600);

/// Files with their content, and the entries of the report.
type Rendered = (Vec<(String, Vec<u8>)>, Vec<Value>);

/// What came of the items.
#[derive(Debug, Default)]
pub(super) struct Counts {
    pub(super) rendered: usize,
    pub(super) skipped: usize,
    pub(super) unsupported: usize,
    /// Name and reason.
    pub(super) failures: Vec<String>,
    pub(super) scenes_loaded: usize,
    /// Opening the device, and loading and uploading scenes.
    pub(super) ready_s: f64,
}

/// Renders items into a folder.
pub(super) struct Runner<'a> {
    out: &'a Path,
    program: String,
    device: Option<&'a str>,
    digests: HashMap<PathBuf, Option<String>>,
    folders: HashSet<PathBuf>,
    scene: Option<Loaded>,
    renderer: Option<FrameRenderer<'static>>,
    driver: Option<String>,
    counts: Counts,
}

/// A scene file, and the view of it that the renderer has.
struct Loaded {
    path: PathBuf,
    opened: OpenScene,
    /// Of which sequence and frame; a scene that does not move is the same for all frames.
    shown: Option<(String, u32)>,
    request: Option<FrameRequest>,
}

impl<'a> Runner<'a> {
    pub(super) fn new(out: &'a Path, program: String, device: Option<&'a str>) -> Self {
        Self {
            out,
            program,
            device,
            digests: HashMap::new(),
            folders: HashSet::new(),
            scene: None,
            renderer: None,
            driver: None,
            counts: Counts::default(),
        }
    }

    /// Renders the items that are not finished. One that fails is recorded and the rest goes on.
    pub(super) fn run(
        &mut self,
        list: &List,
        numbers: Range<usize>,
        progress: &Progress,
    ) -> Result<(), CliError> {
        for item in list.items(numbers) {
            let id = item.id();
            progress.say(id.clone());
            self.item(&item, &id)?;
            progress.step();
        }
        Ok(())
    }

    /// Gives the device back.
    pub(super) fn finish(mut self) -> Result<Counts, CliError> {
        if let Some(renderer) = self.renderer.take() {
            renderer.destroy()?;
        }
        Ok(self.counts)
    }

    fn item(&mut self, item: &Item<'_>, id: &str) -> Result<(), CliError> {
        let scene_sha256 = self.digest(&item.sequence.scene_path);
        let hash = content_hash(item, &self.program, &scene_sha256, self.device);
        let kept = Record::read(self.out, id);
        if kept.is_some_and(|record| record.is_finished(&hash, self.out)) {
            self.counts.skipped += 1;
            return Ok(());
        }
        self.make_folder(id)?;
        let rendered = self.render(item, id);
        let mut record = Record {
            schema: SCHEMA,
            item: id.into(),
            hash,
            program: self.program.clone(),
            scene_sha256,
            driver: self.driver.clone(),
            files: Vec::new(),
            images: Vec::new(),
            failure: None,
        };
        match rendered {
            Ok((files, images)) => {
                for (path, bytes) in files {
                    Output::File(self.out.join(&path)).write(&bytes)?;
                    record.files.push(FileEntry::new(path, &bytes));
                }
                record.images = images;
                self.counts.rendered += 1;
            }
            Err(error) => record.failure = Some(self.judge(error, id)?),
        }
        let bytes = serde_json::to_vec(&record)?;
        Output::File(Record::path(self.out, id)).write(&bytes)?;
        Ok(())
    }

    /// What an error means: for the item, or for all of them.
    fn judge(&mut self, error: CliError, id: &str) -> Result<ItemFailure, CliError> {
        if self.renderer.is_none() && matches!(error, CliError::Gpu(_)) {
            return Err(error);
        }
        let is_lost = matches!(&error, CliError::Capture(error)
            if matches!(**error, CaptureError::Gpu(GpuError::Call { result, .. })
                if result == ash::vk::Result::ERROR_DEVICE_LOST));
        if is_lost {
            // The next item gets a new one; that the old one does not end well is no news.
            let _ = self.renderer.take().map(FrameRenderer::destroy);
            self.scene = None;
        }
        // Of a view only that: a technique that cannot do the light.
        let kind = match error {
            CliError::Usage(_) => FailureKind::Unsupported,
            _ => FailureKind::Failed,
        };
        let reason = crate::message::line(&error);
        match kind {
            FailureKind::Unsupported => self.counts.unsupported += 1,
            _ => self.counts.failures.push(format!("{id}: {reason}")),
        }
        Ok(ItemFailure { kind, reason })
    }

    /// The same for all items of a scene; empty if the file cannot be read, which its items say.
    fn digest(&mut self, scene: &Path) -> String {
        if let Some(digest) = self.digests.get(scene) {
            return digest.clone().unwrap_or_default();
        }
        let digest = scene_file::digest(scene).ok();
        self.digests.insert(scene.into(), digest.clone());
        digest.unwrap_or_default()
    }

    fn make_folder(&mut self, id: &str) -> Result<(), CliError> {
        let file = Record::path(self.out, id);
        let folder = file.parent().unwrap_or(self.out);
        if !self.folders.contains(folder) {
            // Why it could not be made, the first file in it tells.
            let _ = fs::create_dir_all(folder);
            sweep(folder);
            self.folders.insert(folder.into());
        }
        Ok(())
    }

    fn render(&mut self, item: &Item<'_>, id: &str) -> Result<Rendered, CliError> {
        let sequence = item.sequence;
        let begun = Instant::now();
        let ready = self.show(sequence, item.frame);
        let ready_s = begun.elapsed().as_secs_f64();
        self.counts.ready_s += ready_s;
        let request = ready?;
        let Some(renderer) = self.renderer.as_mut() else {
            unreachable!("a view that is shown has a renderer")
        };
        let plan = Plan {
            number: item.frame,
            seconds: sequence.time(item.frame),
            load_ms: ready_s * 1e3,
            repeats: sequence.repeat.map(|repeat| (WARM_UP_FRAMES, repeat)),
            dumps: Vec::new(),
        };
        let shot = Shot::take(plan, &request, renderer)?;
        if sequence.picture != Kind::None && !sequence.allow_uniform {
            shot.refuse_single_value()?;
        }
        shot.refuse_missed_bound()?;
        let mut files = Vec::new();
        for (path, content) in names(sequence, id, &request) {
            let file = ImageFile::by_ending(path.clone().into()).map_err(CliError::Usage)?;
            let (_, bytes) = shot.encode(&Wanted { content, file })?;
            files.push((path, bytes));
        }
        let driver = self.driver.clone().unwrap_or_default();
        let entries = shot.entries(Path::new(&sequence.scene), &driver);
        let entries = entries
            .map(serde_json::to_value)
            .collect::<Result<_, _>>()?;
        Ok((files, entries))
    }

    /// Brings a view to the device, as far as it is not there yet.
    fn show(&mut self, sequence: &Sequence, frame: u32) -> Result<FrameRequest, CliError> {
        let view_args = ViewArgs::of_sequence(sequence);
        if (self.scene.as_ref()).is_none_or(|scene| scene.path != sequence.scene_path) {
            self.scene = None;
            self.counts.scenes_loaded += 1;
            self.scene = Some(Loaded {
                path: sequence.scene_path.clone(),
                opened: view_args.open()?,
                shown: None,
                request: None,
            });
        }
        let Some(loaded) = self.scene.as_mut() else {
            unreachable!("it has just been loaded")
        };
        let frame = if loaded.opened.is_animated() {
            frame
        } else {
            0
        };
        let wanted = (sequence.name.clone(), frame);
        if let (Some(request), Some(shown)) = (&loaded.request, &loaded.shown)
            && *shown == wanted
        {
            return Ok(request.clone());
        }
        loaded.shown = None;
        let View { scene, request, .. } = view_args.at(&loaded.opened, sequence.time(frame))?;
        match self.renderer.as_mut() {
            Some(renderer) => {
                renderer.set_scene(scene)?;
            }
            None => {
                let mut gpu = Gpu::create(&GpuOptions {
                    device: self.device.map(String::from),
                    application_name: "antumbra".into(),
                    ..Default::default()
                })?;
                if let Some(file) = pipeline_cache::file(gpu.info()) {
                    gpu.use_pipeline_cache(file);
                }
                self.driver = Some(driver_text(gpu.info()));
                self.renderer = Some(FrameRenderer::owning(gpu, scene)?);
            }
        }
        if let Some(loaded) = self.scene.as_mut() {
            loaded.shown = Some(wanted);
            loaded.request = Some(request.clone());
        }
        Ok(request)
    }
}

/// The files of an item, below the folder of the results.
fn names(sequence: &Sequence, id: &str, request: &FrameRequest) -> Vec<(String, Content)> {
    let picture =
        (sequence.picture.ending()).map(|ending| (format!("{id}.{ending}"), Content::Picture));
    let visibility = sequence.visibility.ending().into_iter().flat_map(|ending| {
        let lights = request.lights.iter();
        lights.map(move |&light| {
            let name = format!("{id}.visibility{light}.{ending}");
            (name, Content::Visibility(light))
        })
    });
    picture.into_iter().chain(visibility).collect()
}

/// Removes what processes that were killed left of files they were writing.
fn sweep(folder: &Path) {
    let now = SystemTime::now();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_aside = name.starts_with(".antumbra-") && name.ends_with(".part");
        let changed = entry.metadata().and_then(|meta| meta.modified()).ok();
        let age = changed.and_then(|changed| now.duration_since(changed).ok());
        if is_aside && age.is_some_and(|age| age > STALE) {
            // Another process may have done so already.
            let _ = fs::remove_file(entry.path());
        }
    }
}
