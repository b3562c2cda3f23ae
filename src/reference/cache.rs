//! References kept on disk, by what they were made of.

use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use sha2::{Digest as _, Sha256};

use super::{Reference, ReferenceError, Sampling, Settings, StandardError, Truth};
use crate::light::{AreaLight, LightShape};
use crate::scene::{Scene, SceneCamera, Wrap};

/// Changed whenever the same input would give another result, or the file another form.
const VERSION: &[u8; 8] = b"antref01";
const DIGEST: usize = 32;

/// A folder of references. A file that is broken is cast anew, one that cannot be written is not
/// kept; neither is an error.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// A cache in `folder`, which is made when it is first needed.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
        }
    }

    /// `antumbra/reference` in `$XDG_CACHE_HOME`, or else in `~/.cache`; `None` without either.
    pub fn of_user() -> Option<Self> {
        let folder = |name| {
            let value = std::env::var_os(name).map(PathBuf::from);
            value.filter(|path| path.is_absolute())
        };
        let caches = folder("XDG_CACHE_HOME").or_else(|| Some(folder("HOME")?.join(".cache")))?;
        Some(Self::new(caches.join("antumbra").join("reference")))
    }

    /// The reference of a scene, from the cache or cast and put there. True if it was there.
    /// References of patterns are not kept.
    ///
    /// # Errors
    /// As [`Reference::render`].
    pub fn render(
        &self,
        scene: &Scene,
        settings: &Settings<'_>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<(Truth, bool), ReferenceError> {
        settings.check()?;
        if matches!(settings.sampling, Sampling::Pattern(_)) {
            return Ok((Reference::new(scene)?.render(settings, progress)?, false));
        }
        let file = self.folder.join(format!("{}.bin", key(scene, settings)));
        if let Some(truth) = fs::read(&file).ok().and_then(|bytes| decode(&bytes))
            && truth.size == settings.size
        {
            progress(truth.visibility.len() as u64);
            return Ok((truth, true));
        }
        let truth = Reference::new(scene)?.render(settings, progress)?;
        if let Err(error) = self.keep(&file, &truth) {
            log::warn!("{}: the reference is not kept: {error}", file.display());
        }
        Ok((truth, false))
    }

    fn keep(&self, file: &std::path::Path, truth: &Truth) -> std::io::Result<()> {
        fs::create_dir_all(&self.folder)?;
        let mut aside = tempfile::NamedTempFile::new_in(&self.folder)?;
        aside.write_all(&encode(truth))?;
        aside.persist(file)?;
        Ok(())
    }
}

