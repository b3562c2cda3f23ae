//! Options of `occlusion-textures`.

use crate::shadow::TechniqueOption;
use crate::shadow::technique::{CLASSES, switch, switched};

/// How boxes of an occlusion texture are averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Filter {
    /// Mipmaps, trilinear.
    Mipmaps,
    /// N-buffers (Décoret 2005), levels weighed linearly in the kernel's size.
    NBuffersLinear,
    /// N-buffers, levels weighed by the logarithm of the kernel's size.
    NBuffersLog,
    /// Summed-area tables of whole numbers: exact.
    SummedAreas,
}

/// How the textures of several groups of slices are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Combine {
    /// Product of what passes each: as published.
    Product,
    /// All that is blocked, added up.
    Sum,
    /// The most that any one blocks.
    Maximum,
    /// A product, with each texture filled into the next one too: the published fix for thin
    /// occluders.
    Thin,
    /// Product of what each adds to those nearer to the light.
    Cumulative,
    /// The same, and no more than passes any one.
    Bounded,
}

/// How planes lie in the casters' depth range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Planes {
    /// Evenly.
    Uniform,
    /// Evenly in 1 / depth.
    Reciprocal,
    /// Half and half.
    Blend,
}

/// Where a view's centre of projection is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Projection {
    /// At the light's centre; the faces of a cube where that looks too wide.
    Centered,
    /// Behind the light, so that the frustum through its border holds the casters.
    Offset,
    /// Infinitely far behind it.
    Orthographic,
}

/// What depth the slices are spent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fit {
    /// The whole range of the casters; empty slices are skipped.
    Range,
    /// Where something is: finer slices are cut first, and the occupied ones are joined.
    Occupied,
}

/// Texels of the slices across a view's largest kernel, unless bounds on the image's size say otherwise.
const TEXELS_A_KERNEL: f64 = 280.0;

/// Options of `occlusion-textures`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OcclusionOptions {
    /// Occlusion textures, 4 to 128.
    pub slices: u32,
    /// The filter.
    pub filter: Filter,
    /// The combination.
    pub combine: Combine,
    /// The planes.
    pub planes: Planes,
    /// The projection.
    pub projection: Projection,
    /// What the slices are spent on.
    pub fit: Fit,
    /// Texels across the slices' image, 64 to 4096, a power of two; `None`: by the largest kernel.
    pub resolution: Option<u32>,
    /// Texels of it across one of the filtered textures, 1, 2, 4 or 8; `None`: by the size of kernels.
    pub detail: Option<u32>,
    /// A texture lies in the middle of its slices, not in their lowest plane.
    pub middle: bool,
    /// Rays of the test for blockers near the receiver, 0 to 64; it needs [`Fit::Occupied`].
    pub contact: u32,
    /// Leave out textures that hold nothing, or add nothing, within a kernel.
    pub early: bool,
    /// Tiles of the picture that see all of the light or nothing of it are told from the triangles
    /// between them and the light, and left out; not with `count_fetches`.
    pub classes: bool,
    /// Make an image of the work instead: texture accesses of filters at each pixel, in 1024ths.
    pub count_fetches: bool,
}

