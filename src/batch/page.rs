//! The results of a batch as a page: its sequences with their times and some of their pictures.

use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};

use super::gather::{Found, Gathered};
use crate::bench::report::{STYLE, escape};

/// Pictures of a sequence that are shown.
const SHOWN: usize = 8;

/// The page, to be put into `out`. Pictures stay where they are, in `folders`, and are named from
/// there; without `timings` it has no times.
pub fn page(gathered: &Gathered, folders: &[PathBuf], out: &Path, timings: bool) -> String {
    let roots: Vec<String> = folders.iter().map(|folder| from_to(out, folder)).collect();
    let mut page = String::from(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>Batch</title>\n\
         <link rel=\"icon\" href=\"data:,\">\n<style>\n",
    );
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        "{STYLE}.frames img {{ width: 128px; image-rendering: pixelated; margin: 0 6px 6px 0; }}\n\
         section {{ margin: 0 0 28px; }}\n</style>\n</head>\n<body>\n<header>\n<h1>Batch</h1>\n\
         <p>{} items</p>\n</header>\n<main>\n",
        gathered.items.len()
    );
    let mut rest = &gathered.items[..];
    while let Some(first) = rest.first() {
        let name = sequence_of(&first.id);
        let count = rest
            .iter()
            .take_while(|found| sequence_of(&found.id) == name)
            .count();
        let (sequence, others) = rest.split_at(count);
        section(&mut page, name, sequence, &roots, timings);
        rest = others;
    }
    page.push_str("</main>\n</body>\n</html>\n");
    page
}

fn sequence_of(id: &str) -> &str {
    id.rsplit_once('/').map_or(id, |(sequence, _)| sequence)
}

fn section(page: &mut String, name: &str, items: &[Found], roots: &[String], timings: bool) {
    let mut facts = vec![format!("{} items", items.len())];
    let mut times: Vec<f64> = (items.iter())
        .filter_map(|found| found.record.images.first()?["frame_ms"]["median"].as_f64())
        .collect();
    times.sort_by(f64::total_cmp);
    if let (true, Some(median)) = (timings, times.get(times.len() / 2)) {
        facts.push(format!("{median:.2} ms a frame (median)"));
    }
    let failed: Vec<_> = items
        .iter()
        .filter_map(|found| found.record.failure.as_ref())
        .collect();
    if let Some(first) = failed.first() {
        facts.push(format!("{} unsupported: {}", failed.len(), first.reason));
    }
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        "<section>\n<h2>{}</h2>\n<p>{}</p>\n<div class=\"frames\">\n",
        escape(name),
        escape(&facts.join(", "))
    );
    let step = items.len().div_ceil(SHOWN).max(1);
    for found in items.iter().step_by(step) {
        let picture = found
            .record
            .files
            .iter()
            .find(|file| file.path.ends_with(".png"));
        if let (Some(picture), Some(root)) = (picture, roots.get(found.folder)) {
            let _ = writeln!(
                page,
                "<img loading=\"lazy\" alt=\"{}\" title=\"{}\" src=\"{}\">",
                escape(&found.id),
                escape(&found.id),
                escape(&url(&format!("{root}{}", picture.path)))
            );
        }
    }
    page.push_str("</div>\n</section>\n");
}

/// The way from one folder to another with a slash at its end; nothing if they are the same.
fn from_to(from: &Path, to: &Path) -> String {
    let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.into());
    let (from, to) = (whole(from), whole(to));
    let same = from
        .components()
        .zip(to.components())
        .take_while(|(a, b)| a == b)
        .count();
    let up = from.components().skip(same).map(|_| "../".to_string());
    let down = to.components().skip(same).filter_map(|part| match part {
        Component::Normal(name) => Some(format!("{}/", name.to_string_lossy())),
        _ => None,
    });
    up.chain(down).collect()
}

/// As an address: what has a meaning there, or is not plain, by its bytes.
fn url(path: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/._-=+,".contains(&byte);
    let mut url = String::new();
    for byte in path.bytes() {
        match plain(byte) {
            true => url.push(char::from(byte)),
            false => url.push_str(&format!("%{byte:02X}")),
        }
    }
    url
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_between_folders() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let at = |name: &str| folder.path().join(name);
        for name in ["a/b", "a/c"] {
            std::fs::create_dir_all(at(name))?;
        }
        assert_eq!(from_to(&at("a"), &at("a")), "");
        assert_eq!(from_to(&at("a"), &at("a/b")), "b/");
        assert_eq!(from_to(&at("a/b"), &at("a/c")), "../c/");
        assert_eq!(url("a b/\u{e4}%.png"), "a%20b/%C3%A4%25.png");
        Ok(())
    }
}
