//! The files of a capture: their formats, their names, and writing them when all else is done.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::error::CliError;
use crate::capture::output::{Output, OutputError};

/// The format of an image file, by the ending of its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Png,
    Exr,
}

/// An image file to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ImageFile {
    pub(super) path: PathBuf,
    pub(super) format: Format,
}

impl ImageFile {
    /// For `--output`: `-` is a PNG on standard output.
    pub(super) fn picture(path: PathBuf) -> Result<Self, String> {
        if path.as_os_str() == "-" {
            let format = Format::Png;
            return Ok(Self { path, format });
        }
        Self::by_ending(path)
    }

    /// For files whose ending names the format.
    pub(super) fn by_ending(path: PathBuf) -> Result<Self, String> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let format = match ending.as_deref() {
            Some("png") => Format::Png,
            Some("exr") => Format::Exr,
            _ => return Err("the name has to end in .png or .exr".into()),
        };
        Ok(Self { path, format })
    }
}

/// Refuses outputs that cannot be written, that would replace each other, or that would replace
/// the scene itself.
pub(super) fn check(outputs: &[Output], scene: &Path) -> Result<(), CliError> {
    let mut checks = OutputChecks::new(scene);
    outputs.iter().try_for_each(|output| checks.add(output))
}

/// Outputs that have been checked, and must not be replaced by further ones.
struct OutputChecks {
    scene: Option<PathBuf>,
    files: HashSet<PathBuf>,
    /// Folders that are known to take files.
    folders: HashSet<PathBuf>,
    stdout: bool,
}

impl OutputChecks {
    fn new(scene: &Path) -> Self {
        Self {
            scene: fs::canonicalize(scene).ok(),
            files: HashSet::new(),
            folders: HashSet::new(),
            stdout: false,
        }
    }

    fn add(&mut self, output: &Output) -> Result<(), CliError> {
        let twice = || {
            let text = format!("two outputs would go to {output}; name them differently");
            Err(CliError::Usage(text))
        };
        let Output::File(path) = output else {
            return match std::mem::replace(&mut self.stdout, true) {
                true => twice(),
                false => Ok(()),
            };
        };
        let place = absolute(path);
        let folder = place.parent().map(Path::to_path_buf).unwrap_or_default();
        // Trying a folder out costs a file; a new name in a known folder says nothing new.
        if !self.folders.contains(&folder) || fs::symlink_metadata(path).is_ok() {
            output.check()?;
            self.folders.insert(folder);
        }
        if Some(&place) == self.scene.as_ref() {
            let text = format!("{output} is the scene; name another output file");
            return Err(CliError::Usage(text));
        }
        let is_device = place.metadata().is_ok_and(|meta| !meta.is_file());
        if !is_device && !self.files.insert(place) {
            return twice();
        }
        Ok(())
    }
}

/// The file behind links, or the place in its folder that a new one would take.
fn absolute(path: &Path) -> PathBuf {
    if let Ok(path) = fs::canonicalize(path) {
        return path;
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    match (fs::canonicalize(folder), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_path_buf(),
    }
}

/// Writes all outputs, standard output last. If one fails, those that are new are taken back.
pub(super) fn write(outputs: &[(Output, Vec<u8>)]) -> Result<(), CliError> {
    let mut made = Vec::new();
    match write_in_order(outputs, &mut made) {
        Ok(()) => Ok(()),
        Err(error) => {
            for path in made {
                // The error that led here is the one to tell.
                let _ = fs::remove_file(path);
            }
            Err(error.into())
        }
    }
}

fn write_in_order<'a>(
    outputs: &'a [(Output, Vec<u8>)],
    made: &mut Vec<&'a Path>,
) -> Result<(), OutputError> {
    let (last, first): (Vec<_>, Vec<_>) =
        (outputs.iter()).partition(|(output, _)| *output == Output::Stdout);
    for (output, bytes) in first.into_iter().chain(last) {
        let new = match output {
            Output::File(path) if fs::symlink_metadata(path).is_err() => Some(path.as_path()),
            _ => None,
        };
        output.write(bytes)?;
        made.extend(new);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_name_the_format() {
        let format = |name: &str| ImageFile::by_ending(name.into()).map(|file| file.format);
        assert_eq!(format("a.png"), Ok(Format::Png));
        assert_eq!(format("dir.exr/a.EXR"), Ok(Format::Exr));
        for bad in ["", "-", "a", ".png", "a.jpg", "a.png/b", "a.png."] {
            assert!(format(bad).is_err(), "{bad}");
        }
        let stdout = ImageFile::picture("-".into()).map(|file| file.format);
        assert_eq!(stdout, Ok(Format::Png));
    }

    #[test]
    fn a_failure_takes_new_files_back() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let at = |name: &str| folder.path().join(name);
        fs::write(at("old"), b"old")?;
        let file = |path: PathBuf| (Output::File(path), b"bytes".to_vec());
        let outputs = [file(at("new")), file(at("old")), file(at("no/such/folder"))];
        assert!(write(&outputs).is_err());
        assert!(!at("new").exists());
        assert_eq!(fs::read(at("old"))?, b"bytes");
        Ok(())
    }

    #[test]
    fn clashes_are_refused() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let at = |name: &str| folder.path().join(name);
        fs::write(at("scene"), b"scene")?;
        let outputs =
            |names: &[&str]| -> Vec<Output> { names.iter().map(|name| at(name).into()).collect() };
        let refused = |names: &[&str]| match check(&outputs(names), &at("scene")) {
            Ok(()) => String::new(),
            Err(error) => error.to_string(),
        };
        assert_eq!(refused(&["a", "b"]), "");
        assert!(refused(&["a", "./a"]).contains("two outputs"));
        assert!(refused(&["./scene"]).contains("is the scene"));
        let null = || Output::from("/dev/null");
        assert!(check(&[null(), null()], &at("scene")).is_ok());
        assert!(check(&[Output::Stdout, Output::Stdout], &at("scene")).is_err());
        Ok(())
    }
}
