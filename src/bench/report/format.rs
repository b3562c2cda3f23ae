//! Numbers and text for people.

/// Text for HTML and SVG, in elements and in quoted attributes.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// A label for HTML that may break after `:` and `,`.
pub(super) fn breakable(label: &str) -> String {
    escape(label).replace(':', ":<wbr>").replace(',', ",<wbr>")
}

/// Milliseconds, without the unit.
pub(super) fn ms(value: f64) -> String {
    match value {
        v if v >= 99.95 => format!("{v:.0}"),
        v if v >= 9.995 => format!("{v:.1}"),
        v if v >= 0.9995 => format!("{v:.2}"),
        v => format!("{v:.3}"),
    }
}

/// An error of visibility, without sign.
pub(super) fn error(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        v if v >= 0.0995 => format!("{v:.3}"),
        v if v >= 0.000_995 => format!("{v:.4}"),
        v => format!("{v:.1e}"),
    }
}

/// The same with its sign.
pub(super) fn signed(value: f64) -> String {
    let sign = match value {
        v if v < 0.0 => "\u{2212}",
        v if v > 0.0 => "+",
        _ => "",
    };
    format!("{sign}{}", error(value))
}

/// How many times as much.
pub(super) fn ratio(value: f64) -> String {
    match value {
        v if v >= 99.5 => format!("{v:.0}\u{d7}"),
        v if v >= 9.95 => format!("{v:.1}\u{d7}"),
        v => format!("{v:.2}\u{d7}"),
    }
}

/// A part of a whole in percent.
pub(super) fn percent(part: f64) -> String {
    match 100.0 * part {
        0.0 => "0".into(),
        p if p < 0.01 => "&lt;0.01".into(),
        p => format!("{p:.2}"),
    }
}

/// Bytes as MiB.
pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{:.1}", bytes as f64 / (1024.0 * 1024.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_figures_or_so() {
        assert_eq!(
            [1234.5, 12.34, 1.234, 0.1234].map(ms),
            ["1234", "12.3", "1.23", "0.123"]
        );
        assert_eq!(
            [0.25, 0.0123, 0.00012, 0.0].map(error),
            ["0.250", "0.0123", "1.2e-4", "0"]
        );
        assert_eq!(signed(-0.5), "\u{2212}0.500");
        assert_eq!(
            [128.2, 12.34, 0.5].map(ratio),
            ["128\u{d7}", "12.3\u{d7}", "0.50\u{d7}"]
        );
        assert_eq!(percent(0.000_01), "&lt;0.01");
    }

    #[test]
    fn markup_is_text() {
        assert_eq!(
            escape("<a b='c'>&\"\n"),
            "&lt;a b=&#39;c&#39;&gt;&amp;&quot;\u{fffd}"
        );
    }
}
