//! Writes the scenes of `assets/`.
//!
//! ```sh
//! cargo run --example make_assets            # into assets/
//! cargo run --example make_assets -- FOLDER
//! ```
//!
//! Coordinates are rounded before they are written, so that the last bit of a platform's sine does
//! not reach the files: the same code gives the same bytes everywhere.

#![allow(
    dead_code,
    reason = "tests include this file as a module and leave main unused"
)]

mod document;
mod figures;
mod file;
mod math;
mod mesh;
mod png;
mod scenes;
mod shapes;

fn main() -> std::io::Result<()> {
    let folder = std::env::args_os()
        .nth(1)
        .unwrap_or_else(|| "assets".into());
    for (name, bytes) in scenes() {
        let path = std::path::Path::new(&folder).join(name);
        std::fs::write(&path, &bytes)?;
        println!("{}: {} bytes", path.display(), bytes.len());
    }
    Ok(())
}

/// File name and content of every scene.
pub fn scenes() -> Vec<(&'static str, Vec<u8>)> {
    use scenes::{animated, bars, basic, court, foliage, lights, odd, room};
    [
        ("sphere_over_plane.gltf", basic::sphere_over_plane()),
        ("poles.gltf", basic::poles()),
        ("blockers.gltf", basic::blockers()),
        ("sun_court.glb", court::sun_court()),
        ("comb.gltf", bars::comb()),
        ("fences.gltf", bars::fences()),
        ("foliage.glb", foliage::foliage()),
        ("room.glb", room::room()),
        ("tube.gltf", lights::tube()),
        ("figure.glb", animated::figure()),
        ("lights.gltf", lights::lights()),
        ("mirrored.gltf", odd::mirrored()),
        ("far_away.gltf", odd::far_away()),
    ]
    .map(|(name, document)| (name, file::bytes(&document, name.ends_with(".glb"))))
    .into()
}
