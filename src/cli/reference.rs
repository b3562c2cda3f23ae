//! `antumbra reference`: the ray-traced truth of a light's visibility, on the CPU.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use clap::builder::{PathBufValueParser, TypedValueParser as _};
use clap::{Args, value_parser};

use super::args::{View, ViewArgs};
use super::error::CliError;
use super::outputs::{self, Format};
use super::print_text;
use super::progress::Progress;
use super::summary::Stats;
use super::template::ImageTemplate;
use crate::capture::exr::{self, Channel};
use crate::capture::output::Output;
use crate::measure::PENUMBRA;
use crate::reference::{
    Cache, MAX_SAMPLES, Pattern, Reference, ReferenceError, Sampling, Settings, Truth,
};

/// Most samples that `--standard-error` goes to.
const MOST_SAMPLES: u32 = 1 << 16;
/// Steps of the progress bar for each light.
const STEPS: u64 = 100;

const EXAMPLES: &str = "\
Examples:
  antumbra reference scene.glb -o truth.exr
  antumbra reference scene.glb -o truth.exr --samples 256 --standard-error 0.002
  antumbra reference scene.glb -o truth_{light}.exr --size 256x256
  antumbra reference scene.glb -o seen.exr --pattern grid8

The image has the channels Y (visibility) and valid (0 or 1: whether a technique can be held against
it there). References are kept in $XDG_CACHE_HOME/antumbra/reference and not cast twice.

A pattern's file has one sample a line, `u v`, each from -1 to 1 on the light itself; # begins a
comment. A disk, sphere or sun is the unit disk, a line has u only.";

/// Cast the visibility of a light by ray tracing on the CPU: the truth to compare with
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ReferenceArgs {
    /// Image of the first light (or --light), .exr; with {light} in the name of each, under its
    /// index
    #[arg(
        short, long, value_name = "FILE.exr",
        value_parser = PathBufValueParser::new().try_map(float_image)
    )]
    output: ImageTemplate,

    /// Light samples a pixel; powers of two are spread best
    #[arg(
        long, value_name = "N", default_value = "1024",
        value_parser = value_parser!(u32).range(16..=i64::from(MAX_SAMPLES))
    )]
    samples: u32,

    /// Refine pixels of the penumbra until the standard error of each is estimated below this, with
    /// up to 65536 samples
    #[arg(long, value_name = "E", value_parser = parse_error, allow_hyphen_values = true)]
    standard_error: Option<f64>,

    /// Cast these light samples at every pixel: a file, or grid1 to grid256
    #[arg(long, value_name = "FILE|NAME", conflicts_with_all = ["samples", "standard_error"])]
    pattern: Option<PathBuf>,

    /// Cast anew, and keep nothing
    #[arg(long)]
    no_cache: bool,

    #[command(flatten)]
    view: ViewArgs,
}

fn float_image(path: PathBuf) -> Result<ImageTemplate, String> {
    let is_float = |template: &ImageTemplate| template.at(0, 0).format == Format::Exr;
    let template = ImageTemplate::by_ending(path).ok().filter(is_float);
    template.ok_or_else(|| "the name has to end in .exr".into())
}

fn parse_error(text: &str) -> Result<f64, String> {
    let value = text.parse().ok();
    let value = value.filter(|value: &f64| *value > 0.0 && value.is_finite());
    value.ok_or_else(|| "give a number above 0, such as 0.001".into())
}

pub(super) fn run(args: &ReferenceArgs) -> Result<(), CliError> {
    let sampling = sampling(args)?;
    let view = args.view.load()?;
    let all = if args.output.is_per_light() {
        usize::MAX
    } else {
        1
    };
    let lights: Vec<usize> = view.request.lights.iter().copied().take(all).collect();
    let output = |light: usize| Output::from(args.output.at(0, light).path);
    let outputs: Vec<Output> = lights.iter().map(|&light| output(light)).collect();
    outputs::check(&outputs, args.view.scene_path())?;

    let progress = Progress::new(STEPS * lights.len() as u64);
    progress.say("casting");
    let (mut files, mut text) = (Vec::new(), String::new());
    for light in lights {
        let start = Instant::now();
        let (truth, is_kept) = cast(args, &view, light, &sampling, &progress)?;
        let seconds = (!is_kept).then(|| start.elapsed().as_secs_f64());
        let file = output(light);
        summarize(&mut text, &view, light, &truth, seconds, &file);
        files.push((file, encode(&truth)?));
    }
    drop(progress);
    outputs::write(&files)?;
    print_text(&text)
}

