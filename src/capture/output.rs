//! Output files that appear whole or not at all.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

/// Where output goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// A file.
    File(PathBuf),
    /// Standard output, written `-`.
    Stdout,
}

impl From<PathBuf> for Output {
    fn from(path: PathBuf) -> Self {
        if path.as_os_str() == "-" {
            Self::Stdout
        } else {
            Self::File(path)
        }
    }
}

impl From<&str> for Output {
    fn from(path: &str) -> Self {
        Self::from(PathBuf::from(path))
    }
}

impl fmt::Display for Output {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Stdout => f.write_str("standard output"),
        }
    }
}

/// Output that could not be written. Nothing is left behind, and a file that was there before is
/// as it was.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The folder does not exist.
    #[error("{}: no folder `{}`; create it first", path.display(), folder.display())]
    NoFolder {
        /// The file asked for.
        path: PathBuf,
        /// The folder it should be in.
        folder: PathBuf,
    },
    /// The path is that of a folder.
    #[error("{}: is a folder; name a file", path.display())]
    IsFolder {
        /// The path asked for.
        path: PathBuf,
    },
    /// The file cannot be made: no permission, read-only system.
    #[error("{}: cannot create the file: {source}", path.display())]
    Create {
        /// The file asked for.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The data did not go through: disk full, quota, device error.
    #[error("{output}: cannot write {bytes} bytes: {source}")]
    Write {
        /// Where to.
        output: Output,
        /// How many.
        bytes: usize,
        /// Why.
        source: io::Error,
    },
    /// The data cannot be put into the file format.
    #[error("cannot encode {format} of {width}x{height} pixels: {reason}")]
    Encode {
        /// The file format.
        format: &'static str,
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Why.
        reason: String,
    },
}

impl Output {
    /// Writes `bytes`: to a file aside in the same folder, which then takes the place of the one
    /// asked for. Its mode is what the umask leaves. A link is followed; a device or a pipe is
    /// written to directly.
    ///
    /// # Errors
    /// An [`OutputError`] that names the output.
    pub fn write(&self, bytes: &[u8]) -> Result<(), OutputError> {
        let failed = |source| OutputError::Write {
            output: self.clone(),
            bytes: bytes.len(),
            source,
        };
        let path = match self {
            Self::Stdout => {
                let mut out = io::stdout().lock();
                return out
                    .write_all(bytes)
                    .and_then(|()| out.flush())
                    .map_err(failed);
            }
            Self::File(path) => path,
        };
        let create = |source| OutputError::Create {
            path: path.clone(),
            source,
        };
        let target = self.resolve(path)?;
        if let Ok(metadata) = target.metadata()
            && !metadata.is_file()
        {
            // A rename would replace the device itself by a file.
            let mut device = OpenOptions::new()
                .write(true)
                .open(&target)
                .map_err(create)?;
            return device.write_all(bytes).map_err(failed);
        }
        let mut aside = Aside::create(folder_of(&target)).map_err(create)?;
        aside.fill(bytes).map_err(failed)?;
        aside.persist(&target).map_err(create)
    }

    /// Checks what can be checked before the work is done: that the folder exists, takes files, and
    /// that the path is no folder.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn check(&self) -> Result<(), OutputError> {
        let Self::File(path) = self else {
            return Ok(());
        };
        let target = self.resolve(path)?;
        let create = |source| OutputError::Create {
            path: path.clone(),
            source,
        };
        if target.metadata().is_ok_and(|metadata| !metadata.is_file()) {
            return match OpenOptions::new().write(true).open(&target) {
                Ok(_) => Ok(()),
                Err(error) => Err(create(error)),
            };
        }
        let aside = Aside::create(folder_of(&target));
        aside.map(drop).map_err(create)
    }

    /// The file behind links.
    fn resolve(&self, path: &Path) -> Result<PathBuf, OutputError> {
        let has_name = path.file_name().is_some();
        if !has_name || path.is_dir() {
            return Err(OutputError::IsFolder { path: path.into() });
        }
        let folder = folder_of(path);
        if !folder.is_dir() {
            return Err(OutputError::NoFolder {
                path: path.into(),
                folder: folder.into(),
            });
        }
        // Fails for a file that is yet to be made; that one is no link.
        Ok(path.canonicalize().unwrap_or_else(|_| path.into()))
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Files aside that are there now: whoever ends the process early removes them first.
static ASIDE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn asides() -> MutexGuard<'static, Vec<PathBuf>> {
    ASIDE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the files aside of outputs that are being written, and lets nobody begin another one
/// while the returned value lives: for ending the process at any moment without a trace.
pub(crate) fn abandon_all() -> impl Drop {
    let asides = asides();
    for path in asides.iter() {
        // Nobody is left who could do something about it.
        let _ = std::fs::remove_file(path);
    }
    asides
}

/// A file next to the one asked for, gone when dropped.
struct Aside {
    /// `None` once it has been renamed.
    file: Option<NamedTempFile<File>>,
    path: PathBuf,
}

impl Aside {
    fn create(folder: &Path) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".antumbra-").suffix(".part");
        #[cfg(unix)]
        let permissions = {
            use std::os::unix::fs::PermissionsExt as _;
            std::fs::Permissions::from_mode(0o666)
        };
        #[cfg(unix)]
        builder.permissions(permissions);
        let mut asides = asides();
        let file = builder.tempfile_in(folder)?;
        let path = file.path().to_path_buf();
        asides.push(path.clone());
        let file = Some(file);
        Ok(Self { file, path })
    }

    fn fill(&mut self, bytes: &[u8]) -> io::Result<()> {
        match &mut self.file {
            Some(file) => file.write_all(bytes).and_then(|()| file.flush()),
            None => Ok(()),
        }
    }

    /// Takes the place of `target`; after an error it is gone.
    fn persist(mut self, target: &Path) -> io::Result<()> {
        match self.file.take() {
            Some(file) => file.persist(target).map(drop).map_err(|error| error.error),
            None => Ok(()),
        }
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        let mut asides = asides();
        self.file = None;
        asides.retain(|path| *path != self.path);
    }
}
