//! `antumbra capture`: a scene to pictures, to visibility and other images, and to a report.

use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::builder::{PathBufValueParser, TypedValueParser as _};
use clap::{Args, value_parser};

use super::args::{OpenScene, View, ViewArgs};
use super::error::CliError;
use super::frames::{Fps, FrameRange, Timeline};
use super::outputs;
use super::progress::Progress;
use super::report::{ImageEntry, Report};
use super::shard::{self, ShardArgs};
use super::shot::{self, Content, DumpArg, Shot, Wanted};
use super::summary::summarize;
use super::template::ImageTemplate;
use super::{pipeline_cache, print_text};
use crate::batch::{Shard, equal_frames, run_of};
use crate::capture::output::Output;
use crate::capture::{FrameRenderer, FrameRequest};
use crate::gpu::{DeviceInfo, Gpu, GpuOptions};

const WARM_UP_FRAMES: u32 = 2;
const MEASURED_FRAMES: u32 = 7;

const EXAMPLES: &str = "\
Examples:
  antumbra capture scene.glb -o picture.png
  antumbra capture scene.glb -o picture.exr --size 1280x720 --camera front
  antumbra capture scene.glb --visibility vis_{light}.exr --report report.json
  antumbra capture scene.glb --light lamp --light-shape disk --light-size 0.5 --visibility vis.exr
  antumbra capture scene.glb -o walk_{frame:04}.png --frames 0..48 --fps 24
  antumbra capture scene.glb --dump depth=depth.exr --dump normal=normal.png
  antumbra capture scene.glb --dump 'hard.map_depth 0:lamp[0]=map.exr'
  antumbra capture scene.glb -o - | display

In names {frame} is the frame's number, {frame:04} the same with at least 4 digits, {light} the
index of a light. A picture that is one single colour is a failure unless --allow-uniform is given.";

/// Render a scene to pictures, to float visibility images and to a report of timings
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CaptureArgs {
    /// Shaded picture: .png (exposed, sRGB), .exr (linear R, G, B), or - for a PNG to standard output
    #[arg(
        short, long, value_name = "FILE",
        value_parser = PathBufValueParser::new().try_map(ImageTemplate::picture)
    )]
    output: Option<ImageTemplate>,

    /// Visibility of a light: .exr (channel Y, 32-bit float) or .png (16-bit grey). Of the first
    /// light (or --light); with {light} in the name of each, under its index
    #[arg(
        long, value_name = "FILE",
        value_parser = PathBufValueParser::new().try_map(ImageTemplate::by_ending)
    )]
    visibility: Option<ImageTemplate>,

    /// The most that the visibility of the first light (or --light) is off, at each pixel: as for
    /// --visibility. Of techniques that prove it: shaft-masks
    #[arg(
        long, value_name = "FILE",
        value_parser = PathBufValueParser::new().try_map(ImageTemplate::by_ending)
    )]
    visibility_bound: Option<ImageTemplate>,

    /// Image of the frame by name: depth (metres along the view, 0 where nothing is), normal,
    /// shading_normal, visibility, or any that `antumbra graph` lists; NAME[2] is its layer 2,
    /// NAME[2,1] mip level 1 of that. .exr has the numbers, .png a picture of them. Repeatable
    #[arg(long, value_name = "NAME=FILE")]
    dump: Vec<DumpArg>,

    /// Frames A to B - 1, one after the other; frame n is at --time plus n / --fps. Names of images
    /// need {frame} then
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    frames: Option<FrameRange>,

    /// Frames per second
    #[arg(
        long,
        value_name = "F",
        default_value = "30",
        requires = "frames",
        allow_hyphen_values = true
    )]
    fps: Fps,

    #[command(flatten)]
    shard: ShardArgs,

    #[command(flatten)]
    refinement: RefinementArgs,

    /// Timings, memory and counters as JSON; renders 2 warm-up frames first, then measures 7
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,

    /// Number of frames to measure, instead of 7
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=100_000))]
    repeat: Option<u32>,

    /// Vulkan device, by part of its name or by its index in `antumbra info`; the first that fits
    /// by default
    #[arg(long, value_name = "NAME|INDEX")]
    device: Option<String>,

    /// Accept a picture that is one single colour
    #[arg(long)]
    allow_uniform: bool,

    /// Run under the Vulkan validation layer; any message is a failure
    #[arg(long)]
    validation: bool,

    #[command(flatten)]
    view: ViewArgs,
}

