//! Output files: pixels come back as they were, the same pixels give the same bytes, and a failure
//! leaves nothing behind. Needs no GPU.
#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use antumbra::capture::exr::{self, Channel, ReadError};
use antumbra::capture::output::{Output, OutputError};
use antumbra::capture::png;

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

fn names(folder: &Path) -> std::io::Result<Vec<String>> {
    let mut names = fs::read_dir(folder)?
        .map(|entry| entry.map(|entry| entry.file_name().to_string_lossy().into_owned()))
        .collect::<std::io::Result<Vec<_>>>()?;
    names.sort();
    Ok(names)
}

fn file(path: impl Into<std::path::PathBuf>) -> Output {
    Output::from(path.into())
}

#[test]
fn a_file_is_written_and_replaced_whole() -> Result {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("a.bin");
    file(&path).check()?;
    assert!(names(folder.path())?.is_empty(), "a check leaves nothing");
    file(&path).write(b"first")?;
    file(&path).write(b"2nd")?;
    assert_eq!(fs::read(&path)?, b"2nd");
    assert_eq!(names(folder.path())?, ["a.bin"]);
    Ok(())
}

#[cfg(unix)]
#[test]
fn the_mode_is_that_of_any_new_file() -> Result {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir()?;
    let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
    file(&ours).write(b"x")?;
    fs::write(&plain, b"x")?;
    let mode = |path| fs::metadata(path).map(|m| m.permissions().mode());
    assert_eq!(mode(&ours)?, mode(&plain)?);
    Ok(())
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_devices_kept() -> Result {
    use std::os::unix::fs::FileTypeExt as _;
    let folder = tempfile::tempdir()?;
    let (target, link) = (folder.path().join("target"), folder.path().join("link"));
    fs::write(&target, b"old")?;
    std::os::unix::fs::symlink(&target, &link)?;
    file(&link).write(b"new")?;
    assert!(fs::symlink_metadata(&link)?.is_symlink());
    assert_eq!(fs::read(&target)?, b"new");
    let null = Path::new("/dev/null");
    file(null).check()?;
    file(null).write(b"x")?;
    assert!(fs::metadata(null)?.file_type().is_char_device());
    Ok(())
}

#[test]
fn failures_are_typed_and_leave_nothing() -> Result {
    let folder = tempfile::tempdir()?;
    let missing = folder.path().join("no/such/a.png");
    for result in [file(&missing).write(b"x"), file(&missing).check()] {
        assert!(matches!(result, Err(OutputError::NoFolder { .. })));
    }
    for path in [folder.path().to_path_buf(), "/".into(), "..".into()] {
        assert!(matches!(
            file(path).write(b"x"),
            Err(OutputError::IsFolder { .. })
        ));
    }
    let not_a_folder = folder.path().join("plain");
    fs::write(&not_a_folder, b"kept")?;
    let below = file(not_a_folder.join("a.png")).write(b"x");
    assert!(matches!(below, Err(OutputError::NoFolder { .. })));
    assert_eq!(names(folder.path())?, ["plain"]);
    assert_eq!(fs::read(&not_a_folder)?, b"kept");
    Ok(())
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_told() {
    let error = file("/dev/full").write(b"x");
    // Not every system has this device.
    if Path::new("/dev/full").exists() {
        let message = match error {
            Err(error @ OutputError::Write { .. }) => error.to_string(),
            other => panic!("{other:?}"),
        };
        assert!(
            message.contains("/dev/full") && message.contains("space"),
            "{message}"
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_file_is_told() {
    // The kernel's own folder refuses new files even to root.
    let error = file("/proc/a.png").write(b"x");
    assert!(
        matches!(error, Err(OutputError::Create { .. })),
        "{error:?}"
    );
}

#[test]
fn a_dash_is_standard_output() {
    assert_eq!(Output::from("-"), Output::Stdout);
    assert_eq!(Output::from("./-"), file("./-"));
}

#[test]
fn srgb_follows_the_standard() {
    for (linear, byte) in [
        (0.0, 0),
        (1.0, 255),
        (0.5, 188),
        (0.214_041_14, 128),
        (0.001, 3),
        (2.0, 255),
        (-1.0, 0),
        (f32::NAN, 0),
        (f32::INFINITY, 255),
        (f32::NEG_INFINITY, 0),
    ] {
        assert_eq!(png::srgb_from_linear(linear), byte, "{linear}");
    }
    // Every code comes back from the middle of what it stands for.
    for code in 0..=255u8 {
        let encoded = f64::from(code) / 255.0;
        let linear = if encoded <= 0.04045 {
            encoded / 12.92
        } else {
            ((encoded + 0.055) / 1.055).powf(2.4)
        };
        assert_eq!(png::srgb_from_linear(linear as f32), code);
    }
}

#[test]
fn png_pictures_come_back() -> Result {
    let bytes: Vec<u8> = (0..3 * 7 * 5).map(|i| (i * 37 % 256) as u8).collect();
    let encoded = png::encode_rgb8(7, 5, &bytes)?;
    assert_eq!(encoded, png::encode_rgb8(7, 5, &bytes)?);
    let image = image::load_from_memory_with_format(&encoded, image::ImageFormat::Png)?;
    let image::DynamicImage::ImageRgb8(image) = image else {
        panic!("not 8-bit RGB: {:?}", image.color());
    };
    assert_eq!(image.dimensions(), (7, 5));
    assert_eq!(image.as_raw(), &bytes);
    let linear = png::encode_linear_rgb(2, 1, &[[0.0, 0.5, 1.0], [9.0, -1.0, f32::NAN]])?;
    let image = image::load_from_memory(&linear)?.into_rgb8();
    assert_eq!(image.as_raw(), &[0, 188, 255, 255, 0, 0]);
    Ok(())
}

#[test]
fn png_masks_are_linear_16_bit() -> Result {
    let values = [0.0, 1.0, 0.5, 0.25, 1.0 / 65535.0, 2.0, -1.0, f32::NAN];
    let encoded = png::encode_grey16(4, 2, &values)?;
    assert_eq!(encoded, png::encode_grey16(4, 2, &values)?);
    let image = image::load_from_memory(&encoded)?;
    let image::DynamicImage::ImageLuma16(image) = image else {
        panic!("not 16-bit grey: {:?}", image.color());
    };
    assert_eq!(image.as_raw(), &[0, 65535, 32768, 16384, 1, 65535, 0, 0]);
    Ok(())
}

#[test]
fn sizes_that_do_not_fit_are_refused() {
    let bad = [
        png::encode_rgb8(2, 2, &[0; 11]),
        png::encode_rgb8(0, 0, &[]),
        png::encode_rgb8(u32::MAX, u32::MAX, &[0; 3]),
        png::encode_grey16(2, 2, &[0.0; 5]),
        exr::encode_y(2, 2, &[0.0; 3]),
        exr::encode_y(0, 2, &[]),
        exr::encode(1, 1, &[]),
        exr::encode_rgb(1, 2, &[[0.0; 3]]),
    ];
    for result in bad {
        assert!(
            matches!(result, Err(OutputError::Encode { .. })),
            "{result:?}"
        );
    }
    let one = |name| Channel {
        name,
        values: &[0.0],
    };
    for channels in [[one("Y"), one("Y")], [one(""), one("Y")]] {
        assert!(exr::encode(1, 1, &channels).is_err());
    }
}

#[test]
fn exr_channels_come_back_bit_by_bit() -> Result {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("v.exr");
    let (width, height) = (37u32, 41u32);
    let values: Vec<f32> = (0..width * height)
        .map(|i| match i % 7 {
            0 => 0.0,
            1 => -0.0,
            2 => f32::MIN_POSITIVE / 4.0,
            3 => f32::INFINITY,
            4 => f32::NAN,
            _ => (i as f32).sin() * 1e6,
        })
        .collect();
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    file(&path).write(&exr::encode_y(width, height, &values)?)?;
    let (w, h, read) = exr::read_channel(&path, "Y")?;
    assert_eq!((w, h), (width, height));
    assert_eq!(bits(&read), bits(&values));
    let valid = vec![1.0; values.len()];
    let two = [
        Channel {
            name: "valid",
            values: &valid,
        },
        Channel {
            name: "Y",
            values: &values,
        },
    ];
    file(&path).write(&exr::encode(width, height, &two)?)?;
    let image = exr::read_image(&path)?;
    assert_eq!(image.channel("valid"), Some(&valid[..]));
    assert_eq!(image.channel("Y").map(bits), Some(bits(&values)));
    let error = exr::read_channel(&path, "Z").map_err(|error| error.to_string());
    let wanted = format!("{}: no channel `Z`; the image has Y, valid", path.display());
    assert_eq!(error.err(), Some(wanted));
    Ok(())
}

#[test]
fn exr_rgb_keeps_channels_apart() -> Result {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("c.exr");
    let pixels = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
    file(&path).write(&exr::encode_rgb(2, 1, &pixels)?)?;
    for (i, name) in ["R", "G", "B"].into_iter().enumerate() {
        let (_, _, values) = exr::read_channel(&path, name)?;
        assert_eq!(values, [pixels[0][i], pixels[1][i]], "{name}");
    }
    Ok(())
}

#[test]
fn exr_bytes_depend_on_pixels_only() -> Result {
    let values: Vec<f32> = (0..64 * 64).map(|i| (i as f32 * 0.01).cos()).collect();
    let first = exr::encode_y(64, 64, &values)?;
    for _ in 0..3 {
        assert_eq!(exr::encode_y(64, 64, &values)?, first);
    }
    Ok(())
}

#[test]
fn files_that_are_no_exr_are_told() -> Result {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("x.exr");
    assert!(matches!(
        exr::read_image(&path),
        Err(ReadError::Read { .. })
    ));
    let good = exr::encode_y(8, 8, &[0.5; 64])?;
    for bytes in [
        &b""[..],
        b"no image at all",
        &good[..good.len() / 2],
        &good[..40],
    ] {
        fs::write(&path, bytes)?;
        assert!(matches!(
            exr::read_image(&path),
            Err(ReadError::Invalid { .. })
        ));
    }
    Ok(())
}
