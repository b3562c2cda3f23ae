//! Given sets of light samples, the same at every pixel.

use std::fmt::Write as _;
use std::path::Path;

use glam::DVec2;

use super::ReferenceError;
use super::samples::LightFrom;
use super::triangles::End;
use crate::light::ShapeKind;

/// Most samples of a pattern.
pub const MAX_PATTERN: usize = 1 << 16;

/// Samples of a light that are cast from every pixel alike.
///
/// As text: one sample a line, two numbers in the light's own coordinates, `#` to the end of the
/// line is a comment. A rectangle reaches from -1 to 1 along `axis_x` and `axis_y`, a line from -1
/// to 1 in the first number (the second is ignored). Disk, sphere and sun are the unit disk: of a
/// sphere the disk bounded by its outline, of a sun the disk on which equal areas are equal solid
/// angles, both with (1, 0) towards `axis_x` turned across the line of sight.
///
/// By name: `gridN`, N from 1 to 256, the middles of N x N equal squares; on a disk those are the
/// images under the equal-area map of Shirley and Chiu.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    places: Places,
}

#[derive(Clone, Debug, PartialEq)]
enum Places {
    /// Within the unit square, to be mapped onto the shape.
    Square(Vec<DVec2>),
    /// On the shape itself.
    Light(Vec<DVec2>),
}

impl Pattern {
    /// The pattern called `name`, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        let digits = name.strip_prefix("grid")?;
        if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
        let side: u32 = digits.parse().ok().filter(|n| (1..=256).contains(n))?;
        let middle = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
        let points = (0..side * side).map(|i| DVec2::new(middle(i % side), middle(i / side)));
        Some(Self {
            places: Places::Square(points.collect()),
        })
    }

    /// The samples of a text.
    ///
    /// # Errors
    /// [`ReferenceError::Pattern`], naming the line: not two numbers, out of range, none or too
    /// many samples. `origin` is what the message calls the text.
    pub fn parse(text: &str, origin: &str) -> Result<Self, ReferenceError> {
        let fault = |line: usize, reason: String| ReferenceError::Pattern {
            origin: origin.into(),
            line,
            reason,
        };
        let mut points = Vec::new();
        let mut last = 1;
        for (number, line) in text.lines().enumerate() {
            last = number + 1;
            let content = line.split('#').next().unwrap_or_default();
            let words: Vec<&str> = content.split_whitespace().collect();
            if words.is_empty() {
                continue;
            }
            let value = |word: &str| {
                let value = word.parse::<f64>().ok();
                value.filter(|value| (-1.0..=1.0).contains(value))
            };
            let [u, v] = words[..] else {
                let reason = format!("{} words; give two numbers, `u v`", words.len());
                return Err(fault(last, reason));
            };
            let (Some(u), Some(v)) = (value(u), value(v)) else {
                let mut shown: String = content.trim().chars().take(40).collect();
                if shown.len() < content.trim().len() {
                    let _ = write!(shown, "...");
                }
                let reason = format!("`{shown}` is not two numbers from -1 to 1");
                return Err(fault(last, reason));
            };
            if points.len() == MAX_PATTERN {
                return Err(fault(last, format!("more than {MAX_PATTERN} samples")));
            }
            points.push(DVec2::new(u, v));
        }
        if points.is_empty() {
            return Err(fault(last, "no samples; give one `u v` a line".into()));
        }
        Ok(Self {
            places: Places::Light(points),
        })
    }

    /// The pattern in a file.
    ///
    /// # Errors
    /// [`ReferenceError::ReadPattern`], or as [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ReferenceError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|source| ReferenceError::ReadPattern {
            path: path.into(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Number of samples, at least 1.
    pub fn len(&self) -> usize {
        self.points().len()
    }

    /// Always false: a pattern has samples.
    pub fn is_empty(&self) -> bool {
        self.points().is_empty()
    }

    pub(super) fn points(&self) -> &[DVec2] {
        match &self.places {
            Places::Square(points) | Places::Light(points) => points,
        }
    }

    pub(super) fn is_square(&self) -> bool {
        matches!(self.places, Places::Square(_))
    }

    /// Sample `index` on a light, and its place within the unit square.
    pub(super) fn end(&self, light: &LightFrom, index: usize) -> (DVec2, End) {
        match &self.places {
            Places::Square(points) => (points[index], light.spread(points[index])),
            Places::Light(points) => (0.5 * points[index] + 0.5, light.at(points[index])),
        }
    }

    /// Checks that all samples lie on a light of that shape.
    pub(super) fn check(&self, shape: ShapeKind) -> Result<(), ReferenceError> {
        let is_round = matches!(shape, ShapeKind::Disk | ShapeKind::Sphere | ShapeKind::Sun);
        let Places::Light(points) = &self.places else {
            return Ok(());
        };
        let outside = |p: &&DVec2| is_round && p.length_squared() > 1.0 + 1.0e-6;
        match points.iter().find(outside) {
            Some(p) => Err(ReferenceError::PatternOutside { at: *p, shape }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names() {
        assert_eq!(Pattern::named("grid8").map(|p| p.len()), Some(64));
        assert_eq!(Pattern::named("grid16").map(|p| p.len()), Some(256));
        for bad in ["", "grid", "grid0", "grid257", "grid+8", "grid8x", "8"] {
            assert!(Pattern::named(bad).is_none(), "{bad}");
        }
    }

    #[test]
    fn texts() -> Result<(), ReferenceError> {
        let pattern = Pattern::parse("# two\n0 0\n\n  -1 0.5e-1 # last\n", "t")?;
        assert_eq!(
            pattern.places,
            Places::Light(vec![DVec2::ZERO, DVec2::new(-1.0, 0.05)])
        );
        for (text, wanted) in [
            ("", "t:1: no samples"),
            ("0 0\n1", "t:2: 1 words"),
            ("0 0 0", "t:1: 3 words"),
            (
                "0 0\n# c\n2 0",
                "t:3: `2 0` is not two numbers from -1 to 1",
            ),
            ("nan 0", "not two numbers"),
            ("a b", "not two numbers"),
        ] {
            let message = match Pattern::parse(text, "t") {
                Ok(_) => panic!("accepted: {text}"),
                Err(error) => error.to_string(),
            };
            assert!(message.contains(wanted), "{message}");
        }
        let corner = Pattern::parse("1 1", "t")?;
        assert!(corner.check(ShapeKind::Rect).is_ok());
        assert!(corner.check(ShapeKind::Disk).is_err());
        Ok(())
    }
}
