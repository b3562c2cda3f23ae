//! `antumbra compare`: how far an image is from its reference.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use serde_json::json;

use super::error::CliError;
use super::outputs::{Format, ImageFile};
use super::print_text;
use crate::capture::exr::{self, ReadError};
use crate::capture::output::Output;
use crate::capture::png;
use crate::measure::{ErrorMeasures, Flip, Measures, flip, heat_map, measure};

const EXAMPLES: &str = "\
Examples:
  antumbra compare vis.exr truth.exr
  antumbra compare vis.exr truth.exr --max-rmse 0.01 --max-bias 0.002
  antumbra compare vis.exr truth.exr --heatmap error.png --json
  antumbra compare picture.png other.png --max-flip 0.02

Visibility (channel Y of an .exr, or a grey .png) is measured on the pixels that the channel `valid`
marks, of the reference or else of the image, or on all pixels where neither has it; limits hold for
penumbra pixels, those with a reference above 0.005 and below 0.995. Pictures (R, G, B) are compared
by FLIP. The exit code is 1 when over a limit.";

/// Compare an image with its reference
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CompareArgs {
    /// Image, .exr or .png
    #[arg(value_name = "IMAGE", value_parser = PathBufValueParser::new().try_map(ImageFile::by_ending))]
    image: ImageFile,

    /// What it should be, .exr or .png
    #[arg(value_name = "REFERENCE", value_parser = PathBufValueParser::new().try_map(ImageFile::by_ending))]
    reference: ImageFile,

    /// Most root mean square error of visibility
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_hyphen_values = true)]
    max_rmse: Option<f64>,

    /// Most mean error of visibility, in magnitude
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_hyphen_values = true)]
    max_bias: Option<f64>,

    /// Most error of visibility that 99 % of the pixels may have, in magnitude
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_hyphen_values = true)]
    max_p99: Option<f64>,

    /// Most mean FLIP of pictures
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_hyphen_values = true)]
    max_flip: Option<f64>,

    /// Picture of the errors: blue too dark, red too bright; of pictures the FLIP of each pixel
    #[arg(
        long, value_name = "FILE.png",
        value_parser = PathBufValueParser::new().try_map(png_file)
    )]
    heatmap: Option<PathBuf>,

    /// Print JSON
    #[arg(long)]
    json: bool,
}

fn parse_limit(text: &str) -> Result<f64, String> {
    let value = text.parse().ok();
    let value = value.filter(|value: &f64| *value >= 0.0 && value.is_finite());
    value.ok_or_else(|| "give a number of 0 or more, such as 0.01".into())
}

fn png_file(path: PathBuf) -> Result<PathBuf, String> {
    let file = ImageFile::by_ending(path).ok();
    let file = file.filter(|file| file.format == Format::Png);
    file.map(|file| file.path)
        .ok_or_else(|| "the name has to end in .png".into())
}

/// An image file that does not do.
#[derive(Debug, thiserror::Error)]
enum ImageError {
    #[error(transparent)]
    Exr(#[from] ReadError),
    #[error("{}: cannot read the image: {source}", path.display())]
    Png {
        path: PathBuf,
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    #[error(
        "{}: neither visibility (channel Y) nor a picture (R, G, B); it has {have}", path.display()
    )]
    Channels { path: PathBuf, have: String },
    #[error(
        "{} is {}x{} and {} is {}x{}; only images of one size can be compared",
        image.display(), size[0], size[1], reference.display(), other[0], other[1]
    )]
    Sizes {
        image: PathBuf,
        size: [u32; 2],
        reference: PathBuf,
        other: [u32; 2],
    },
    #[error(
        "{} is {what} and {} is {other}; give two of a kind",
        image.display(), reference.display()
    )]
    Kinds {
        image: PathBuf,
        what: &'static str,
        reference: PathBuf,
        other: &'static str,
    },
    #[error("{} and {}: {source}", image.display(), reference.display())]
    Measure {
        image: PathBuf,
        reference: PathBuf,
        source: crate::measure::MeasureError,
    },
    #[error("{} is too large for FLIP", path.display())]
    Flip { path: PathBuf },
    #[error("{0}")]
    OverLimit(String),
}

impl From<ImageError> for CliError {
    fn from(error: ImageError) -> Self {
        Self::Other(Box::new(error))
    }
}

struct Image {
    size: [u32; 2],
    pixels: Pixels,
}

enum Pixels {
    Visibility {
        y: Vec<f32>,
        valid: Option<Vec<bool>>,
    },
    /// 8-bit sRGB.
    Picture(Vec<u8>),
}

impl Pixels {
    fn what(&self) -> &'static str {
        match self {
            Self::Visibility { .. } => "visibility",
            Self::Picture(_) => "a picture",
        }
    }
}

