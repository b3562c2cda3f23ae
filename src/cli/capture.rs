//! `antumbra capture`: a scene to a picture, to visibility images and to a report.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::builder::{PathBufValueParser, TypedValueParser as _};
use clap::{Args, value_parser};

use super::args::{View, ViewArgs};
use super::error::CliError;
use super::outputs::{self, Format, ImageFile};
use super::report::{ImageEntry, Measurements, PeakBytes, Report, SetupTimes};
use super::summary::{Stats, single_value};
use super::{pipeline_cache, print_text};
use crate::capture::output::{Output, OutputError};
use crate::capture::{CapturedFrame, FrameRenderer, exposure, exr, png};
use crate::gpu::{DeviceInfo, Gpu, GpuOptions};

const WARM_UP_FRAMES: u32 = 2;
const MEASURED_FRAMES: u32 = 7;

const EXAMPLES: &str = "\
Examples:
  antumbra capture scene.glb -o picture.png
  antumbra capture scene.glb -o picture.exr --size 1280x720 --camera front
  antumbra capture scene.glb --visibility vis_{light}.exr --report report.json
  antumbra capture scene.glb --light lamp --light-shape disk --light-size 0.5 --visibility vis.exr
  antumbra capture scene.glb -o - | display

A picture that is one single colour is a failure unless --allow-uniform is given.";

/// Render a scene to a picture, to float visibility images and to a report of timings
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CaptureArgs {
    /// Shaded picture: .png (exposed, sRGB), .exr (linear R, G, B), or - for a PNG to standard output
    #[arg(
        short, long, value_name = "FILE",
        value_parser = PathBufValueParser::new().try_map(ImageFile::picture)
    )]
    output: Option<ImageFile>,

    /// Visibility of a light: .exr (channel Y, 32-bit float) or .png (16-bit grey). Of the first
    /// light (or --light); with {light} in the name of each, under its index
    #[arg(
        long, value_name = "FILE",
        value_parser = PathBufValueParser::new().try_map(ImageFile::by_ending)
    )]
    visibility: Option<ImageFile>,

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

/// What rendering left behind.
struct Rendered {
    frame: CapturedFrame,
    measured: Measurements,
    setup: SetupTimes,
    peak: PeakBytes,
    driver: String,
}

pub(super) fn run(args: &CaptureArgs) -> Result<(), CliError> {
    let view = args.view.load()?;
    let visibility = visibility_files(args, &view);
    check_outputs(args, &visibility)?;

    let rendered = render(args, &view)?;

    if let (Some(_), false, Some(value)) = (
        &args.output,
        args.allow_uniform,
        single_value(&rendered.frame.color),
    ) {
        return Err(CliError::Uniform { value });
    }
    let files = encode(args, &visibility, &view, &rendered)?;
    outputs::write(&files)?;

    let text = summarize(args, &view, &rendered, &files);
    if files.iter().any(|(output, _)| *output == Output::Stdout) {
        // Everything asked for is written; a closed standard error takes nothing from that.
        let _ = std::io::stderr().write_all(text.as_bytes());
        Ok(())
    } else {
        print_text(&text)
    }
}

/// Each visibility file with the index of its light.
fn visibility_files(args: &CaptureArgs, view: &View) -> Vec<(usize, ImageFile)> {
    let lights = &view.request.lights;
    match &args.visibility {
        Some(file) if file.is_per_light() => lights
            .iter()
            .map(|&light| (light, file.for_light(light)))
            .collect(),
        Some(file) => (lights.first())
            .map(|&light| (light, file.clone()))
            .into_iter()
            .collect(),
        None => Vec::new(),
    }
}

fn check_outputs(args: &CaptureArgs, visibility: &[(usize, ImageFile)]) -> Result<(), CliError> {
    let picture = args.output.iter().map(|file| file.path.clone());
    let visibility = visibility.iter().map(|(_, file)| file.path.clone());
    let all: Vec<Output> = picture
        .chain(visibility)
        .chain(args.report.clone())
        .map(Output::from)
        .collect();
    outputs::check(&all, args.view.scene_path())
}

fn render(args: &CaptureArgs, view: &View) -> Result<Rendered, CliError> {
    let mut gpu = Gpu::create(&GpuOptions {
        device: args.device.clone(),
        validation: args.validation,
        pipeline_cache: None,
        application_name: "antumbra".into(),
    })?;
    // One file a driver, and which driver it is shows only now.
    if let Some(file) = pipeline_cache::file(gpu.info()) {
        gpu.use_pipeline_cache(file);
    }
    let driver = driver_text(gpu.info());

    let start = Instant::now();
    let mut renderer = FrameRenderer::new(gpu, &view.scene)?;
    let load_ms = view.load_ms + start.elapsed().as_secs_f64() * 1e3;
    let frames = render_frames(args, view, &mut renderer);
    let memory = renderer.gpu().memory_use();
    let messages = renderer.destroy();
    // An error of the frames comes before what it may have led to.
    let (frame, measured, first_frame_ms) = frames?;
    let messages = messages?;
    if let Some(first) = messages.first() {
        return Err(CliError::Validation {
            count: messages.len(),
            first: first.clone(),
        });
    }
    Ok(Rendered {
        frame,
        measured,
        setup: SetupTimes {
            load: load_ms,
            pipelines: None,
            first_frame: first_frame_ms,
        },
        peak: PeakBytes {
            device: memory.peak_device_bytes,
            host: memory.peak_host_bytes,
        },
        driver,
    })
}

