//! The results as one page: no file beside it, no network.

mod analysis;
mod format;
mod group;
mod outcomes;
mod plot;
mod summary;

use std::fmt::Write as _;
use std::path::Path;

use super::results::Results;
pub(crate) use format::escape;
use plot::Families;

pub(crate) const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// The page. Images are read from `folder`; one that cannot be read is left out.
pub fn page(results: &Results, folder: &Path) -> String {
    let families = families(results);
    let families = Families(&families);
    let mut page = String::new();
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>Shadows: run time against error</title>\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n"
    );
    header(&mut page, results);
    page.push_str("<main>\n");
    summary::write(&mut page, results, families);
    for (at, reference) in results.references.iter().enumerate() {
        group::write(&mut page, results, at, reference, families, folder);
    }
    summary::failures(&mut page, results);
    page.push_str("</main>\n");
    footer(&mut page, results);
    let _ = write!(page, "<script>\n{SCRIPT}</script>\n</body>\n</html>\n");
    page
}

/// The page's plot over all scenes, error against time, as an SVG file.
pub fn plot(results: &Results) -> String {
    summary::plot_alone(results, Families(&families(results)))
}

/// What has become of each technique on each scene and light, as a table in Markdown.
pub fn matrix(results: &Results) -> String {
    outcomes::markdown(results)
}

/// Techniques and rivals by name, in order.
fn families(results: &Results) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for label in &results.settings.techniques {
        let name = label.split(':').next().unwrap_or_default();
        if !names.iter().any(|other| other == name) {
            names.push(name.into());
        }
    }
    names
}

/// The last part of a scene's path, without the ending of a glTF file.
fn scene_name(scene: &str) -> String {
    let name = Path::new(scene).file_name();
    let name = name.map_or_else(|| scene.into(), |name| name.to_string_lossy().into_owned());
    let bare = [".gltf", ".glb"]
        .iter()
        .find_map(|ending| name.strip_suffix(ending));
    bare.map(String::from).unwrap_or(name)
}

fn header(page: &mut String, results: &Results) {
    let settings = &results.settings;
    let machine = &results.machine;
    let cpu = machine.cpu.as_deref().unwrap_or("unknown processor");
    let facts = [
        (
            "Vulkan device",
            results.driver.clone().unwrap_or_else(|| "none".into()),
        ),
        ("Processor", format!("{cpu}, {} threads", machine.threads)),
        ("System", machine.os.clone()),
        (
            "Size",
            format!("{} \u{d7} {} pixels", settings.width, settings.height),
        ),
        (
            "Measured",
            format!(
                "median of {} rounds in turn, or as many as fit into {} s",
                settings.repeat, settings.cell_seconds
            ),
        ),
        (
            "Truth",
            format!("{} light samples a pixel, ray traced", settings.samples),
        ),
        ("Program", results.program.clone()),
    ];
    page.push_str(
        "<header>\n<h1>Soft shadows: run time against error</h1>\n<dl class=\"facts\">\n",
    );
    for (name, fact) in facts {
        let _ = writeln!(page, "<div><dt>{name}</dt><dd>{}</dd></div>", escape(&fact));
    }
    page.push_str("</dl>\n</header>\n");
}