pub(super) fn run(args: &CompareArgs) -> Result<(), CliError> {
    check_heatmap(args)?;
    let (image, reference) = (load(&args.image)?, load(&args.reference)?);
    let paths = || (args.image.path.clone(), args.reference.path.clone());
    if image.size != reference.size {
        let (path, other) = paths();
        return Err(ImageError::Sizes {
            image: path,
            size: image.size,
            reference: other,
            other: reference.size,
        }
        .into());
    }
    match (&image.pixels, &reference.pixels) {
        (Pixels::Picture(a), Pixels::Picture(b)) => pictures(args, image.size, a, b),
        (
            Pixels::Visibility { y, valid },
            Pixels::Visibility {
                y: truth,
                valid: marks,
            },
        ) => {
            let (marks, from) = match (marks, valid) {
                (Some(marks), _) => (Some(marks), Some(&args.reference.path)),
                (None, Some(valid)) => (Some(valid), Some(&args.image.path)),
                (None, None) => (None, None),
            };
            visibility(args, image.size, y, truth, marks.map(Vec::as_slice), from)
        }
        (a, b) => {
            let (image, reference) = paths();
            let (what, other) = (a.what(), b.what());
            Err(ImageError::Kinds {
                image,
                what,
                reference,
                other,
            }
            .into())
        }
    }
}

/// A heat map that cannot be written, or that would replace what is compared, is refused at once.
fn check_heatmap(args: &CompareArgs) -> Result<(), CliError> {
    let Some(path) = &args.heatmap else {
        return Ok(());
    };
    Output::from(path.clone()).check()?;
    let place = fs::canonicalize(path).ok();
    for input in [&args.image.path, &args.reference.path] {
        if place.is_some() && fs::canonicalize(input).ok() == place {
            let path = path.display();
            let text = format!("{path} is one of the images; name another heat map");
            return Err(CliError::Usage(text));
        }
    }
    Ok(())
}

fn load(file: &ImageFile) -> Result<Image, ImageError> {
    match file.format {
        Format::Exr => load_exr(&file.path),
        Format::Png => load_png(&file.path),
    }
}

fn load_exr(path: &Path) -> Result<Image, ImageError> {
    let image = exr::read_image(path)?;
    let channel = |name| image.channel(name);
    let pixels = match (channel("Y"), channel("R"), channel("G"), channel("B")) {
        (Some(y), ..) => Pixels::Visibility {
            y: y.to_vec(),
            valid: channel("valid").map(|marks| marks.iter().map(|&mark| mark > 0.5).collect()),
        },
        (None, Some(r), Some(g), Some(b)) => {
            let rgb = r.iter().zip(g).zip(b).flat_map(|((&r, &g), &b)| [r, g, b]);
            Pixels::Picture(rgb.map(png::srgb_from_linear).collect())
        }
        _ => {
            let names: Vec<_> = image.channels.iter().map(|(n, _)| n.as_str()).collect();
            return Err(ImageError::Channels {
                path: path.into(),
                have: names.join(", "),
            });
        }
    };
    Ok(Image {
        size: [image.width, image.height],
        pixels,
    })
}

fn load_png(path: &Path) -> Result<Image, ImageError> {
    let fault = |source| ImageError::Png {
        path: path.into(),
        source,
    };
    let bytes = fs::read(path).map_err(|error| fault(error.into()))?;
    let format = image::ImageFormat::Png;
    let image =
        image::load_from_memory_with_format(&bytes, format).map_err(|error| fault(error.into()))?;
    let size = [image.width(), image.height()];
    let pixels = match image.color() {
        image::ColorType::L8 | image::ColorType::L16 => Pixels::Visibility {
            y: (image.into_luma16().into_raw().into_iter())
                .map(|value| f32::from(value) / 65535.0)
                .collect(),
            valid: None,
        },
        _ => Pixels::Picture(image.into_rgb8().into_raw()),
    };
    Ok(Image { size, pixels })
}

fn visibility(
    args: &CompareArgs,
    [width, height]: [u32; 2],
    image: &[f32],
    truth: &[f32],
    valid: Option<&[bool]>,
    from: Option<&PathBuf>,
) -> Result<(), CliError> {
    if args.max_flip.is_some() {
        let text = "--max-flip is for pictures, and these images are visibility; use --max-rmse";
        return Err(CliError::Usage(text.into()));
    }
    let everywhere = vec![true; image.len()];
    let marks = valid.unwrap_or(&everywhere);
    let measures = measure(image, truth, marks).map_err(|source| ImageError::Measure {
        image: args.image.path.clone(),
        reference: args.reference.path.clone(),
        source,
    })?;
    if let Some(path) = &args.heatmap {
        let range = round_up(measures.valid.max);
        write_heat_map(path, [width, height], image, truth, marks, range)?;
    }
    let over = over_limits(args, &measures.penumbra);
    if args.json {
        print_json(
            args,
            [width, height],
            json!({
                "pixels": if from.is_some() { "valid" } else { "all" },
                "valid_from": from.map(|path| path.display().to_string()),
                "error": measures,
                "passed": over.is_empty(),
            }),
        )?;
    } else {
        print_text(&table(&measures, from, image.len()))?;
    }
    end(over)
}

