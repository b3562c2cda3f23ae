//! Writes the scenes of `benches/studies/`: after the figures of the papers, made by rule.
//!
//! ```sh
//! cargo run --release --example make_figures            # into out/figures/
//! cargo run --release --example make_figures -- FOLDER
//! cargo run --release --example make_figures -- FOLDER bunny-70k tree
//! ```
//!
//! The same code gives the same bytes on every run.

#![allow(
    dead_code,
    reason = "what is shared with make_assets has more than is used here"
)]

use std::path::Path;

#[path = "../make_assets/document.rs"]
mod document;
mod field;
#[path = "../make_assets/file.rs"]
mod file;
#[path = "../make_assets/math.rs"]
mod math;
#[path = "../make_assets/mesh.rs"]
mod mesh;
mod net;
mod scenes;
#[path = "../make_assets/shapes.rs"]
mod shapes;

type Recipe = fn() -> document::Document;

/// Name and recipe of every scene.
const SCENES: [(&str, Recipe); 21] = {
    use scenes::{bodies, flat, plants, tube};
    [
        ("bunny-4k", || bodies::bunny(4_500)),
        ("bunny-10k", || bodies::bunny(10_000)),
        ("bunny-18k", || bodies::bunny(18_000)),
        ("bunny-70k", || bodies::bunny(70_000)),
        ("bunny-270k", || bodies::bunny(270_000)),
        ("bunny-1500k", || bodies::bunny(1_500_000)),
        ("animal", bodies::animal),
        ("teapots", bodies::teapots),
        ("aircraft", bodies::aircraft),
        ("dents", bodies::dents),
        ("concave", flat::concave),
        ("knot-low", || flat::knot(0.6)),
        ("knot-middle", || flat::knot(1.4)),
        ("knot-high", || flat::knot(2.4)),
        ("bars", flat::bars),
        ("tree", plants::tree),
        ("bush", plants::bush),
        ("corners", plants::corners),
        ("geometric", tube::geometric),
        ("overlap", tube::overlap),
        ("everyday", tube::everyday),
    ]
};

fn main() -> std::io::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().unwrap_or_else(|| "out/figures".into());
    let asked: Vec<String> = arguments.collect();
    std::fs::create_dir_all(&folder)?;
    for (name, scene) in SCENES {
        if asked.is_empty() || asked.iter().any(|asked| asked == name) {
            let path = Path::new(&folder).join(name).with_extension("glb");
            let bytes = file::bytes(&scene(), true);
            std::fs::write(&path, &bytes)?;
            println!("{}: {} bytes", path.display(), bytes.len());
        }
    }
    Ok(())
}
