//! One function a scene.

pub mod animated;
pub mod bars;
pub mod basic;
pub mod court;
pub mod foliage;
pub mod lights;
pub mod odd;
pub mod room;
