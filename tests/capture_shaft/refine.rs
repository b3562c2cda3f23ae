//! More samples for the tiles of `shaft-masks` that need them.

use super::load;
use crate::support::{self, rig::with_renderer};
use antumbra::capture::{FrameRequest, Samples};
use antumbra::scene::Scene;

const SIZE: usize = 32;
const TILE: usize = 8;

/// Visibility of the first light of a scene.
struct Views {
    scene: Scene,
}

impl Views {
    fn of(name: &str) -> Self {
        Self { scene: load(name) }
    }

    fn see(&self, options: &str) -> Vec<f32> {
        self.see_with(options, &[]).0
    }

    fn see_with(&self, options: &str, images: &[&str]) -> (Vec<f32>, Vec<Vec<f32>>) {
        let request = FrameRequest {
            camera: self.scene.select_camera(None).unwrap(),
            size: [SIZE as u32; 2],
            lights: vec![0],
            technique: format!("shaft-masks:{options}").parse().unwrap(),
        };
        let mut frame = with_renderer(&self.scene, |renderer| {
            renderer.render_with_images(&request, images).unwrap()
        });
        let planes = frame.images.iter().map(|image| match &image.planes[0] {
            Samples::Float(values) => values.clone(),
            other => panic!("{other:?}"),
        });
        (frame.lights.remove(0).visibility, planes.collect())
    }
}

/// Of each tile the first of the pictures that it is equal to.
fn sources(image: &[f32], pictures: &[&[f32]]) -> Vec<Option<usize>> {
    let across = SIZE / TILE;
    let tiles = (0..across * across).map(|tile| {
        let (x, y) = (tile % across * TILE, tile / across * TILE);
        let pixels = || (0..TILE * TILE).map(|i| (y + i / TILE) * SIZE + x + i % TILE);
        pictures
            .iter()
            .position(|picture| pixels().all(|i| picture[i] == image[i]))
    });
    tiles.collect()
}

#[track_caller]
fn assert_same(image: &[f32], wanted: &[f32], what: &str) {
    let off = image.iter().zip(wanted).filter(|(v, w)| v != w).count();
    assert_eq!(off, 0, "pixels that differ: {what}");
}

/// Over the pixels that are partly lit.
fn rms(image: &[f32], truth: &[f32]) -> f64 {
    let pairs = image.iter().zip(truth);
    let partly = pairs.filter(|(_, t)| (0.005..0.995).contains(*t));
    let (sum, count) = partly.fold((0.0, 0.0), |(sum, count), (v, t)| {
        (sum + f64::from(v - t).powi(2), count + 1.0)
    });
    f64::sqrt(sum / count)
}

/// One scene and few pictures: with 1024 samples they take seconds on drivers that keep no arrays in
/// registers.
#[test]
fn tiles_get_more_samples_where_they_need_them() {
    let _one = support::serial();
    let views = Views::of("lights.gltf");
    let with_bound = |views: &Views, options: &str| {
        let (image, bounds) = views.see_with(options, &["visibility_bound"]);
        (image, bounds.into_iter().next().unwrap())
    };
    let (few, coarse) = with_bound(&views, "target-error=none");
    let more = views.see("target-error=none,samples=256");
    let (most, fine) = with_bound(&views, "target-error=none,samples=1024");
    let pictures = [&few[..], &more, &most];
    let all = rms(&few, &most);

    assert_same(&views.see("target-error=1"), &few, "it is less already");
    let target = 0.01;
    let image = views.see(&format!("target-error={target}"));
    let from = sources(&image, &pictures);
    let counts = [0, 1, 2].map(|source| from.iter().filter(|s| **s == Some(source)).count());
    let reached = rms(&image, &most);
    println!("target {target}: {reached:.4} of {all:.4}, tiles {counts:?} by samples");
    assert!(from.iter().all(Option::is_some), "each is one of the three");
    assert!(reached < all && reached < 1.5 * target, "{reached}");
    assert!(counts[0] > 0 && counts[1] > 0, "{counts:?}");

    let none = views.see("target-error=0,budget-work=0");
    assert_same(&none, &few, "nothing may be done");
    let options = "target-error=0,budget-work=8000";
    let some = views.see(options);
    assert_same(&views.see(options), &some, "the same again");
    let reached = rms(&some, &most);
    println!("with some work: {reached:.4} of {all:.4}");
    assert!(reached > 0.0 && reached < all, "{reached}");

    let image = views.see("target-error=0,budget-ms=0");
    assert_same(&image, &few, "no time");
    let image = views.see("target-error=0,budget-ms=1000000");
    assert_same(&image, &most, "all the time, and all tiles");

    let most_bound = 0.2;
    let options = format!("target-error=none,bound={most_bound}");
    let (_, within) = with_bound(&views, &options);
    let over = |bounds: &[f32]| bounds.iter().filter(|b| **b > most_bound).count();
    let counts = [&coarse, &fine, &within].map(|bounds| over(bounds));
    println!("above the bound: {counts:?} with 64, 1024 and as many samples as are needed");
    assert!(counts[0] > counts[1], "there is something to do");
    // A pixel is above it only where 1024 samples are.
    for (i, bound) in within.iter().enumerate() {
        let is_done = *bound <= most_bound || *bound == fine[i];
        assert!(is_done, "pixel {i}: {bound}, {}", fine[i]);
    }
    let mut pairs = within.iter().zip(&fine);
    assert!(pairs.any(|(b, fine)| b > fine), "no more than asked for");
}