/// Options of techniques that work on until the error is small enough, by their own names.
#[derive(Debug, Args)]
#[command(next_help_heading = "How far to go, of techniques with such options: shaft-masks")]
struct RefinementArgs {
    /// Estimated root mean square error of the penumbra's pixels; none for as few samples as asked for
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    target_error: Option<String>,

    /// Proven bound on the error of every pixel; where one stays above it the command fails
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    bound: Option<String>,

    /// Milliseconds of the device for a light after which nothing more is begun
    #[arg(long, value_name = "T", allow_hyphen_values = true)]
    budget_ms: Option<String>,

    /// Most steps of work beyond the first picture: the same picture on every run
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    budget_work: Option<String>,
}

impl RefinementArgs {
    fn given(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let all = [
            ("target-error", &self.target_error),
            ("bound", &self.bound),
            ("budget-ms", &self.budget_ms),
            ("budget-work", &self.budget_work),
        ];
        let given = all.into_iter();
        given.filter_map(|(name, value)| value.as_deref().map(|value| (name, value)))
    }
}

pub(super) fn run(mut args: CaptureArgs) -> Result<(), CliError> {
    let proves = ["bound", "budget-work"];
    if args.visibility_bound.is_some()
        || args
            .refinement
            .given()
            .any(|(option, _)| proves.contains(&option))
    {
        args.view.choose_a_proof();
    }
    for (option, value) in args.refinement.given() {
        args.view.set_option(option, value)?;
    }
    // An image of the frame like others.
    args.dump
        .extend(args.visibility_bound.take().map(|file| DumpArg {
            name: "visibility_bound".into(),
            file,
        }));
    let args = &args;
    let Some(timeline) = timeline(args)? else {
        return Ok(());
    };
    let first = timeline.numbers().start;
    let named = |error: CliError| match timeline.is_sequence() {
        true => error.in_frame(first),
        false => error,
    };
    let progress = Progress::new(timeline.numbers().len() as u64);
    progress.say("loading");
    let opened = args.view.open()?;
    let mut view = args.view.at(&opened, timeline.time(first)).map_err(named)?;
    view.load_ms += opened.open_ms;
    let job = Job {
        args,
        timeline,
        opened,
        lights: view.request.lights.clone(),
    };
    job.check_outputs()?;
    job.run(view, progress)
}

/// The frames of this process; `None` if it has none of them.
fn timeline(args: &CaptureArgs) -> Result<Option<Timeline>, CliError> {
    let timeline = Timeline::new(args.view.time(), args.frames, args.fps);
    if !timeline.is_sequence() {
        return match args.shard.is_given() {
            true => Err(CliError::Usage(
                "a shard of one frame; give --frames A..B too".into(),
            )),
            false => Ok(Some(timeline)),
        };
    }
    let Some(told) = args.shard.settle()? else {
        return Ok(Some(timeline));
    };
    let report = args.report.as_ref().filter(|_| told.0 != Shard::WHOLE);
    if let Some(report) = report {
        return Err(CliError::Usage(format!(
            "{}: every shard would write this report; use `antumbra batch`, whose reports are \
             merged, or one shard",
            report.display()
        )));
    }
    let places = run_of(&equal_frames(timeline.numbers().len()), told.0);
    print_text(&shard::line(&told, places.len(), "frames"))?;
    Ok((!places.is_empty()).then(|| timeline.part(places)))
}

/// A capture whose arguments have been checked.
struct Job<'a> {
    args: &'a CaptureArgs,
    timeline: Timeline,
    opened: OpenScene,
    /// Those of every frame, as indices into its scene's lights.
    lights: Vec<usize>,
}

