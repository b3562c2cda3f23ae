//! Tiles that ask for more than lists have room for: which ones go without is the same each time, and they are right.

use super::*;
use crate::scenes::many_plates;
use antumbra::scene::{Texture, TextureImage, Wrap};

const ACROSS: u32 = 100;
const PITCH: f32 = 0.03;
const PART: f32 = 0.6;
const SMALL: LightShape = LightShape::Disk { radius: 0.1 };

/// Ten thousand plates over the floor, of which a tile sees some hundred edges; half of them of a material with holes,
/// or none. None of the holes is in a plate.
fn plates(holes: bool) -> Scene {
    let mut solid = many_plates(ACROSS, PITCH, PART);
    solid.uvs = vec![glam::Vec2::splat(0.25); solid.positions.len()];
    let mut masked = solid.clone();
    masked.indices = solid.indices.split_off(solid.indices.len() / 2);
    let mut scene = scene(vec![floor(), solid, masked], SMALL);
    scene.images.push(TextureImage {
        name: "holes".to_string(),
        width: 2,
        height: 2,
        texels: [255, 255, 255, 0]
            .map(|alpha| [255, 255, 255, alpha])
            .to_vec(),
    });
    scene.materials.push(Material {
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        base_texture: Some(Texture {
            image: 0,
            wrap: [Wrap::Clamp; 2],
        }),
        ..Material::default()
    });
    scene.primitives[2].material = usize::from(holes);
    scene.finish().unwrap();
    scene
}

fn error(scene: &Scene, image: &[f32]) -> (f32, f32) {
    let (light, places) = (scene.lights[0].light, places(SMALL, 2_000));
    errors(image, 3, |p| {
        truth(p, &light, &places, |p, way| {
            let at = (p + way * ((HEIGHT - 5.0 - p.y) / way.y)) / PITCH + 0.5 * ACROSS as f32;
            let within = |x: f32| (0.0..ACROSS as f32).contains(&x) && x.fract() < PART;
            within(at.x) && within(at.z)
        })
    })
}

#[test]
fn the_same_tiles_find_room_each_time() {
    let _one = support::serial();
    for (holes, limit) in [(false, 0.045), (true, 0.06)] {
        let scene = plates(holes);
        let rooms = ["256", "16", "8", "4"].map(|room| format!("dbuffer:room={room}"));
        let all: Vec<&str> = rooms.iter().map(String::as_str).collect();
        let images = render(&scene, &all);
        for _ in 0..4 {
            let again = render(&scene, &all);
            for (i, room) in rooms.iter().enumerate() {
                assert!(images[i] == again[i], "{room}, holes: {holes}");
            }
        }
        for (image, room) in images.iter().zip(&rooms) {
            let found = error(&scene, image);
            let other = image.iter().zip(&images[0]).filter(|(a, b)| a != b).count();
            println!("{room}, holes {holes}: {found:?}, {other} pixels not as with all room");
            assert!(found.0 <= limit, "{room}, holes {holes}: {found:?}");
        }
    }
}
