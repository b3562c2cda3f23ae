//! What is measured: techniques with their options, and rivals with their number of rays.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde_json::Value;

use super::rival::Engine;
use crate::reference::MAX_SAMPLES;
use crate::shadow::{Technique, TechniqueError};

/// Rays that a rival casts at a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rays {
    /// As many at every pixel.
    Plain(u32),
    /// `first` at every pixel, and `more` where a 3x3 neighbourhood disagrees.
    Adaptive {
        /// At every pixel.
        first: u32,
        /// Where the neighbourhood disagrees.
        more: u32,
    },
}

impl fmt::Display for Rays {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Plain(rays) => write!(f, "{rays}"),
            Self::Adaptive { first, more } => write!(f, "{first}+{more}"),
        }
    }
}

/// How a contender finds visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// On the Vulkan device.
    Technique(Technique),
    /// By rays on the CPU.
    Rival(Engine, Rays),
}

/// One column of the benchmark.
#[derive(Clone, Debug, PartialEq)]
pub struct Contender {
    /// As it was asked for: the name in results and plots.
    pub label: String,
    /// What it does.
    pub method: Method,
}

/// Why a text is no contender.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ContenderError {
    /// Neither a technique nor a rival.
    #[error(transparent)]
    Technique(#[from] TechniqueError),
    /// The name is neither a technique's nor a rival's.
    #[error("unknown technique `{name}`; there is {known}, all")]
    Unknown {
        /// The name asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// The number of rays is wrong.
    #[error("`{text}`: give the rays a pixel, such as {engine}:16 or {engine}:9+64")]
    Rays {
        /// What was given.
        text: String,
        /// The rival.
        engine: &'static str,
    },
    /// Nothing was asked for.
    #[error("no technique given; name some, such as hard,pcss,rays:16, or all")]
    None,
}

/// Rays of the rivals in `all`.
const ALL_RAYS: [Rays; 6] = [
    Rays::Plain(1),
    Rays::Plain(4),
    Rays::Plain(16),
    Rays::Plain(64),
    Rays::Plain(256),
    Rays::Adaptive { first: 9, more: 64 },
];

impl Contender {
    /// Every technique with default options, and every rival with 1 to 256 rays.
    pub fn all() -> Vec<Self> {
        let techniques = Technique::ALL.iter().map(|&technique| Self {
            label: technique.name().into(),
            method: Method::Technique(technique),
        });
        let rivals = Engine::ALL.iter().flat_map(|&engine| {
            ALL_RAYS.map(|rays| Self {
                label: format!("{}:{rays}", engine.name()),
                method: Method::Rival(engine, rays),
            })
        });
        techniques.chain(rivals).collect()
    }

    /// The technique's or rival's name, without options.
    pub fn name(&self) -> &'static str {
        match self.method {
            Method::Technique(technique) => technique.name(),
            Method::Rival(engine, _) => engine.name(),
        }
    }

    /// Every option with its value, numbers as such.
    pub fn options(&self) -> BTreeMap<String, Value> {
        match self.method {
            Method::Technique(technique) => (technique.option_values().into_iter())
                .map(|(name, value)| (name.to_string(), number_or_text(&value)))
                .collect(),
            Method::Rival(_, Rays::Plain(rays)) => [("rays".to_string(), rays.into())].into(),
            Method::Rival(_, Rays::Adaptive { first, more }) => {
                [("rays", first), ("more_rays", more)]
                    .map(|(name, rays)| (name.to_string(), rays.into()))
                    .into()
            }
        }
    }
}

fn number_or_text(value: &str) -> Value {
    let number = value.parse().ok().filter(|v: &f64| v.is_finite());
    match (value.parse::<u64>(), number) {
        (Ok(whole), _) => Value::from(whole),
        (_, Some(number)) => Value::from(number),
        _ => Value::from(value),
    }
}

impl FromStr for Contender {
    type Err = ContenderError;

    /// Reads `TECHNIQUE[:key=value,..]` or `RIVAL:N` or `RIVAL:N+M`.
    fn from_str(text: &str) -> Result<Self, ContenderError> {
        let (name, options) = text.split_once(':').unwrap_or((text, ""));
        let engine = Engine::ALL.iter().find(|engine| engine.name() == name);
        let method = if let Some(&engine) = engine {
            let rays = parse_rays(options).ok_or_else(|| ContenderError::Rays {
                text: text.into(),
                engine: engine.name(),
            })?;
            Method::Rival(engine, rays)
        } else if Technique::ALL.iter().any(|t| t.name() == name) {
            Method::Technique(text.parse()?)
        } else {
            let techniques = Technique::ALL.iter().map(|t| t.name().to_string());
            let rivals = Engine::ALL.iter().map(|e| format!("{}:N", e.name()));
            let names: Vec<String> = techniques.chain(rivals).collect();
            return Err(ContenderError::Unknown {
                name: name.into(),
                known: names.join(", "),
            });
        };
        Ok(Self {
            label: text.into(),
            method,
        })
    }
}