fn sampling(args: &ReferenceArgs) -> Result<Sampling, CliError> {
    let Some(pattern) = &args.pattern else {
        return Ok(Sampling::Estimated {
            samples: args.samples,
            standard_error: args.standard_error,
            most: args.samples.max(MOST_SAMPLES),
        });
    };
    let named = pattern.to_str().and_then(Pattern::named);
    let pattern = match named {
        Some(pattern) => Ok(pattern),
        None => Pattern::read(pattern),
    };
    pattern.map(Sampling::Pattern).map_err(failed)
}

fn failed(error: ReferenceError) -> CliError {
    match error {
        ReferenceError::PatternOutside { .. } => CliError::Usage(error.to_string()),
        error => CliError::Other(Box::new(error)),
    }
}

/// The truth, and whether it was kept from an earlier time.
fn cast(
    args: &ReferenceArgs,
    view: &View,
    light: usize,
    sampling: &Sampling,
    progress: &Progress,
) -> Result<(Truth, bool), CliError> {
    let settings = Settings {
        camera: &view.request.camera,
        size: view.request.size,
        light: &view.scene.lights[light].light,
        sampling,
    };
    let [width, height] = settings.size.map(u64::from);
    let done = AtomicU64::new(0);
    let advance = |pixels: u64| {
        let before = done.fetch_add(pixels, Ordering::Relaxed);
        let steps = |pixels: u64| STEPS * pixels / (width * height);
        for _ in steps(before)..steps(before + pixels) {
            progress.step();
        }
    };
    let cache = if args.no_cache {
        None
    } else {
        Cache::of_user()
    };
    match cache {
        Some(cache) => cache.render(&view.scene, &settings, &advance),
        None => Reference::new(&view.scene)
            .and_then(|reference| reference.render(&settings, &advance))
            .map(|truth| (truth, false)),
    }
    .map_err(failed)
}

fn encode(truth: &Truth) -> Result<Vec<u8>, CliError> {
    let valid: Vec<f32> = (truth.valid.iter())
        .map(|&valid| f32::from(u8::from(valid)))
        .collect();
    let channels = [
        Channel {
            name: "Y",
            values: &truth.visibility,
        },
        Channel {
            name: "valid",
            values: &valid,
        },
    ];
    Ok(exr::encode(truth.size[0], truth.size[1], &channels)?)
}

fn summarize(
    text: &mut String,
    view: &View,
    light: usize,
    truth: &Truth,
    seconds: Option<f64>,
    file: &Output,
) {
    // Writing to a String cannot fail.
    let mut line = |line: String| {
        let _ = writeln!(text, "{line}");
    };
    let [width, height] = truth.size;
    let named = &view.scene.lights[light];
    line(format!("{file}: {width}x{height}, channels Y, valid"));
    line(format!(
        "  light {light} `{}`, {}",
        named.name.replace(char::is_control, "?"),
        named.light.shape
    ));
    line(format!(
        "  visibility     {}",
        Stats::of(truth.visibility.iter().copied())
    ));
    let valid = truth.valid.iter().filter(|&&valid| valid).count();
    let penumbra = (truth.visibility.iter().zip(&truth.valid))
        .filter(|&(&v, &valid)| valid && v > PENUMBRA.start && v < PENUMBRA.end)
        .count();
    line(format!(
        "  valid          {valid} of {} pixels, {penumbra} of them penumbra",
        truth.valid.len()
    ));
    if let Some(error) = truth.standard_error {
        line(format!(
            "  standard error {:.6} rms, {:.6} at most, over {} partly lit pixels",
            error.rms, error.max, error.pixels
        ));
        if error.above > 0 {
            line(format!(
                "                 {} pixels are above what was asked for, at {MOST_SAMPLES} samples \
                 each",
                error.above
            ));
        }
    }
    match seconds {
        Some(seconds) => line(format!(
            "  rays           {} in {seconds:.2} s, {:.2} million a second",
            truth.rays,
            truth.rays as f64 / seconds.max(1e-9) * 1e-6
        )),
        None => line(format!(
            "  rays           {}, kept from an earlier run",
            truth.rays
        )),
    }
}
