//! One function a scene. Metres; the ground is y = 0.

pub mod bodies;
pub mod flat;
pub mod plants;
pub mod tube;

use super::document::Document;
use super::shapes::plane;

/// A document with its ground.
fn grounded() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.62, 0.60, 0.57]);
    b.add("ground", ground, &plane(40.0));
    b
}