impl Job<'_> {
    /// The image files of a frame.
    fn wanted(&self, frame: u32) -> Result<Vec<Wanted>, CliError> {
        let args = self.args;
        let mut wanted = Vec::new();
        let first = self.lights.first().copied().unwrap_or_default();
        let mut one = |content, template: &ImageTemplate| {
            if template.is_per_light() && self.lights.len() > 1 {
                let text = format!(
                    "{{light}} in `{}`: this image has {} lights; choose one with --light",
                    template.text(),
                    self.lights.len()
                );
                return Err(CliError::Usage(text));
            }
            let file = template.at(frame, first);
            wanted.push(Wanted { content, file });
            Ok(())
        };
        if let Some(template) = &args.output {
            one(Content::Picture, template)?;
        }
        for (at, DumpArg { name, file }) in args.dump.iter().enumerate() {
            if name != "visibility" || !file.is_per_light() {
                one(Content::Dump(at), file)?;
            }
        }
        let all = || self.lights.iter().copied();
        if let Some(template) = &args.visibility {
            let lights = all().take(if template.is_per_light() {
                usize::MAX
            } else {
                1
            });
            wanted.extend(lights.map(|light| Wanted {
                content: Content::Visibility(light),
                file: template.at(frame, light),
            }));
        }
        for DumpArg { name, file } in &args.dump {
            if name == "visibility" && file.is_per_light() {
                wanted.extend(all().map(|light| Wanted {
                    content: Content::DumpedVisibility(light),
                    file: file.at(frame, light),
                }));
            }
        }
        Ok(wanted)
    }

    /// Checks the outputs of all frames before the work for the first begins.
    fn check_outputs(&self) -> Result<(), CliError> {
        let (args, frames) = (self.args, self.timeline.numbers());
        let templates = [&args.output, &args.visibility].into_iter().flatten();
        let mut templates = templates.chain(args.dump.iter().map(|dump| &dump.file));
        if frames.len() > 1
            && let Some(template) = templates.find(|template| !template.is_per_frame())
        {
            return Err(CliError::Usage(format!(
                "{} frames, but the name `{}` is the same for each; put {{frame:04}} into it",
                frames.len(),
                template.text()
            )));
        }
        let mut all: Vec<Output> = Vec::new();
        for frame in frames {
            let wanted = self.wanted(frame)?.into_iter();
            all.extend(wanted.map(|wanted| wanted.file.path.into()));
        }
        all.extend(args.report.iter().map(|path| path.clone().into()));
        outputs::check(&all, args.view.scene_path())
    }

    fn run(&self, view: View, progress: Progress) -> Result<(), CliError> {
        let args = self.args;
        progress.say("opening the device");
        let mut gpu = Gpu::create(&GpuOptions {
            device: args.device.clone(),
            validation: args.validation,
            application_name: "antumbra".into(),
            ..Default::default()
        })?;
        // One file a driver, and which driver it is shows only now.
        if let Some(file) = pipeline_cache::file(gpu.info()) {
            gpu.use_pipeline_cache(file);
        }
        let driver = driver_text(gpu.info());
        let mut entries = Vec::new();
        let start = Instant::now();
        let mut renderer = FrameRenderer::owning(gpu, view.scene)?;
        let load_ms = view.load_ms + start.elapsed().as_secs_f64() * 1e3;
        let last = self.frames(
            (view.request, load_ms),
            &mut renderer,
            &driver,
            &mut entries,
            &progress,
        );
        let messages = renderer.destroy();
        // An error of the frames comes before what it may have led to.
        let (shot, wanted) = last?;
        let messages = messages?;
        if let Some(first) = messages.first() {
            return Err(CliError::Validation {
                count: messages.len(),
                first: first.clone(),
            });
        }
        // The last frame's files come last of all: by now nothing else can fail.
        let report = match &args.report {
            Some(path) => Some((path.clone().into(), Report::new(entries).to_json()?)),
            None => None,
        };
        let number = shot.number;
        let delivered = self.deliver(&shot, &wanted, &driver, report, &progress);
        delivered.map_err(|error| self.name_frame(number, error))
    }

    fn name_frame(&self, number: u32, error: CliError) -> CliError {
        match self.timeline.is_sequence() {
            true => error.in_frame(number),
            false => error,
        }
    }

    /// Renders all frames and delivers all but the last, which it returns.
    fn frames(
        &self,
        first: (FrameRequest, f64),
        renderer: &mut FrameRenderer<'_>,
        driver: &str,
        entries: &mut Vec<ImageEntry>,
        progress: &Progress,
    ) -> Result<(Shot, Vec<Wanted>), CliError> {
        let numbers = self.timeline.numbers();
        let (mut request, mut load_ms) = first;
        for number in numbers.clone() {
            if self.timeline.is_sequence() {
                progress.say(format!("frame {number}"));
            } else {
                progress.say("rendering");
            }
            let mut shoot = || -> Result<_, CliError> {
                let wanted = self.wanted(number)?;
                if number != numbers.start {
                    load_ms = self.next_scene(number, renderer, &mut request)?;
                }
                let shot = self.shoot(number, &request, load_ms, renderer)?;
                Ok((shot, wanted))
            };
            let name = |error| self.name_frame(number, error);
            let (shot, wanted) = shoot().map_err(name)?;
            if self.args.report.is_some() {
                entries.extend(shot.entries(self.args.view.scene_path(), driver));
            }
            progress.step();
            if number + 1 == numbers.end {
                return Ok((shot, wanted));
            }
            self.deliver(&shot, &wanted, driver, None, progress)
                .map_err(name)?;
        }
        unreachable!("a timeline has at least one frame, and its last returns")
    }

    /// Gives the renderer the scene of a later frame; returns the milliseconds that this took.
    fn next_scene(
        &self,
        number: u32,
        renderer: &mut FrameRenderer<'_>,
        request: &mut FrameRequest,
    ) -> Result<f64, CliError> {
        let start = Instant::now();
        if self.opened.is_animated() {
            let seconds = self.timeline.time(number);
            let view = self.args.view.at(&self.opened, seconds)?;
            renderer.set_scene(view.scene)?;
            *request = view.request;
        }
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }

    fn shoot(
        &self,
        number: u32,
        request: &FrameRequest,
        load_ms: f64,
        renderer: &mut FrameRenderer<'_>,
    ) -> Result<Shot, CliError> {
        let args = self.args;
        let repeat = args.repeat.unwrap_or(MEASURED_FRAMES);
        let is_measured = args.report.is_some() || args.repeat.is_some();
        let plan = shot::Plan {
            number,
            seconds: self.timeline.time(number),
            load_ms,
            repeats: is_measured.then_some((WARM_UP_FRAMES, repeat)),
            dumps: args.dump.iter().map(|dump| dump.name.as_str()).collect(),
        };
        let shot = Shot::take(plan, request, renderer)?;
        if args.output.is_some() && !args.allow_uniform {
            shot.refuse_single_value()?;
        }
        shot.refuse_missed_bound()?;
        Ok(shot)
    }

    /// Writes the files of a frame and says so.
    fn deliver(
        &self,
        shot: &Shot,
        wanted: &[Wanted],
        driver: &str,
        report: Option<(Output, Vec<u8>)>,
        progress: &Progress,
    ) -> Result<(), CliError> {
        let mut files = wanted
            .iter()
            .map(|wanted| shot.encode(wanted))
            .collect::<Result<Vec<_>, CliError>>()?;
        files.extend(report);
        outputs::write(&files)?;
        let is_first = shot.number == self.timeline.numbers().start;
        let number = self.timeline.is_sequence().then_some(shot.number);
        let text = summarize(shot, is_first.then_some(driver), number, &files);
        progress.above(|| {
            if files.iter().any(|(output, _)| *output == Output::Stdout) {
                // Everything asked for is written; a closed standard error takes nothing from that.
                let _ = std::io::stderr().write_all(text.as_bytes());
                Ok(())
            } else {
                print_text(&text)
            }
        })
    }
}

pub(super) fn driver_text(info: &DeviceInfo) -> String {
    let parts = [&info.name, &info.driver_name, &info.driver_info];
    let parts: Vec<&str> = parts
        .into_iter()
        .map(String::as_str)
        .filter(|part| !part.is_empty())
        .collect();
    parts.join(", ")
}
