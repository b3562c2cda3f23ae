//! `auto`: the technique for each light, from measured times and errors.
//!
//! Each light becomes a [`Case`]: what of it, of the scene and of the picture says how hard its shadows are to find.
//! A [`Table`] of measured cases estimates error and time of each candidate for it, and [`choose`] takes the cheapest
//! whose estimate is good enough, or the best that several lights can afford together. Nothing is timed: the same scene,
//! request and table give the same choice. See `docs/auto.md`.

mod case;
mod choice;
mod held_out;
mod options;
mod table;

pub use case::Case;
pub use choice::{Choice, choose};
pub use held_out::{HeldOut, held_out};
pub use options::AutoOptions;
pub use table::{Expected, Row, Table, TableError};

/// Name on the command line.
pub(in crate::shadow) const NAME: &str = "auto";
