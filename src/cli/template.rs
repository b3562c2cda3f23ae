//! Names of output images in which `{frame}`, `{frame:04}` and `{light}` stand for numbers.

use std::path::PathBuf;

use super::outputs::ImageFile;

/// The name of an image file with its placeholders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ImageTemplate {
    /// With the placeholders as they were written.
    file: ImageFile,
    /// Empty for a path that is no text: such a path has no placeholders.
    pieces: Vec<Piece>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Piece {
    Text(String),
    /// At least so many digits.
    Frame(usize),
    Light,
}

const LIGHT: &str = "{light}";
const FRAME: &str = "{frame";

impl ImageTemplate {
    /// For `--output`: `-` is a PNG on standard output.
    pub(super) fn picture(path: PathBuf) -> Result<Self, String> {
        Self::new(ImageFile::picture(path)?)
    }

    /// For files whose ending names the format.
    pub(super) fn by_ending(path: PathBuf) -> Result<Self, String> {
        Self::new(ImageFile::by_ending(path)?)
    }

    fn new(file: ImageFile) -> Result<Self, String> {
        let pieces = match file.path.to_str() {
            Some(text) => pieces(text)?,
            None => Vec::new(),
        };
        Ok(Self { file, pieces })
    }

    /// The name as it was written.
    pub(super) fn text(&self) -> String {
        self.file.path.display().to_string()
    }

    /// True if the name differs from frame to frame.
    pub(super) fn is_per_frame(&self) -> bool {
        self.pieces
            .iter()
            .any(|piece| matches!(piece, Piece::Frame(_)))
    }

    /// True if the name differs from light to light.
    pub(super) fn is_per_light(&self) -> bool {
        self.pieces.contains(&Piece::Light)
    }

    /// The file of a frame and a light.
    pub(super) fn at(&self, frame: u32, light: usize) -> ImageFile {
        if self.pieces.is_empty() {
            return self.file.clone();
        }
        let mut text = String::new();
        for piece in &self.pieces {
            match piece {
                Piece::Text(piece) => text.push_str(piece),
                Piece::Frame(digits) => text.push_str(&format!("{frame:0digits$}")),
                Piece::Light => text.push_str(&light.to_string()),
            }
        }
        ImageFile {
            path: text.into(),
            format: self.file.format,
        }
    }
}

fn pieces(text: &str) -> Result<Vec<Piece>, String> {
    let mut pieces = Vec::new();
    let mut plain = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('{') {
        plain.push_str(&rest[..at]);
        rest = &rest[at..];
        let (piece, after) = if let Some(after) = rest.strip_prefix(LIGHT) {
            (Piece::Light, after)
        } else if let Some(after) = rest.strip_prefix(FRAME) {
            frame_piece(after)?
        } else {
            plain.push('{');
            rest = &rest[1..];
            continue;
        };
        if !plain.is_empty() {
            pieces.push(Piece::Text(std::mem::take(&mut plain)));
        }
        pieces.push(piece);
        rest = after;
    }
    plain.push_str(rest);
    if !plain.is_empty() {
        pieces.push(Piece::Text(plain));
    }
    Ok(pieces)
}

/// What follows `{frame`: `}` or `:0N}`.
fn frame_piece(after: &str) -> Result<(Piece, &str), String> {
    if let Some(after) = after.strip_prefix('}') {
        return Ok((Piece::Frame(1), after));
    }
    let known = after.strip_prefix(":0").and_then(|after| {
        let (digits, after) = after.split_once('}')?;
        let plain = digits.bytes().all(|byte| byte.is_ascii_digit());
        let digits = digits
            .parse()
            .ok()
            .filter(|n| plain && (1..=20).contains(n))?;
        Some((Piece::Frame(digits), after))
    });
    known.ok_or_else(|| {
        "in a name write {frame} for the frame's number, or {frame:04} for at least 4 digits".into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str, frame: u32, light: usize) -> Result<String, String> {
        let template = ImageTemplate::by_ending(text.into())?;
        Ok(template.at(frame, light).path.display().to_string())
    }

    #[test]
    fn placeholders_become_numbers() -> Result<(), String> {
        assert_eq!(at("a.png", 7, 1)?, "a.png");
        assert_eq!(at("d{light}/a_{frame:04}.png", 7, 12)?, "d12/a_0007.png");
        assert_eq!(at("{frame}{frame:02}.exr", 123, 0)?, "123123.exr");
        assert_eq!(at("{frame:01}.exr", 0, 0)?, "0.exr");
        assert_eq!(at("{{light}}{x}{.exr", 0, 3)?, "{3}{x}{.exr");
        for bad in [
            "{frame:4}.png",
            "{frame:0}.png",
            "{frame:}.png",
            "{frames}.png",
            "{frame.png",
            "{frame:0x}.png",
            "{frame:0+4}.png",
            "{frame:099}.png",
            "{frame:04.png",
        ] {
            assert!(at(bad, 0, 0).is_err(), "{bad}");
        }
        Ok(())
    }

    #[test]
    fn templates_know_what_they_differ_in() -> Result<(), String> {
        let template = |text: &str| ImageTemplate::by_ending(text.into());
        let differs = |text: &str| template(text).map(|t| (t.is_per_frame(), t.is_per_light()));
        assert_eq!(differs("a.png")?, (false, false));
        assert_eq!(differs("a{frame}.png")?, (true, false));
        assert_eq!(differs("a{light}.png")?, (false, true));
        let stdout = ImageTemplate::picture("-".into())?;
        assert!(!stdout.is_per_frame());
        assert_eq!(stdout.at(0, 0).path, PathBuf::from("-"));
        Ok(())
    }
}
