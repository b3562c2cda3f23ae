//! Where compiled pipelines are kept from one run to the next.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::gpu::DeviceInfo;

/// The file to use instead of one in the cache folder; empty for none.
pub(super) const VARIABLE: &str = "ANTUMBRA_PIPELINE_CACHE";

/// The file for the pipelines of this device, in a folder that exists; `None` if caching is
/// switched off or there is no place for it.
pub(super) fn file(info: &DeviceInfo) -> Option<PathBuf> {
    if let Some(path) = env::var_os(VARIABLE) {
        return (!path.is_empty()).then(|| path.into());
    }
    let folder = folder(env::var_os("XDG_CACHE_HOME"), env::var_os("HOME"))?;
    std::fs::create_dir_all(&folder).ok()?;
    Some(folder.join(name(info)))
}

/// By the XDG rules a relative folder does not count.
fn folder(cache_home: Option<OsString>, home: Option<OsString>) -> Option<PathBuf> {
    let absolute = |path: OsString| Some(PathBuf::from(path)).filter(|path| path.is_absolute());
    let base = cache_home
        .and_then(absolute)
        .or_else(|| Some(home.and_then(absolute)?.join(Path::new(".cache"))))?;
    Some(base.join("antumbra"))
}

/// One file a driver build, so that several drivers do not replace each other's.
fn name(info: &DeviceInfo) -> String {
    let version = info.driver_version.to_le_bytes();
    // Some drivers leave one or the other of these the same from build to build.
    let identity = (info.pipeline_cache_uuid.iter())
        .chain(&info.driver_uuid)
        .chain(&version)
        .chain(info.driver_info.as_bytes());
    // FNV-1a.
    let hash = identity.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let (vendor, device) = (info.vendor_id, info.device_id);
    format!("pipelines-{vendor:04x}-{device:04x}-{hash:016x}.bin")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_follows_the_xdg_rules() {
        let find = |cache: Option<&str>, home: Option<&str>| {
            folder(cache.map(OsString::from), home.map(OsString::from))
        };
        let path = |text: &str| Some(PathBuf::from(text));
        assert_eq!(find(Some("/c"), Some("/h")), path("/c/antumbra"));
        assert_eq!(find(None, Some("/h")), path("/h/.cache/antumbra"));
        assert_eq!(find(Some(""), Some("/h")), path("/h/.cache/antumbra"));
        assert_eq!(find(Some("c"), Some("/h")), path("/h/.cache/antumbra"));
        assert_eq!(find(None, Some("h")), None);
        assert_eq!(find(None, None), None);
    }
}
