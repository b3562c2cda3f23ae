//! What work costs, estimated: only the proportions matter, and that they are the same everywhere.

use super::balance::Cost;
use super::scene_file::SceneFacts;
use crate::shadow::Technique;

/// Microseconds of a software driver on a few cores; a device changes the proportions little.
const FRAME: u64 = 2_000;
const LOAD: u64 = 20_000;
/// Nanoseconds.
const LOAD_TRIANGLE: u64 = 1_000;
const RASTER_TRIANGLE: u64 = 150;
const PIXEL: u64 = 60;

/// What a sample of a map costs of what a pixel's surface does, in hundredths.
const TAP: u64 = 15;

/// What decides the cost of a frame.
pub(super) struct FrameWork {
    pub(super) facts: SceneFacts,
    pub(super) size: [u32; 2],
    pub(super) lights: u64,
    pub(super) technique: Technique,
    /// Times that the frame is rendered.
    pub(super) times: u64,
}

impl FrameWork {
    /// In microseconds; at least 1.
    pub(super) fn cost(&self) -> u64 {
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        let lights = self.lights.max(1);
        let per_pixel = 100 + lights.saturating_mul(weight(self.technique));
        let shading = pixels.saturating_mul(per_pixel).saturating_mul(PIXEL) / 100;
        let raster =
            (self.facts.triangles).saturating_mul((1 + lights).saturating_mul(RASTER_TRIANGLE));
        let frame = FRAME.saturating_add(shading.saturating_add(raster) / 1_000);
        // An animated scene is posed and uploaded for each frame.
        let pose = match self.facts.is_animated {
            true => self.facts.triangles.saturating_mul(LOAD_TRIANGLE) / 1_000,
            false => 0,
        };
        frame.saturating_mul(self.times.max(1)).saturating_add(pose)
    }
}

/// Loading a scene, in microseconds.
pub(super) fn load_cost(facts: SceneFacts) -> u64 {
    LOAD.saturating_add(facts.triangles.saturating_mul(LOAD_TRIANGLE) / 1_000)
}

/// Of a technique at a pixel for one light, in hundredths of what the pixel's surface costs: the
/// samples that its options ask for. One without such options counts as 16 samples, `hard` as 4.
fn weight(technique: Technique) -> u64 {
    if matches!(technique, Technique::Hard) {
        return 4 * TAP;
    }
    let options = technique.option_values();
    let samples = options
        .iter()
        .filter(|(name, _)| ["taps", "search", "slices"].contains(name));
    let samples: u64 = samples
        .filter_map(|(_, value)| value.parse::<u64>().ok())
        .sum();
    TAP.saturating_mul(if samples == 0 { 16 } else { samples })
}

/// Of so many frames of one scene, as `capture` renders them.
pub fn equal_frames(count: usize) -> Vec<Cost> {
    let cost = Cost {
        item: 1,
        ready: 0,
        group: 0,
    };
    vec![cost; count]
}

/// Of a scene and light of `bench`: the truth by `samples` rays a pixel, and `rounds` frames of
/// each technique and of as many rivals of about 16 rays a pixel.
pub fn bench_cost(
    facts: SceneFacts,
    size: [u32; 2],
    samples: u32,
    rounds: u32,
    techniques: &[Technique],
    rivals: usize,
    group: u32,
) -> Cost {
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    // A ray takes about as many steps as the triangles have binary digits.
    let ray = 30 * u64::from(64 - facts.triangles.leading_zeros()).max(1);
    let rays = |per_pixel: u64| pixels.saturating_mul(per_pixel).saturating_mul(ray) / 1_000;
    let rounds = u64::from(rounds) + 1;
    let frames = techniques.iter().map(|&technique| {
        let work = FrameWork {
            facts,
            size,
            lights: 1,
            technique,
            times: rounds,
        };
        work.cost().saturating_add(load_cost(facts))
    });
    let frames = frames.fold(0, u64::saturating_add);
    let rivals = rays(16)
        .saturating_mul(rounds)
        .saturating_mul(rivals as u64);
    let item = rays(u64::from(samples))
        .saturating_add(frames)
        .saturating_add(rivals);
    // Each runs in a process of its own: nothing is shared.
    Cost {
        item: item.max(1),
        ready: 0,
        group,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(triangles: u64, side: u32, lights: u64, technique: &str) -> u64 {
        let facts = SceneFacts {
            triangles,
            lights,
            is_animated: false,
        };
        let technique = technique.parse().unwrap_or(Technique::Hard);
        FrameWork {
            facts,
            size: [side, side],
            lights,
            technique,
            times: 1,
        }
        .cost()
    }

    #[test]
    fn more_work_costs_more() {
        let plain = cost(1_000, 256, 1, "hard");
        assert!(cost(1_000_000, 256, 1, "hard") > plain);
        assert!(cost(1_000, 512, 1, "hard") > 2 * plain);
        assert!(cost(1_000, 256, 4, "hard") > plain);
        assert!(cost(1_000, 256, 1, "pcss:taps=16") > plain);
        assert!(cost(1_000, 256, 1, "pcss:taps=64") > cost(1_000, 256, 1, "pcss:taps=16"));
        let most = SceneFacts {
            triangles: u64::MAX,
            lights: u64::MAX,
            is_animated: true,
        };
        assert_eq!(load_cost(most), LOAD.saturating_add(u64::MAX / 1_000));
    }
}