fn footer(page: &mut String, results: &Results) {
    let _ = write!(
        page,
        "<footer>\n<h2>How to read this</h2>\n<ul>\n\
         <li><b>Visibility</b> of a light is 0 (all of it hidden) to 1 (all of it seen). Errors are \
         image minus truth, over <i>valid</i> pixels only: those that hit something and lie neither \
         on an edge nor where the surface\u{2019}s own horizon cuts the light.</li>\n\
         <li><b>Penumbra RMSE</b> is the root mean square error where the truth is between 0.005 and \
         0.995. <b>Bias</b> is the mean error, above 0 for too bright. 99 % of the pixels are within \
         <b>p99</b>. <b>Umbra as lit</b> and <b>lit as umbra</b> are the parts of valid pixels that \
         are called the very opposite of what they are.</li>\n\
         <li><b>Time</b> of a technique is the device\u{2019}s time for one light\u{2019}s \
         visibility: maps, lists and filters, without G-buffer and shading. A ray tracer\u{2019}s is \
         the wall clock of its whole casting on {} threads, primary rays included, with its hierarchy \
         built beforehand. Both axes of the plots are logarithmic; better is down and to the \
         left.</li>\n\
         <li>The <b>Pareto front</b> joins those that nobody beats in both time and error.</li>\n\
         <li>At <b>equal time</b> and <b>equal error</b> the ray tracer is read off the line between \
         its measurements, straight in the logarithms; &lt; and &gt; mark the ends of that \
         line.</li>\n\
         </ul>\n<p>All numbers are in <code>results.json</code> beside this page.</p>\n</footer>\n",
        results.machine.threads
    );
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::bench::group::blank_entry;
    use crate::bench::results::{Entry, FailedCell, Pass, ReferenceEntry, Settings};
    use crate::bench::{Contender, Failure, FailureKind, Job, Spread};
    use crate::measure::{ErrorMeasures, Measures};

    /// One scene with an odd name, a technique with a result and one that crashed.
    pub(in crate::bench) fn results() -> Results {
        let techniques = vec!["hard".to_string(), "rays:4".to_string()];
        let job = Job {
            scene: "<b>&.gltf".into(),
            case: None,
            light: 0,
            light_name: "\"lamp\"".into(),
            light_scale: 1.0,
            camera: None,
            contenders: techniques.clone(),
            size: [4, 4],
            repeat: 1,
            samples: 16,
            cell_seconds: 1.0,
            device: None,
            out: "nowhere".into(),
            dead: Vec::new(),
        };
        let mut results = Results::new(Settings {
            techniques: techniques.clone(),
            width: 4,
            height: 4,
            repeat: 1,
            samples: 16,
            cell_seconds: 1.0,
            device: None,
            light_scale: 1.0,
        });
        let blank = |label: &str| {
            let contender: Contender = label.parse().unwrap_or_else(|error| panic!("{error}"));
            blank_entry(&job, &contender)
        };
        let error = ErrorMeasures {
            pixels: 3,
            rmse: 0.25,
            ..Default::default()
        };
        results.images.push(Entry {
            visibility_ms: Spread::of([2.0]),
            passes: vec![Pass {
                name: "map <0>".into(),
                gpu_ms: Some(2.0),
                skipped: None,
                visibility: true,
            }],
            error: Some(Measures {
                valid: error,
                penumbra: error,
                ..Default::default()
            }),
            ..blank("hard")
        });
        let failure = Failure {
            kind: FailureKind::Crashed,
            reason: "signal <11>".into(),
        };
        results.images.push(Entry {
            failure: Some(failure.clone()),
            ..blank("rays:4")
        });
        results.failures.push(FailedCell {
            scene: "<b>&.gltf".into(),
            light: "\"lamp\"".into(),
            light_index: 0,
            label: "rays:4".into(),
            failure,
        });
        results.references.push(ReferenceEntry {
            scene: "<b>&.gltf".into(),
            light: "\"lamp\"".into(),
            light_index: 0,
            light_shape: "disk".into(),
            width: 4,
            height: 4,
            samples: 16,
            standard_error: None,
            valid_pixels: 9,
            penumbra_pixels: 3,
            rays: 16,
            cast_ms: None,
            image: "none.png".into(),
            valid_image: "none.png".into(),
            case: None,
        });
        results
    }

    #[test]
    fn names_are_text_and_failures_are_told() {
        let page = page(&results(), Path::new("nowhere"));
        for part in [
            "&lt;b&gt;&amp;",
            "&quot;lamp&quot;",
            "map &lt;0&gt;",
            "data-failed=\"rays:4\"",
            "signal &lt;11&gt;",
            ">crashed</td>",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("<b>&") && !page.contains("<11>") && !page.contains("map <0>"));
        // Summary and scene, wide and narrow each.
        assert_eq!(page.matches("data-technique=\"hard\"").count(), 4);
        assert_eq!(page.matches("data-technique=\"rays:4\"").count(), 0);
    }

    #[test]
    fn scenes_have_short_names() {
        let names = ["a/b.c.gltf", "b.glb", "stress/touching, scaled by 0.001"].map(scene_name);
        assert_eq!(names, ["b.c", "b", "touching, scaled by 0.001"]);
    }

    #[test]
    fn nothing_measured_is_a_page_too() {
        let mut results = results();
        results.images.clear();
        let page_of_none = page(&results, Path::new("nowhere"));
        assert!(!page_of_none.contains("NaN"));
        results.references.clear();
        results.settings.techniques.clear();
        let page = page(&results, Path::new("nowhere"));
        assert!(page.contains("<h1>") && !page.contains("NaN"));
    }
}
