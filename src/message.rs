//! Errors as one line of text.

use std::error::Error;

/// The error and its sources on one line. Messages that quote their source already are not given
/// it twice.
pub(crate) fn line(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        let cause = error.to_string();
        if !text.contains(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
        source = error.source();
    }
    one_line(&text)
}

/// Line breaks become spaces and other control characters `?`, whatever files are called.
pub(crate) fn one_line(text: &str) -> String {
    let parts: Vec<&str> = text.split(['\n', '\r']).map(str::trim).collect();
    let joined = parts
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ");
    joined.replace(char::is_control, "?")
}