impl OcclusionOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        slices: 32,
        filter: Filter::SummedAreas,
        combine: Combine::Cumulative,
        planes: Planes::Blend,
        projection: Projection::Centered,
        fit: Fit::Occupied,
        resolution: None,
        detail: None,
        middle: true,
        contact: 8,
        early: true,
        classes: false,
        count_fetches: false,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption::new("slices", "32", "4 to 128", "occlusion textures"),
        TechniqueOption::new(
            "filter",
            "sat",
            "sat, nbuffers (levels weighed linearly), nbuffers-log or mipmaps",
            "how boxes of a texture are averaged",
        ),
        TechniqueOption::new(
            "combine",
            "cumulative",
            "cumulative (by what each adds), bounded (and no more than passes any one), product, sum, \
             maximum or thin (product, each texture filled into the next)",
            "how textures are combined",
        ),
        TechniqueOption::new(
            "planes",
            "blend",
            "uniform, reciprocal (even in 1/depth) or blend (half and half)",
            "how slices lie in the casters' depth range",
        ),
        TechniqueOption::new(
            "projection",
            "centered",
            "centered (cube faces where wide), offset (behind the light) or orthographic",
            "where the scene is sliced from",
        ),
        TechniqueOption::new(
            "fit",
            "occupied",
            "occupied (cut finer, join what holds something) or range",
            "what depths the slices are spent on",
        ),
        TechniqueOption::new(
            "resolution",
            "auto",
            "64 to 4096, a power of two, or auto (280 for the largest kernel, 512 to 2048)",
            "texels across the slices",
        ),
        TechniqueOption::new(
            "detail",
            "auto",
            "1, 2, 4, 8 or auto (4, but 2 under kernels below an eighth of the view)",
            "texels of the slices across one of the filtered textures",
        ),
        TechniqueOption::new(
            "depth",
            "middle",
            "middle or lower",
            "where in its slice a texture lies",
        ),
        TechniqueOption::new(
            "contact",
            "8",
            "0 to 64",
            "rays of the test for blockers near the receiver",
        ),
        TechniqueOption::new(
            "early",
            "on",
            "on or off",
            "whether textures that can add nothing to a pixel are left out",
        ),
        CLASSES,
        TechniqueOption::new(
            "show",
            "visibility",
            "visibility or fetches (texture accesses of filters, in 1024ths)",
            "what the image holds",
        ),
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        let filter = match self.filter {
            Filter::Mipmaps => "mipmaps",
            Filter::NBuffersLinear => "nbuffers",
            Filter::NBuffersLog => "nbuffers-log",
            Filter::SummedAreas => "sat",
        };
        let combine = match self.combine {
            Combine::Product => "product",
            Combine::Sum => "sum",
            Combine::Maximum => "maximum",
            Combine::Thin => "thin",
            Combine::Cumulative => "cumulative",
            Combine::Bounded => "bounded",
        };
        let planes = match self.planes {
            Planes::Uniform => "uniform",
            Planes::Reciprocal => "reciprocal",
            Planes::Blend => "blend",
        };
        let projection = match self.projection {
            Projection::Centered => "centered",
            Projection::Offset => "offset",
            Projection::Orthographic => "orthographic",
        };
        let fit = match self.fit {
            Fit::Range => "range",
            Fit::Occupied => "occupied",
        };
        vec![
            self.slices.to_string(),
            filter.to_string(),
            combine.to_string(),
            planes.to_string(),
            projection.to_string(),
            fit.to_string(),
            self.resolution
                .map_or("auto".to_string(), |texels| texels.to_string()),
            self.detail
                .map_or("auto".to_string(), |texels| texels.to_string()),
            if self.middle { "middle" } else { "lower" }.to_string(),
            self.contact.to_string(),
            switched(self.early),
            switched(self.classes),
            if self.count_fetches {
                "fetches"
            } else {
                "visibility"
            }
            .to_string(),
        ]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = |range: std::ops::RangeInclusive<u32>| {
            value.parse::<u32>().ok().filter(|n| range.contains(n))
        };
        match option {
            "slices" => self.slices = number(4..=128)?,
            "filter" => {
                self.filter = match value {
                    "sat" => Filter::SummedAreas,
                    "nbuffers" => Filter::NBuffersLinear,
                    "nbuffers-log" => Filter::NBuffersLog,
                    "mipmaps" => Filter::Mipmaps,
                    _ => return None,
                }
            }
            "combine" => {
                self.combine = match value {
                    "product" => Combine::Product,
                    "sum" => Combine::Sum,
                    "maximum" => Combine::Maximum,
                    "thin" => Combine::Thin,
                    "cumulative" => Combine::Cumulative,
                    "bounded" => Combine::Bounded,
                    _ => return None,
                }
            }
            "planes" => {
                self.planes = match value {
                    "uniform" => Planes::Uniform,
                    "reciprocal" => Planes::Reciprocal,
                    "blend" => Planes::Blend,
                    _ => return None,
                }
            }
            "projection" => {
                self.projection = match value {
                    "centered" => Projection::Centered,
                    "offset" => Projection::Offset,
                    "orthographic" => Projection::Orthographic,
                    _ => return None,
                }
            }
            "fit" => {
                self.fit = match value {
                    "range" => Fit::Range,
                    "occupied" => Fit::Occupied,
                    _ => return None,
                }
            }
            "resolution" if value == "auto" => self.resolution = None,
            "resolution" => {
                self.resolution = Some(number(64..=4096).filter(|n| n.is_power_of_two())?);
            }
            "detail" if value == "auto" => self.detail = None,
            "detail" => self.detail = Some(number(1..=8).filter(|n| n.is_power_of_two())?),
            "depth" => {
                self.middle = match value {
                    "middle" => true,
                    "lower" => false,
                    _ => return None,
                }
            }
            "contact" => self.contact = number(0..=64)?,
            "early" => self.early = switch(value)?,
            "classes" => self.classes = switch(value)?,
            "show" => {
                self.count_fetches = match value {
                    "visibility" => false,
                    "fetches" => true,
                    _ => return None,
                }
            }
            _ => return None,
        }
        Some(())
    }

    /// Slices that the scene is cut into before they are joined.
    pub(super) fn fine_slices(&self) -> u32 {
        match self.fit {
            Fit::Range => self.slices,
            Fit::Occupied => (4 * self.slices).next_multiple_of(32).min(128),
        }
    }

    /// Texels across the slices' image for a picture of this size in pixels and a view whose largest
    /// kernel covers this part of the image: about [`TEXELS_A_KERNEL`] for that, no more than some for
    /// each pixel, and no more than memory and time are good for. Finer ones measured no better.
    pub(super) fn texels(&self, picture: [u32; 2], most_kernel: f64) -> u32 {
        let longer = picture[0].max(picture[1]);
        let most = (8 * longer.min(256)).next_power_of_two().clamp(512, 2048);
        let across = TEXELS_A_KERNEL / most_kernel.sqrt().max(1.0e-6);
        let fitting = across.log2().round().clamp(9.0, 11.0).exp2() as u32;
        self.resolution.unwrap_or(fitting.min(most))
    }

    /// Texels of the bits across one of the filtered textures, for a view whose largest kernel covers
    /// this part of the image. Small kernels span few texels, whose borders then count.
    pub(super) fn texels_filtered(&self, most_kernel: f64) -> u32 {
        let small = most_kernel.sqrt() < 0.125;
        self.detail.unwrap_or(if small { 2 } else { 4 })
    }

    /// 32-bit words that hold a bit for each fine slice.
    pub(super) fn words(&self) -> u32 {
        self.fine_slices().div_ceil(32)
    }
}
