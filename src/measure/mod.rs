//! How far an image is from the truth: error measures, heat maps, and perceived difference.

mod difference;
mod error;
mod heatmap;

pub use difference::{Flip, flip};
pub use error::{ErrorMeasures, MeasureError, Measures, PENUMBRA, measure};
pub use heatmap::{HeatMap, heat_map};
