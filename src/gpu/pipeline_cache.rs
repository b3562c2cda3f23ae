//! The pipeline cache on disk. A file that is not ours, not whole or of another driver is ignored
//! and replaced.
//!
//! Drivers check the header of the blob they are given, but not its body, so we check it all
//! ourselves before a driver sees it.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use ash::vk;

use super::context::Gpu;
use super::error::{CallResult, GpuError};
use super::select::DeviceInfo;

const MAGIC: [u8; 8] = *b"ANTUMBPC";
const VERSION: u32 = 1;
/// Magic, version, vendor, device, driver version, two UUIDs, blob length, blob hash.
const HEADER: usize = 8 + 4 * 4 + 16 * 2 + 8 * 2;
/// Vulkan's own header at the start of every blob; a blob of just that holds no pipelines.
const VULKAN_HEADER: usize = 32;
/// More than any driver writes for us; a larger file is not read at all.
const MAX_FILE: u64 = 1 << 30;

/// FNV-1a over bytes.
pub(super) fn hash_bytes(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

fn header(info: &DeviceInfo, blob: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + blob.len());
    bytes.extend(MAGIC);
    for word in [VERSION, info.vendor_id, info.device_id, info.driver_version] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(info.pipeline_cache_uuid);
    bytes.extend(info.driver_uuid);
    bytes.extend((blob.len() as u64).to_le_bytes());
    bytes.extend(hash_bytes(blob).to_le_bytes());
    bytes
}

/// The file's content for a blob.
fn encode(info: &DeviceInfo, blob: &[u8]) -> Vec<u8> {
    let mut bytes = header(info, blob);
    bytes.extend(blob);
    bytes
}

/// The blob of a file, or why it is not used.
fn decode<'a>(info: &DeviceInfo, file: &'a [u8]) -> Result<&'a [u8], &'static str> {
    let (head, blob) = file.split_at_checked(HEADER).ok_or("it is too short")?;
    if head[..8] != MAGIC {
        return Err("it is no pipeline cache");
    }
    if head[8..12] != VERSION.to_le_bytes() {
        return Err("it is of another version");
    }
    let expected = header(info, blob);
    if head[12..HEADER - 16] != expected[12..HEADER - 16] {
        return Err("it is of another device or driver");
    }
    if head[HEADER - 16..HEADER - 8] != expected[HEADER - 16..HEADER - 8] {
        return Err("it is truncated or has bytes too many");
    }
    if head != expected {
        return Err("its contents are damaged");
    }
    Ok(blob)
}

fn read(path: &Path) -> io::Result<Option<Vec<u8>>> {
    match fs::metadata(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
        Ok(meta) if !meta.is_file() => Err(io::Error::other("not a regular file")),
        Ok(meta) if meta.len() > MAX_FILE => Err(io::Error::other("far too large")),
        Ok(_) => fs::read(path).map(Some),
    }
}

/// Writes aside and renames, so that a reader sees the old file or the new one and never a part.
fn write(path: &Path, content: &[u8]) -> io::Result<()> {
    if let Some(folder) = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
    {
        fs::create_dir_all(folder)?;
    }
    let mut aside = path.as_os_str().to_owned();
    aside.push(format!(".{}.tmp", std::process::id()));
    let aside = PathBuf::from(aside);
    let written = fs::File::create(&aside)
        .and_then(|mut file| file.write_all(content).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&aside, path));
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&aside);
    }
    written
}

/// The driver's cache and the file behind it.
#[derive(Default)]
pub(super) struct DiskCache {
    pub(super) raw: vk::PipelineCache,
    path: Option<PathBuf>,
    /// What the file holds now, as far as it is good.
    on_disk: Option<Vec<u8>>,
}

impl Gpu {
    /// Keeps compiled pipelines in a file from one run to the next. The file is read now and
    /// written by [`Gpu::destroy`], if there is something new. A file that cannot be used is
    /// ignored with a warning in the log and replaced; never an error.
    ///
    /// Call before the first pipeline is created: those made earlier are not in the file.
    pub fn use_pipeline_cache(&mut self, path: PathBuf) {
        let file = read(&path).unwrap_or_else(|error| {
            log::warn!("pipeline cache {} is not used: {error}", path.display());
            None
        });
        let blob = file
            .as_deref()
            .and_then(|file| match decode(&self.info, file) {
                Ok(blob) => Some(blob),
                Err(reason) => {
                    log::warn!(
                        "pipeline cache {} is not used and will be replaced: {reason}",
                        path.display()
                    );
                    None
                }
            });
        // An empty cache is not given back to the driver: SwiftShader would wrap another header
        // around it in each run.
        let initial = blob
            .filter(|blob| blob.len() > VULKAN_HEADER)
            .unwrap_or_default();
        let raw = match self.create_cache(initial) {
            Err(error) if !initial.is_empty() => {
                log::warn!(
                    "pipeline cache {} is not used and will be replaced: {error}",
                    path.display()
                );
                self.create_cache(&[])
            }
            other => other,
        };
        match raw {
            Ok(raw) => {
                self.set_name(raw, "pipeline cache");
                let on_disk = blob.map(<[u8]>::to_vec);
                self.destroy_cache();
                self.pipelines.cache = DiskCache {
                    raw,
                    path: Some(path),
                    on_disk,
                };
            }
            Err(error) => log::warn!("no pipeline cache: {error}"),
        }
    }

