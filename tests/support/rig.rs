//! One renderer for the tests of a file.

use std::sync::{Mutex, PoisonError};

use antumbra::capture::{FrameRenderer, FrameRequest};
use antumbra::scene::Scene;

use super::plates::{SIZE, camera};

static SHARED: Mutex<Option<FrameRenderer<'static>>> = Mutex::new(None);

/// Goes on with the renderer of the process's earlier tests, whose pipelines are made: some drivers take
/// seconds for them. What a frame needs of memory is made for each scene anew.
///
/// Fails on any message of the validation layer. Nobody destroys the renderer, so that objects which
/// leak are for tests with a device of their own to see (`capture_stress`, with every technique). After a
/// test that fails the next one begins with another device.
#[track_caller]
pub fn with_renderer<T>(scene: &Scene, draw: impl FnOnce(&mut FrameRenderer<'static>) -> T) -> T {
    let take = || SHARED.lock().unwrap_or_else(PoisonError::into_inner).take();
    let mut renderer = match take() {
        Some(mut renderer) => {
            renderer.set_scene(scene.clone()).unwrap();
            renderer
        }
        None => FrameRenderer::owning(super::gpu(), scene.clone()).unwrap(),
    };
    let drawn = draw(&mut renderer);
    super::assert_no_messages(&renderer.gpu().messages());
    *SHARED.lock().unwrap_or_else(PoisonError::into_inner) = Some(renderer);
    drawn
}

/// Visibility of a scene's first light on the floor below `plates::camera`, by each technique.
#[track_caller]
pub fn render(scene: &Scene, techniques: &[&str]) -> Vec<Vec<f32>> {
    with_renderer(scene, |renderer| {
        let images = techniques.iter().map(|technique| {
            let request = FrameRequest {
                camera: camera(),
                size: [SIZE; 2],
                lights: vec![0],
                technique: technique.parse().unwrap(),
            };
            let mut frame = renderer.render(&request).unwrap();
            frame.lights.remove(0).visibility
        });
        images.collect()
    })
}