/// Renders what was asked for: the last frame, the timings, and the time of the very first frame.
fn render_frames(
    args: &CaptureArgs,
    view: &View,
    renderer: &mut FrameRenderer<'_>,
) -> Result<(CapturedFrame, Measurements, f64), CliError> {
    let is_measured = args.report.is_some() || args.repeat.is_some();
    let (warm_up, count) = if is_measured {
        (WARM_UP_FRAMES, args.repeat.unwrap_or(MEASURED_FRAMES))
    } else {
        (0, 1)
    };
    let mut frame = renderer.render(&view.request)?;
    let first_frame_ms = frame.frame_ms;
    let mut measured = Measurements::default();
    if warm_up == 0 {
        measured.add(&frame);
    }
    for number in 1..warm_up + count {
        frame = renderer.render(&view.request)?;
        if number >= warm_up {
            measured.add(&frame);
        }
    }
    Ok((frame, measured, first_frame_ms))
}

fn encode(
    args: &CaptureArgs,
    visibility: &[(usize, ImageFile)],
    view: &View,
    rendered: &Rendered,
) -> Result<Vec<(Output, Vec<u8>)>, CliError> {
    let frame = &rendered.frame;
    let [width, height] = frame.size;
    let mut files = Vec::new();
    if let Some(file) = &args.output {
        let bytes = encode_picture(frame, file.format)?;
        files.push((Output::from(file.path.clone()), bytes));
    }
    for (index, file) in visibility {
        // The renderer makes the visibility of every light that it was asked for.
        for light in frame.lights.iter().filter(|light| light.light == *index) {
            let bytes = match file.format {
                Format::Exr => exr::encode_y(width, height, &light.visibility)?,
                Format::Png => png::encode_grey16(width, height, &light.visibility)?,
            };
            files.push((Output::from(file.path.clone()), bytes));
        }
    }
    if let Some(path) = &args.report {
        let bytes = report(args, view, rendered).to_json()?;
        files.push((Output::from(path.clone()), bytes));
    }
    Ok(files)
}

fn encode_picture(frame: &CapturedFrame, format: Format) -> Result<Vec<u8>, OutputError> {
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

fn report(args: &CaptureArgs, view: &View, rendered: &Rendered) -> Report {
    let (frame, measured) = (&rendered.frame, &rendered.measured);
    let entries = frame.lights.iter().map(|light| ImageEntry {
        scene: args.view.scene_path().display().to_string(),
        frame: 0,
        light: view.scene.lights[light.light].name.clone(),
        technique: view.request.technique.name(),
        options: BTreeMap::new(),
        driver: rendered.driver.clone(),
        width: frame.size[0],
        height: frame.size[1],
        frame_ms: measured.frame(),
        frame_ms_static: None,
        visibility_ms: measured.sum_of(&light.passes),
        passes: measured.passes(frame),
        setup_ms: rendered.setup,
        peak_bytes: rendered.peak,
        counters: frame.counters.clone(),
    });
    Report::new(entries.collect())
}

fn driver_text(info: &DeviceInfo) -> String {
    let parts = [&info.name, &info.driver_name, &info.driver_info];
    let parts: Vec<&str> = parts
        .into_iter()
        .map(String::as_str)
        .filter(|part| !part.is_empty())
        .collect();
    parts.join(", ")
}

fn summarize(
    args: &CaptureArgs,
    view: &View,
    rendered: &Rendered,
    files: &[(Output, Vec<u8>)],
) -> String {
    let frame = &rendered.frame;
    let mut text = String::new();
    let mut row = |name: &str, value: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<11}{value}");
    };
    row("driver", rendered.driver.clone());
    row("size", format!("{}x{}", frame.size[0], frame.size[1]));
    row("camera", camera_text(view));
    row("technique", view.request.technique.name().into());
    if let Some(spread) = rendered.measured.frame() {
        let first = rendered.setup.first_frame;
        row(
            "frame",
            if args.report.is_some() || args.repeat.is_some() {
                format!(
                    "{:.3} ms (min {:.3}, max {:.3}; the first {first:.3})",
                    spread.median, spread.min, spread.max
                )
            } else {
                format!("{first:.3} ms (the first of a run)")
            },
        );
    }
    let rgb = frame.color.iter().flat_map(|pixel| &pixel[..3]).copied();
    row("picture", Stats::of(rgb).to_string());
    for light in &frame.lights {
        let scene_light = &view.scene.lights[light.light];
        row(
            "visibility",
            format!(
                "{}  light {} `{}` ({})",
                Stats::of(light.visibility.iter().copied()),
                light.light,
                scene_light.name,
                scene_light.light.shape
            ),
        );
    }
    for (output, bytes) in files {
        row("wrote", format!("{output} ({} bytes)", bytes.len()));
    }
    text
}

fn camera_text(view: &View) -> String {
    let camera = &view.request.camera;
    if camera.node.is_some() {
        return format!("{} `{}`", camera.index, camera.name);
    }
    let eye = camera.position.as_dvec3() + view.scene.rebase_origin;
    let forward = camera.forward;
    format!(
        "none in the scene; the whole of it from ({:.4}, {:.4}, {:.4}) along ({:.4}, {:.4}, {:.4}), \
         yfov {:.4} radians",
        eye.x, eye.y, eye.z, forward.x, forward.y, forward.z, camera.yfov
    )
}
