//! Places on a light at which layers are counted.

/// Most texels of places: `MOST_SAMPLE_TEXELS` in `dbuffer/params.glsl`.
pub(super) const MOST_TEXELS: usize = 32;

/// The golden angle, radians: points of a spiral turned by it lie evenly (Vogel 1979).
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Places -1 to 1 along both axes of a light, evenly over a disk or rectangle: four first
/// coordinates, then their four second ones.
pub(super) fn texels(count: u32, is_rect: bool) -> [[f32; 4]; MOST_TEXELS] {
    let mut texels = [[0.0; 4]; MOST_TEXELS];
    for i in 0..count as usize {
        let [u, v] = if is_rect {
            on_square(i, count)
        } else {
            on_disk(i, count)
        };
        texels[i / 4 * 2][i % 4] = u as f32;
        texels[i / 4 * 2 + 1][i % 4] = v as f32;
    }
    texels
}

fn on_disk(i: usize, count: u32) -> [f64; 2] {
    let radius = ((i as f64 + 0.5) / f64::from(count)).sqrt();
    // Turned, so that no place lies along an axis, where edges may.
    let (sine, cosine) = (GOLDEN_ANGLE * (i as f64 + 0.3)).sin_cos();
    [radius * cosine, radius * sine]
}

/// A lattice turned by the golden ratio: even along the first axis, and nearly so along the second.
fn on_square(i: usize, count: u32) -> [f64; 2] {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let first = (i as f64 + 0.5) / f64::from(count);
    let second = (i as f64 * GOLDEN + 0.3).fract();
    [2.0 * first - 1.0, 2.0 * second - 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_even_over_the_light() {
        for count in [32, 64] {
            for is_rect in [false, true] {
                let texels = texels(count, is_rect);
                let places = (0..count as usize)
                    .map(|i| [texels[i / 4 * 2][i % 4], texels[i / 4 * 2 + 1][i % 4]]);
                let mean = places
                    .clone()
                    .fold([0.0; 2], |sum: [f32; 2], p| [sum[0] + p[0], sum[1] + p[1]]);
                assert!(
                    mean.iter().all(|m| m.abs() < 0.06 * count as f32),
                    "{mean:?}"
                );
                for [u, v] in places {
                    let out = if is_rect {
                        u.abs().max(v.abs())
                    } else {
                        u.hypot(v)
                    };
                    assert!(out < 1.0, "{u} {v}");
                }
            }
        }
    }
}
