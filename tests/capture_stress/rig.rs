//! A device that draws cases.

use antumbra::capture::{FrameRenderer, FrameRequest};
use antumbra::shadow::Technique;
use antumbra::stress::Case;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Pictures' sides in pixels.
pub const SIDE: u32 = 64;
/// Pixels of a picture.
pub const PIXELS: usize = (SIDE * SIDE) as usize;

/// A renderer that goes from case to case.
pub struct Rig {
    renderer: Option<FrameRenderer<'static>>,
}

impl Rig {
    pub fn new() -> Self {
        Self { renderer: None }
    }

    /// Visibility of the case's light, rows from the top; each value is checked to be one.
    #[track_caller]
    pub fn draw(&mut self, case: &Case, technique: Technique) -> Vec<f32> {
        let request = FrameRequest {
            camera: case.camera.clone(),
            size: [SIDE; 2],
            lights: vec![case.light],
            technique,
        };
        let renderer = match &mut self.renderer {
            Some(renderer) => {
                renderer.set_scene(case.scene.clone()).unwrap();
                renderer
            }
            None => {
                let gpu = crate::support::gpu();
                let renderer = FrameRenderer::owning(gpu, case.scene.clone()).unwrap();
                self.renderer.insert(renderer)
            }
        };
        let frame = renderer.render(&request).unwrap();
        let visibility = frame.lights[0].visibility.clone();
        assert_eq!(visibility.len(), PIXELS);
        for (i, v) in visibility.iter().enumerate() {
            let at = (i as u32 % SIDE, i as u32 / SIDE);
            // Written so that NaN fails.
            let name = technique.name();
            assert!(
                (0.0..=1.0).contains(v),
                "{name}, {}: {v} at {at:?}",
                case.name
            );
        }
        visibility
    }

    /// As [`draw`](Self::draw), but a picture that any test of this process has drawn is not drawn again:
    /// `scenes::every_case` shows that it would be the same. Cases are told by their names.
    #[track_caller]
    pub fn draw_once(&mut self, case: &Case, technique: Technique) -> Arc<Vec<f32>> {
        static DRAWN: Mutex<Option<HashMap<String, Arc<Vec<f32>>>>> = Mutex::new(None);
        let name = format!("{} {technique:?}", case.name);
        let drawn = || DRAWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(picture) = drawn().get_or_insert_default().get(&name) {
            return picture.clone();
        }
        let picture = Arc::new(self.draw(case, technique));
        let mut drawn = drawn();
        drawn.get_or_insert_default().insert(name, picture.clone());
        picture
    }

    /// Ends the device; the validation layer must have been silent.
    #[track_caller]
    pub fn end(self) {
        if let Some(renderer) = self.renderer {
            crate::support::assert_no_messages(&renderer.destroy().unwrap());
        }
    }
}
