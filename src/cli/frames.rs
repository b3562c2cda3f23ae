//! Which frames are rendered, and at which moment each of them is.

use std::ops::Range;
use std::str::FromStr;

/// Most frames of one run, so that their names can be checked before the first is rendered.
const MAX_FRAMES: u32 = 100_000;

/// `A..B`: the frames A to B - 1, at least one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameRange {
    first: u32,
    end: u32,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| {
            let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
            text.parse::<u32>().ok().filter(|_| digits)
        };
        let (first, end) = text.split_once("..").unwrap_or((text, ""));
        let (Some(first), Some(end)) = (number(first), number(end)) else {
            return Err("give A..B for the frames A to B - 1, such as 0..24".into());
        };
        if first >= end {
            return Err(format!(
                "no frame: {first}..{end} is from {first} to before {end}; B has to be above A"
            ));
        }
        if end - first > MAX_FRAMES {
            return Err(format!(
                "more than {MAX_FRAMES} frames; render them in several runs"
            ));
        }
        Ok(Self { first, end })
    }
}

/// Frames per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fps(f64);

impl FromStr for Fps {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let fps = text
            .parse()
            .ok()
            .filter(|fps: &f64| fps.is_finite() && *fps > 0.0);
        fps.map(Self)
            .ok_or_else(|| "give frames per second above 0, such as 24".into())
    }
}

/// The frames of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timeline {
    range: Option<FrameRange>,
    start: f64,
    fps: f64,
}

impl Timeline {
    /// Frames of `range`, of which number 0 is at `start` seconds; without one frame 0 alone.
    pub(super) fn new(start: f64, range: Option<FrameRange>, fps: Fps) -> Self {
        let Fps(fps) = fps;
        Self { range, start, fps }
    }

    pub(super) fn numbers(&self) -> Range<u32> {
        self.range.map_or(0..1, |range| range.first..range.end)
    }

    /// The same with the frames at those places alone, counted from the first.
    pub(super) fn part(self, places: Range<usize>) -> Self {
        let first = self.numbers().start;
        // Places are within a range of 32-bit numbers.
        let at = |place: usize| first + place as u32;
        let (first, end) = (at(places.start), at(places.end));
        let range = Some(FrameRange { first, end });
        Self { range, ..self }
    }

    /// True if frames were asked for by number.
    pub(super) fn is_sequence(&self) -> bool {
        self.range.is_some()
    }

    /// The moment of a frame, in seconds.
    pub(super) fn time(&self, number: u32) -> f64 {
        self.start + f64::from(number) / self.fps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges() {
        let range = |text: &str| text.parse::<FrameRange>().map(|r| r.first..r.end);
        assert_eq!(range("0..1"), Ok(0..1));
        assert_eq!(range("10..24"), Ok(10..24));
        assert_eq!(
            range("4294967290..4294967295"),
            Ok(4_294_967_290..4_294_967_295)
        );
        for bad in [
            "",
            "..",
            "1",
            "1..",
            "..1",
            "1..1",
            "5..2",
            "-1..2",
            "+1..2",
            "1..=2",
            "1...3",
            "a..b",
            "1.5..2",
            "0..4294967296",
            "0..100001",
            " 1..2",
        ] {
            assert!(range(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn times() {
        let fps = |text: &str| text.parse::<Fps>();
        for bad in ["0", "-1", "nan", "inf", "", "x", "1e999"] {
            assert!(fps(bad).is_err(), "{bad}");
        }
        let frames = FrameRange { first: 3, end: 5 };
        let line = Timeline::new(0.5, Some(frames), Fps(4.0));
        let times: Vec<f64> = line.numbers().map(|n| line.time(n)).collect();
        assert_eq!(times, [1.25, 1.5]);
        let part = line.part(1..2);
        assert_eq!((part.numbers(), part.time(4)), (4..5, 1.5));
        let one = Timeline::new(0.5, None, Fps(30.0));
        assert_eq!((one.numbers(), one.time(0)), (0..1, 0.5));
    }
}
