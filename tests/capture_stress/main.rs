//! Hard scenes on the GPU, by every technique: what must hold whatever makes the shadow.
#![cfg(feature = "cli")]

#[path = "../support/mod.rs"]
mod support;

mod compare;
mod guises;
mod limits;
mod rig;
mod scenes;