    fn create_cache(&self, blob: &[u8]) -> Result<vk::PipelineCache, GpuError> {
        let info = vk::PipelineCacheCreateInfo::default().initial_data(blob);
        // SAFETY: the blob is empty or was made by this very driver and is unchanged, as its hash
        // shows.
        unsafe { self.device.create_pipeline_cache(&info, None) }
            .call("vkCreatePipelineCache", "the pipeline cache")
    }

    fn save_cache(&self) -> Result<(), GpuError> {
        let cache = &self.pipelines.cache;
        let Some(path) = &cache.path else {
            return Ok(());
        };
        // SAFETY: the cache is live.
        let blob = unsafe { self.device.get_pipeline_cache_data(cache.raw) }
            .call("vkGetPipelineCacheData", "the pipeline cache")?;
        if cache.on_disk.as_deref() == Some(&blob[..]) {
            return Ok(());
        }
        write(path, &encode(&self.info, &blob)).map_err(|source| GpuError::CacheFile {
            path: path.clone(),
            source,
        })
    }

    /// Writes the file if there is something new and destroys the driver's cache.
    pub(super) fn destroy_cache(&mut self) {
        if self.pipelines.cache.raw == vk::PipelineCache::null() {
            return;
        }
        if let Err(error) = self.save_cache() {
            log::warn!("{error}");
        }
        // SAFETY: ours, and no pipeline is being created.
        unsafe {
            self.device
                .destroy_pipeline_cache(self.pipelines.cache.raw, None)
        };
        self.pipelines.cache = DiskCache::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device() -> DeviceInfo {
        DeviceInfo {
            name: "test".to_owned(),
            driver_name: String::new(),
            driver_info: String::new(),
            driver_id: vk::DriverId::default(),
            api_version: 0,
            driver_version: 7,
            vendor_id: 0x10005,
            device_id: 3,
            device_type: vk::PhysicalDeviceType::CPU,
            pipeline_cache_uuid: [1; 16],
            driver_uuid: [2; 16],
            limits: vk::PhysicalDeviceLimits::default(),
        }
    }

    #[test]
    fn what_was_written_is_read() {
        let file = encode(&device(), b"blob of the driver");
        assert_eq!(decode(&device(), &file), Ok(&b"blob of the driver"[..]));
        assert_eq!(decode(&device(), &encode(&device(), b"")), Ok(&b""[..]));
    }

    #[test]
    fn any_damage_is_seen() {
        let file = encode(&device(), b"blob of the driver");
        for length in 0..file.len() {
            assert!(
                decode(&device(), &file[..length]).is_err(),
                "truncated to {length}"
            );
        }
        for at in 0..file.len() {
            for bit in 0..8 {
                let mut damaged = file.clone();
                damaged[at] ^= 1 << bit;
                assert!(
                    decode(&device(), &damaged).is_err(),
                    "bit {bit} of byte {at} flipped"
                );
            }
        }
        let mut longer = file.clone();
        longer.push(0);
        assert!(decode(&device(), &longer).is_err());
    }

    #[test]
    fn another_driver_is_refused_with_that_reason() {
        let file = encode(&device(), b"blob");
        for other in [
            DeviceInfo {
                vendor_id: 1,
                ..device()
            },
            DeviceInfo {
                device_id: 1,
                ..device()
            },
            DeviceInfo {
                driver_version: 1,
                ..device()
            },
            DeviceInfo {
                pipeline_cache_uuid: [9; 16],
                ..device()
            },
            DeviceInfo {
                driver_uuid: [9; 16],
                ..device()
            },
        ] {
            assert_eq!(
                decode(&other, &file),
                Err("it is of another device or driver")
            );
        }
        assert_eq!(
            decode(&device(), &[0x89; 2 * HEADER]),
            Err("it is no pipeline cache")
        );
    }
}