fn parse_rays(text: &str) -> Option<Rays> {
    let count = |text: &str| {
        let digits = text.bytes().all(|byte| byte.is_ascii_digit());
        let count: Option<u32> = text.parse().ok();
        count.filter(|count| digits && (1..=MAX_SAMPLES).contains(count))
    };
    match text.split_once('+') {
        None => Some(Rays::Plain(count(text)?)),
        Some((first, more)) => Some(Rays::Adaptive {
            first: count(first)?,
            more: count(more)?,
        }),
    }
}

/// Reads a list of contenders, separated by `,` or `;`, or `all`. A part like `key=value` after a
/// comma is one more option of the contender before it. Each is kept once, in order.
///
/// # Errors
/// [`ContenderError`], naming the part.
pub fn parse_list(text: &str) -> Result<Vec<Contender>, ContenderError> {
    let mut specs: Vec<String> = Vec::new();
    for list in text.split(';') {
        let mut is_first = true;
        for part in list.split(',').map(str::trim) {
            // A name never has a `=` before its `:`.
            let head = part.split(':').next().unwrap_or_default();
            match specs.last_mut() {
                Some(spec) if head.contains('=') && !is_first => {
                    spec.push(if spec.contains(':') { ',' } else { ':' });
                    spec.push_str(part);
                }
                _ if part.is_empty() => {}
                _ => {
                    specs.push(part.into());
                    is_first = false;
                }
            }
        }
    }
    let mut contenders: Vec<Contender> = Vec::new();
    for spec in &specs {
        let more = match spec.as_str() {
            "all" => Contender::all(),
            spec => vec![spec.parse()?],
        };
        for contender in more {
            if contenders.iter().all(|c| c.method != contender.method) {
                contenders.push(contender);
            }
        }
    }
    if contenders.is_empty() {
        return Err(ContenderError::None);
    }
    Ok(contenders)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(text: &str) -> Vec<String> {
        match parse_list(text) {
            Ok(list) => list.into_iter().map(|c| c.label).collect(),
            Err(error) => panic!("{text}: {error}"),
        }
    }

    #[test]
    fn lists_of_contenders() {
        assert_eq!(labels("hard,pcss"), ["hard", "pcss"]);
        assert_eq!(
            labels("pcss:taps=64,search=32,hard , rays:9+64"),
            ["pcss:taps=64,search=32", "hard", "rays:9+64"]
        );
        assert_eq!(
            labels("pcss:taps=64;pcss:taps=8,search=8"),
            ["pcss:taps=64", "pcss:taps=8,search=8"]
        );
        // Once each, also where the defaults are spelt out.
        assert_eq!(labels("hard,hard,pcss,pcss:taps=32"), ["hard", "pcss"]);
        let all = labels("pcss:taps=64,all");
        assert_eq!(all[..2], ["pcss:taps=64", "hard"]);
        for label in ["pcf", "pcss", "rays:1", "rays:256", "rays:9+64"] {
            assert!(all.contains(&label.to_string()), "{label}: {all:?}");
        }
    }

    #[test]
    fn wrong_parts_are_named() {
        for (text, wanted) in [
            ("", "no technique given"),
            (" , ;", "no technique given"),
            ("soft", "unknown technique `soft`; there is hard,"),
            ("taps=64", "unknown technique `taps=64`"),
            ("rays", "`rays`: give the rays a pixel"),
            ("rays:0", "`rays:0`"),
            ("rays:+4", "`rays:+4`"),
            ("rays:4+", "`rays:4+`"),
            ("rays:16,x=1", "`rays:16,x=1`"),
            ("hard,taps=3", "`hard` has no option `taps`"),
            ("pcss:taps=0", "it takes 1 to 256"),
        ] {
            match parse_list(text) {
                Ok(list) => panic!("{text}: {list:?}"),
                Err(error) => assert!(error.to_string().contains(wanted), "{error}"),
            }
        }
    }

    #[test]
    fn options_are_numbers_where_they_can_be() {
        let options = |text: &str| match parse_list(text) {
            Ok(list) => serde_json::to_string(&list[0].options()).unwrap_or_default(),
            Err(error) => panic!("{error}"),
        };
        assert_eq!(
            options("pcss"),
            r#"{"pattern":"noise","search":16,"taps":32}"#
        );
        assert_eq!(options("rays:9+64"), r#"{"more_rays":64,"rays":9}"#);
    }
}