/// The digest of everything that a reference depends on, in hexadecimal digits.
fn key(scene: &Scene, settings: &Settings<'_>) -> String {
    let mut hash = Hash(Sha256::new());
    hash.bytes(VERSION);
    hash.scene(scene);
    hash.camera(settings.camera);
    hash.light(settings.light);
    hash.numbers(settings.size.map(u64::from));
    match settings.sampling {
        Sampling::Estimated {
            samples,
            standard_error,
            most,
        } => {
            let limit = standard_error.map_or(0, f64::to_bits);
            hash.numbers([0, u64::from(*samples), limit, u64::from(*most)]);
        }
        Sampling::Plain { samples } => hash.numbers([1, u64::from(*samples)]),
        Sampling::Adaptive { first, more } => {
            hash.numbers([2, u64::from(*first), u64::from(*more)]);
        }
        Sampling::Pattern(pattern) => {
            hash.numbers([3, u64::from(pattern.is_square())]);
            for point in pattern.points() {
                hash.numbers(point.to_array().map(f64::to_bits));
            }
        }
    }
    let digest = hash.0.finalize();
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

struct Hash(Sha256);

impl Hash {
    fn bytes(&mut self, bytes: &[u8]) {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    fn numbers<const N: usize>(&mut self, numbers: [u64; N]) {
        for number in numbers {
            self.0.update(number.to_le_bytes());
        }
    }

    fn floats(&mut self, floats: impl IntoIterator<Item = f32>) {
        for float in floats {
            self.0.update(float.to_bits().to_le_bytes());
        }
    }

    fn scene(&mut self, scene: &Scene) {
        self.numbers([scene.primitives.len() as u64]);
        for primitive in &scene.primitives {
            self.numbers([
                primitive.positions.len() as u64,
                primitive.uvs.len() as u64,
                primitive.indices.len() as u64,
                primitive.material as u64,
            ]);
            self.floats(primitive.positions.iter().flat_map(|p| p.to_array()));
            self.floats(primitive.normals.iter().flat_map(|n| n.to_array()));
            self.floats(primitive.uvs.iter().flat_map(|uv| uv.to_array()));
            for index in &primitive.indices {
                self.0.update(index.to_le_bytes());
            }
        }
        for material in &scene.materials {
            let cutoff = material.mask_cutoff();
            self.floats([cutoff.unwrap_or(-1.0), material.base_color.w]);
            match material.base_texture {
                Some(texture) if cutoff.is_some() => {
                    let wrap = texture.wrap.map(|wrap| match wrap {
                        Wrap::Repeat => 0,
                        Wrap::Mirror => 1,
                        Wrap::Clamp => 2,
                    });
                    self.numbers([1, texture.image as u64, wrap[0], wrap[1]]);
                    if let Some(image) = scene.images.get(texture.image) {
                        self.numbers([u64::from(image.width), u64::from(image.height)]);
                        let alpha: Vec<u8> = image.texels.iter().map(|t| t[3]).collect();
                        self.bytes(&alpha);
                    }
                }
                _ => self.numbers([0]),
            }
        }
    }

    fn camera(&mut self, camera: &SceneCamera) {
        for v in [camera.position, camera.right, camera.up, camera.forward] {
            self.floats(v.to_array());
        }
        self.floats([camera.yfov, camera.znear]);
    }

    fn light(&mut self, light: &AreaLight) {
        for v in [light.center, light.axis_x, light.axis_y, light.direction] {
            self.floats(v.to_array());
        }
        let (kind, sizes) = match light.shape {
            LightShape::Point => (0, [0.0; 2]),
            LightShape::Disk { radius } => (1, [radius, 0.0]),
            LightShape::Rect { width, height } => (2, [width, height]),
            LightShape::Sphere { radius } => (3, [radius, 0.0]),
            LightShape::Line { length } => (4, [length, 0.0]),
            LightShape::Sun { angular_diameter } => (5, [angular_diameter, 0.0]),
        };
        self.numbers([kind]);
        self.floats(sizes);
        if light.is_uneven() {
            let is_line = kind == 4;
            let (profile, weights) = (light.profile.values(), light.weights.values());
            let columns = if is_line { 1 } else { light.weights.columns() };
            let values = if is_line { profile } else { weights };
            self.numbers([columns as u64, values.len() as u64]);
            self.floats(values.iter().copied());
        }
    }
}

/// Header, visibility, valid, digest of all that; little-endian.
fn encode(truth: &Truth) -> Vec<u8> {
    let mut bytes = VERSION.to_vec();
    let error = truth.standard_error;
    let numbers = [
        u64::from(truth.size[0]),
        u64::from(truth.size[1]),
        truth.rays,
        u64::from(error.is_some()),
        error.map_or(0, |e| e.rms.to_bits()),
        error.map_or(0, |e| e.max.to_bits()),
        error.map_or(0, |e| e.pixels),
        error.map_or(0, |e| e.above),
    ];
    bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend(truth.visibility.iter().flat_map(|v| v.to_le_bytes()));
    bytes.extend(truth.valid.iter().map(|&valid| u8::from(valid)));
    let digest = Sha256::digest(&bytes);
    bytes.extend_from_slice(&digest);
    bytes
}

fn decode(bytes: &[u8]) -> Option<Truth> {
    let (content, digest) = bytes.split_at_checked(bytes.len().checked_sub(DIGEST)?)?;
    if Sha256::digest(content)[..] != *digest {
        return None;
    }
    let content = content.strip_prefix(VERSION)?;
    let (header, content) = content.split_at_checked(8 * 8)?;
    let (numbers, _) = header.as_chunks::<8>();
    let number = |i: usize| u64::from_le_bytes(numbers[i]);
    let size = [
        u32::try_from(number(0)).ok()?,
        u32::try_from(number(1)).ok()?,
    ];
    let pixels = size[0] as usize * size[1] as usize;
    let (values, valid) = content.split_at_checked(4 * pixels)?;
    if valid.len() != pixels {
        return None;
    }
    Some(Truth {
        size,
        visibility: (values.as_chunks::<4>().0.iter())
            .map(|&value| f32::from_le_bytes(value))
            .collect(),
        valid: valid.iter().map(|&byte| byte != 0).collect(),
        standard_error: (number(3) != 0).then(|| StandardError {
            rms: f64::from_bits(number(4)),
            max: f64::from_bits(number(5)),
            pixels: number(6),
            above: number(7),
        }),
        rays: number(2),
        masks: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_hold_what_was_put_in_or_are_refused() {
        let truth = Truth {
            size: [3, 1],
            visibility: vec![0.0, 0.25, 1.0],
            valid: vec![true, false, true],
            standard_error: Some(StandardError {
                rms: 0.5,
                max: 0.75,
                pixels: 2,
                above: 1,
            }),
            rays: 77,
            masks: None,
        };
        let bytes = encode(&truth);
        assert_eq!(decode(&bytes), Some(truth));
        for cut in 0..bytes.len() {
            assert_eq!(decode(&bytes[..cut]), None);
        }
        for at in 0..bytes.len() {
            let mut bytes = bytes.clone();
            bytes[at] ^= 16;
            assert_eq!(decode(&bytes), None, "byte {at}");
        }
    }
}
