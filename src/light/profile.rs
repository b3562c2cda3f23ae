//! How the brightness of a line light goes along it.

use super::LightError;
use std::fmt;
use std::str::FromStr;

/// Most numbers of a profile.
pub const MAX_PROFILE: usize = 8;

/// Brightness along a line from its start (-x) to its end, relative: numbers of 0 or more at equal
/// distances, the first one at the start and the last one at the end, straight between. The paper on
/// occluding edges leaves this function open (Reimann and Dreier, section 3.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightProfile {
    values: [f32; MAX_PROFILE],
    count: usize,
}

impl LightProfile {
    /// The same all along.
    pub const EVEN: Self = Self {
        values: [1.0; MAX_PROFILE],
        count: 2,
    };

    /// A profile of 2 to [`MAX_PROFILE`] finite numbers of 0 or more that are not all 0; `None` for
    /// others.
    pub fn new(values: &[f32]) -> Option<Self> {
        let sum: f32 = values.iter().sum();
        let fits = (2..=MAX_PROFILE).contains(&values.len())
            && values.iter().all(|v| (0.0..=1.0e6).contains(v))
            && sum > 1.0e-6;
        if !fits {
            return None;
        }
        let mut held = [0.0; MAX_PROFILE];
        held[..values.len()].copy_from_slice(values);
        Some(Self {
            values: held,
            count: values.len(),
        })
    }

    /// The numbers.
    pub fn values(&self) -> &[f32] {
        &self.values[..self.count]
    }

    /// True if all numbers are the same.
    pub fn is_even(&self) -> bool {
        self.values().iter().all(|v| *v == self.values[0])
    }

    /// The part of the light before each of the numbers' places: 0 first, 1 last.
    pub fn parts_before(&self) -> Vec<f64> {
        let mut sum = 0.0;
        let mut sums = vec![0.0];
        for pair in self.values().windows(2) {
            sum += 0.5 * (f64::from(pair[0]) + f64::from(pair[1]));
            sums.push(sum);
        }
        sums.iter().map(|part| part / sum).collect()
    }

    /// The place, 0 to 1, before which lies a part of the light, 0 to 1.
    pub fn place_of(&self, part: f64) -> f64 {
        if self.is_even() {
            return part;
        }
        let before = self.parts_before();
        let cells = before.len() - 1;
        let cell = (0..cells)
            .find(|i| part <= before[i + 1])
            .unwrap_or(cells - 1);
        let [a, b] = [self.values[cell], self.values[cell + 1]].map(f64::from);
        // a x + (b - a) x^2 / 2 is what lies before x in the cell; as a root without cancellation.
        let whole = 0.5 * (a + b);
        let held = before[cell + 1] - before[cell];
        let wanted = if held > 0.0 {
            whole * ((part - before[cell]) / held).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let root = (a * a + 2.0 * (b - a) * wanted).max(0.0).sqrt();
        let x = if a + root > 0.0 {
            2.0 * wanted / (a + root)
        } else {
            0.0
        };
        (cell as f64 + x.min(1.0)) / cells as f64
    }
}

impl fmt::Display for LightProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<String> = self.values().iter().map(f32::to_string).collect();
        f.write_str(&words.join(","))
    }
}

impl FromStr for LightProfile {
    type Err = LightError;

    /// Reads numbers with commas between.
    fn from_str(text: &str) -> Result<Self, LightError> {
        let values: Option<Vec<f32>> = text
            .split(',')
            .map(|word| word.trim().parse().ok())
            .collect();
        values
            .and_then(|values| Self::new(&values))
            .ok_or_else(|| LightError::Profile { text: text.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts() {
        let profile: LightProfile = "0,1, 0.5".parse().unwrap();
        assert_eq!(profile.values(), [0.0, 1.0, 0.5]);
        assert_eq!(profile.to_string(), "0,1,0.5");
        for bad in [
            "",
            "1",
            "0,0",
            "-1,2",
            "nan,1",
            "1,inf",
            "1,2,3,4,5,6,7,8,9",
            "1;2",
        ] {
            let error = bad.parse::<LightProfile>().expect_err(bad).to_string();
            assert!(error.contains("light profile"), "{error}");
        }
    }

    #[test]
    fn places_are_where_their_part_of_the_light_is() {
        for text in ["1,1", "0,1", "1,0", "0,1,0", "0,0,3,1", "2,0,0,1"] {
            let profile: LightProfile = text.parse().unwrap();
            let cells = profile.values().len() - 1;
            let bright = |x: f64| {
                let at = (x * cells as f64).min(cells as f64 - 1.0e-9);
                let (cell, rest) = (at as usize, at.fract());
                let [a, b] = [profile.values()[cell], profile.values()[cell + 1]].map(f64::from);
                a + (b - a) * rest
            };
            const STEPS: usize = 20_000;
            let step = |i: usize| bright((i as f64 + 0.5) / STEPS as f64);
            let whole: f64 = (0..STEPS).map(step).sum();
            for part in [0.0, 0.1, 0.37, 0.5, 0.9, 1.0] {
                let place = profile.place_of(part);
                let before: f64 = (0..(place * STEPS as f64).round() as usize).map(step).sum();
                assert!(
                    (before / whole - part).abs() < 1.0e-3,
                    "{text}, {part}: {place}"
                );
            }
        }
    }
}
