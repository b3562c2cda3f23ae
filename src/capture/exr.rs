//! OpenEXR: 32-bit float and unsigned integer channels, lossless.
//!
//! Written are scan lines with ZIP compression and no attribute that changes from run to run, so
//! the bytes depend on the pixels only.

use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::header::LayerAttributes;
use exr::prelude::{ReadChannels as _, ReadLayers as _, Text, WritableImage as _, read};

use super::Samples;
use super::output::OutputError;

/// One channel of an image: a name and a value for each pixel, rows from the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel<'a> {
    /// For instance `Y` or `R`.
    pub name: &'a str,
    /// `width * height` values.
    pub values: &'a [f32],
}

/// One channel of float or of unsigned integer values.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// For instance `Y` or `layer0.Y`.
    pub name: String,
    /// `width * height` values; integers are stored as such.
    pub samples: Samples,
}

/// A file of the given channels, whatever their order.
///
/// # Errors
/// [`OutputError::Encode`] if a channel has not one value a pixel, or if names are missing, doubled
/// or not ASCII.
pub fn encode(width: u32, height: u32, channels: &[Channel<'_>]) -> Result<Vec<u8>, OutputError> {
    let planes = channels.iter().map(|channel| Plane {
        name: channel.name.into(),
        samples: Samples::Float(channel.values.to_vec()),
    });
    encode_planes(width, height, planes.collect())
}

/// As [`encode`], of channels that may hold integers.
///
/// # Errors
/// As [`encode`].
pub fn encode_planes(width: u32, height: u32, planes: Vec<Plane>) -> Result<Vec<u8>, OutputError> {
    let fault = |reason| OutputError::Encode {
        format: "OpenEXR",
        width,
        height,
        reason,
    };
    if planes.is_empty() || width == 0 || height == 0 {
        return Err(fault("no channel or no pixel".into()));
    }
    let mut seen = BTreeSet::new();
    let mut list = Vec::new();
    for Plane { name, samples } in planes {
        let pixels = u64::from(width) * u64::from(height);
        let count = match &samples {
            Samples::Float(values) => values.len(),
            Samples::Uint(values) => values.len(),
        };
        if count as u64 != pixels {
            return Err(fault(format!("channel `{name}` has {count} values")));
        }
        let text = Text::new_or_none(&name).filter(|_| !name.is_empty());
        let (Some(text), true) = (text, seen.insert(name.clone())) else {
            let reason = format!("channel name `{name}` is not plain or is doubled");
            return Err(fault(reason));
        };
        let samples = match samples {
            Samples::Float(values) => FlatSamples::F32(values),
            Samples::Uint(values) => FlatSamples::U32(values),
        };
        list.push(AnyChannel::new(text, samples));
    }
    let layer = Layer::new(
        (width as usize, height as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(list.into()),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|error| fault(error.to_string()))?;
    Ok(bytes.into_inner())
}

/// A file with the channel `Y`: the form of visibility and other masks.
///
/// # Errors
/// As [`encode`].
pub fn encode_y(width: u32, height: u32, values: &[f32]) -> Result<Vec<u8>, OutputError> {
    encode(width, height, &[Channel { name: "Y", values }])
}

/// A file with the channels `R`, `G` and `B`, from linear RGB.
///
/// # Errors
/// As [`encode`].
pub fn encode_rgb(width: u32, height: u32, rgb: &[[f32; 3]]) -> Result<Vec<u8>, OutputError> {
    let plane = |i: usize| rgb.iter().map(|pixel| pixel[i]).collect::<Vec<f32>>();
    let planes = [plane(0), plane(1), plane(2)];
    let channel = |name, i: usize| Channel {
        name,
        values: &planes[i],
    };
    let channels = [channel("R", 0), channel("G", 1), channel("B", 2)];
    encode(width, height, &channels)
}

/// All channels of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloatImage {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Name and values, `width * height` each, rows from the top; sorted by name.
    pub channels: Vec<(String, Vec<f32>)>,
}

impl FloatImage {
    /// The values of the channel `name`.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        let mut channels = self.channels.iter();
        channels
            .find(|(n, _)| n == name)
            .map(|(_, values)| &values[..])
    }
}

/// A float image that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file is missing or unreadable.
    #[error("{}: cannot read the image: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not OpenEXR, or broken, or of a kind that is not read.
    #[error("{}: not a readable OpenEXR image: {reason}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The file lacks the channel.
    #[error("{}: no channel `{name}`; the image has {have}", path.display())]
    NoChannel {
        /// The file.
        path: PathBuf,
        /// The channel asked for.
        name: String,
        /// Those there are.
        have: String,
    },
}

/// Reads the first layer of a file at full resolution; other number formats become `f32`.
///
/// # Errors
/// [`ReadError::Read`] or [`ReadError::Invalid`]; the latter also for a data window that differs
/// from the display window and for channels of lower resolution.
pub fn read_image(path: impl AsRef<Path>) -> Result<FloatImage, ReadError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|source| ReadError::Read {
        path: path.into(),
        source,
    })?;
    let invalid = |reason: String| ReadError::Invalid {
        path: path.into(),
        reason,
    };
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| invalid(error.to_string()))?;
    let (layer, window) = (&image.layer_data, image.attributes.display_window);
    if layer.attributes.layer_position != window.position || layer.size != window.size {
        return Err(invalid("its data window is not its display window".into()));
    }
    let (Ok(width), Ok(height)) = (u32::try_from(layer.size.0), u32::try_from(layer.size.1)) else {
        return Err(invalid("it is too large".into()));
    };
    let mut channels = Vec::new();
    for channel in &layer.channel_data.list {
        let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
        if values.len() != layer.size.0 * layer.size.1 {
            return Err(invalid(format!(
                "channel `{}` has a lower resolution",
                channel.name
            )));
        }
        channels.push((channel.name.to_string(), values));
    }
    Ok(FloatImage {
        width,
        height,
        channels,
    })
}

/// Reads the channel `name`: width, height, and the values in rows from the top.
///
/// # Errors
/// As [`read_image`], and [`ReadError::NoChannel`].
pub fn read_channel(path: impl AsRef<Path>, name: &str) -> Result<(u32, u32, Vec<f32>), ReadError> {
    let path = path.as_ref();
    let mut image = read_image(path)?;
    match image.channels.iter().position(|(n, _)| n == name) {
        Some(index) => Ok((
            image.width,
            image.height,
            image.channels.swap_remove(index).1,
        )),
        None => {
            let names: Vec<_> = image.channels.iter().map(|(n, _)| n.as_str()).collect();
            Err(ReadError::NoChannel {
                path: path.into(),
                name: name.into(),
                have: names.join(", "),
            })
        }
    }
}
