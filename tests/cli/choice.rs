//! `--technique auto`: what is chosen is said, and can be done again.

use std::fs;

use serde_json::Value;

use super::program::{Result, assert_fails, capture, default_capture_command, run};

const LIGHTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/lights.gltf");

#[test]
fn a_choice_is_reported_and_can_be_made_again() -> Result {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let text = capture(
        default_capture_command(LIGHTS, "48x48")
            .args([
                "--technique",
                "auto",
                "--repeat",
                "1",
                "--target-error",
                "0.05",
            ])
            .arg("--visibility")
            .arg(at("auto_{light}.exr"))
            .arg("--report")
            .arg(at("report.json")),
    )?;
    assert!(text.contains("chosen"), "{text}");
    let report: Value = serde_json::from_slice(&fs::read(at("report.json"))?)?;
    let images = report["images"].as_array().cloned().unwrap_or_default();
    assert_eq!(images.len(), 8);
    for (light, image) in images.iter().enumerate() {
        let chosen = &image["chosen"];
        assert_eq!(chosen["by"], "auto", "{image}");
        assert_ne!(image["technique"], "auto");
        let spec = chosen["spec"].as_str().unwrap_or_default();
        let name = image["technique"].as_str().unwrap_or_default();
        assert!(spec.starts_with(name), "{spec} of {name}");
        assert!(
            chosen["reason"]
                .as_str()
                .is_some_and(|text| !text.is_empty())
        );
        // One of each kind of light is enough.
        if ![0, 1, 3].contains(&light) {
            continue;
        }
        let again = at("again.exr");
        capture(
            default_capture_command(LIGHTS, "48x48")
                .args(["--technique", spec, "--light", &light.to_string()])
                .arg("--visibility")
                .arg(&again),
        )?;
        let chosen = at(&format!("auto_{light}.exr"));
        assert!(fs::read(chosen)? == fs::read(again)?, "{light}: {spec}");
    }
    Ok(())
}

#[test]
fn a_choice_takes_no_device_and_names_what_is_wrong() -> Result {
    let plan =
        |technique: &str| run(["graph", LIGHTS, "--technique", technique, "--light", "line"]);
    let output = plan("auto")?;
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_fails(
        &plan("auto:target-error=0")?,
        2,
        &["target-error", "above 0 to 1"],
    );
    assert_fails(&plan("auto:budget-ms=-1")?, 2, &["budget-ms"]);
    Ok(())
}