fn pictures(
    args: &CompareArgs,
    [width, height]: [u32; 2],
    image: &[u8],
    reference: &[u8],
) -> Result<(), CliError> {
    if args.max_rmse.or(args.max_bias).or(args.max_p99).is_some() {
        let text = "--max-rmse, --max-bias and --max-p99 are for visibility, and these images are \
                    pictures; use --max-flip";
        return Err(CliError::Usage(text.into()));
    }
    let Some(Flip { mean, max, map }) = flip(width, height, image, reference) else {
        let path = args.image.path.clone();
        return Err(ImageError::Flip { path }.into());
    };
    if let Some(path) = &args.heatmap {
        let zero = vec![0.0; map.len()];
        let marks = vec![true; map.len()];
        write_heat_map(path, [width, height], &map, &zero, &marks, 1.0)?;
    }
    let mut over = Vec::new();
    over_limit(&mut over, "mean FLIP", mean, args.max_flip, "--max-flip");
    if args.json {
        print_json(
            args,
            [width, height],
            json!({
                "flip": { "mean": mean, "max": max },
                "passed": over.is_empty(),
            }),
        )?;
    } else {
        print_text(&format!("FLIP mean {mean:.6}  max {max:.6}\n"))?;
    }
    end(over)
}

fn write_heat_map(
    path: &Path,
    [width, height]: [u32; 2],
    image: &[f32],
    truth: &[f32],
    valid: &[bool],
    range: f64,
) -> Result<(), CliError> {
    let map = heat_map(width, height, image, truth, valid, range);
    let bytes = png::encode_rgb8(map.width, map.height, &map.rgb)?;
    Ok(Output::from(path.to_path_buf()).write(&bytes)?)
}

/// The next of 1, 2, 5, 10 .. times a power of ten, 0.001 at least.
fn round_up(value: f64) -> f64 {
    let mut step = 1.0e-3;
    while step < 1.0e6 {
        for factor in [1.0, 2.0, 5.0] {
            if value <= factor * step {
                return factor * step;
            }
        }
        step *= 10.0;
    }
    value
}

fn over_limits(args: &CompareArgs, measures: &ErrorMeasures) -> Vec<String> {
    let mut over = Vec::new();
    let ErrorMeasures {
        rmse, bias, p99, ..
    } = *measures;
    over_limit(
        &mut over,
        "penumbra RMSE",
        rmse,
        args.max_rmse,
        "--max-rmse",
    );
    over_limit(
        &mut over,
        "penumbra bias",
        bias,
        args.max_bias,
        "--max-bias",
    );
    over_limit(&mut over, "penumbra p99", p99, args.max_p99, "--max-p99");
    over
}

fn over_limit(over: &mut Vec<String>, what: &str, value: f64, limit: Option<f64>, option: &str) {
    if let Some(limit) = limit
        && value.abs() > limit
    {
        over.push(format!("{what} {value:.6} is over {option} {limit}"));
    }
}

fn end(over: Vec<String>) -> Result<(), CliError> {
    if over.is_empty() {
        return Ok(());
    }
    Err(ImageError::OverLimit(over.join(", ")).into())
}

fn print_json(
    args: &CompareArgs,
    [width, height]: [u32; 2],
    mut values: serde_json::Value,
) -> Result<(), CliError> {
    values["schema"] = json!(1);
    values["image"] = json!(args.image.path.display().to_string());
    values["reference"] = json!(args.reference.path.display().to_string());
    values["width"] = json!(width);
    values["height"] = json!(height);
    print_text(&format!("{values:#}\n"))
}

fn table(measures: &Measures, from: Option<&PathBuf>, count: usize) -> String {
    let mut text = match from {
        Some(path) => {
            let name = path.display().to_string().replace(char::is_control, "?");
            format!("{count} pixels, valid where {name} says so\n")
        }
        None => format!("{count} pixels, all of them: neither image has a channel `valid`\n"),
    };
    // Writing to a String cannot fail.
    let mut line = |line: String| {
        let _ = writeln!(text, "{line}");
    };
    line(format!(
        "{:9} {:>9} {:>10} {:>10} {:>10} {:>10} {:>10}",
        "", "pixels", "rmse", "bias", "mae", "p99", "max"
    ));
    for (name, m) in [("valid", measures.valid), ("penumbra", measures.penumbra)] {
        line(format!(
            "{name:9} {:9} {:10.6} {:+10.6} {:10.6} {:10.6} {:10.6}",
            m.pixels, m.rmse, m.bias, m.mae, m.p99, m.max
        ));
    }
    line(format!(
        "umbra called lit {:.4} %, lit called umbra {:.4} %",
        100.0 * measures.umbra_called_lit,
        100.0 * measures.lit_called_umbra
    ));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_round() {
        for (value, range) in [
            (0.0, 1e-3),
            (0.0011, 2e-3),
            (0.3, 0.5),
            (0.5001, 1.0),
            (7.0, 10.0),
        ] {
            assert!((round_up(value) / range - 1.0).abs() < 1e-12, "{value}");
        }
    }
}
