//! Plans as text, DOT and JSON, for a frame with one light and for one with three.

use super::{checked, shadow_frame::shadow_frame};
use antumbra::ash::vk;
use antumbra::graph::{
    FakeMemory, Graph, HistoryState, HistoryStates, ImageDesc, ImageState, Plan,
};
use std::path::Path;

/// The plan of a frame behind another.
fn frame(lights: u32) -> Plan {
    let state = ImageState {
        layout: vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
        stages: vk::PipelineStageFlags2::COPY,
        access: vk::AccessFlags2::NONE,
    };
    let history = HistoryState {
        desc: ImageDesc::new(vk::Format::R32_SFLOAT, 1280, 720),
        previous: state,
        current: state,
    };
    let states: HistoryStates = [("filtered", history)].into();
    let mut graph = Graph::continuing(states);
    shadow_frame(&mut graph, lights);
    checked(graph.compile(&FakeMemory).unwrap().plan().clone())
}

/// Compares a text with the committed one. `BLESS=1` writes it anew, but never where nobody looks
/// at the difference.
#[track_caller]
fn compare(name: &str, found: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/plans")
        .join(name);
    if std::env::var_os("BLESS").is_some_and(|value| value == "1") {
        assert!(
            std::env::var_os("CI").is_none(),
            "BLESS=1 is refused where CI is set"
        );
        std::fs::write(&path, found).unwrap();
    }
    let wanted = std::fs::read_to_string(&path).unwrap_or_else(|error| {
        panic!(
            "{}: {error}; BLESS=1 cargo test --test graph_rules writes it",
            path.display()
        )
    });
    let mut lines = wanted.lines().zip(found.lines()).enumerate();
    let first = lines.find(|(_, (a, b))| a != b);
    assert!(
        wanted == found,
        "the plan is no longer the one in tests/plans/{name}; first difference (line from 0, \
         committed, found): {first:?}; look at it, and if it is right run BLESS=1 cargo test \
         --test graph_rules\n{found}"
    );
}

#[test]
fn the_plan_of_a_frame_as_text() {
    compare("shadow_frame.txt", &frame(1).to_string());
}

#[test]
fn the_plan_of_a_frame_with_three_lights_as_text() {
    let plan = frame(3);
    // The lights need nothing of each other, so they run side by side: no step more than for one.
    assert_eq!(plan.steps.len(), frame(1).steps.len());
    compare("shadow_frame_three_lights.txt", &plan.to_string());
}

#[test]
fn dot_is_well_formed_and_complete() {
    let plan = frame(2);
    let dot = plan.to_dot();
    assert!(dot.starts_with("digraph ") && dot.ends_with("}\n"));
    // Outside of strings, braces and brackets are balanced, and no string spans lines.
    let (mut braces, mut brackets, mut quoted) = (0i32, 0i32, false);
    let mut characters = dot.chars();
    while let Some(character) = characters.next() {
        match character {
            '\\' if quoted => _ = characters.next(),
            '"' => quoted = !quoted,
            '\n' => assert!(!quoted, "a string spans lines"),
            _ if quoted => {}
            '{' => braces += 1,
            '}' => braces -= 1,
            '[' => brackets += 1,
            ']' => brackets -= 1,
            _ => {}
        }
        assert!(braces >= 0 && brackets >= 0);
    }
    assert_eq!((braces, brackets, quoted), (0, 0, false));
    let count = |text: &str| dot.matches(text).count();
    for (index, pass) in plan.passes.iter().enumerate() {
        let node = format!("    p{index} [shape=box, label=\"{}\"];", pass.name);
        assert_eq!(count(&node), 1, "{node}");
    }
    for (index, resource) in plan.resources.iter().enumerate() {
        let node = format!("  r{index} [shape=ellipse, label=\"{}\\n", resource.name);
        assert_eq!(
            count(&node),
            usize::from(resource.steps.is_some()),
            "{node}"
        );
    }
    for pass in &plan.culled {
        assert_eq!(
            count(&format!("  c{} [shape=box, style=dashed", pass.declared)),
            1
        );
    }
    let uses: usize = plan.passes.iter().map(|pass| pass.uses.len()).sum();
    assert_eq!(count(" -> "), uses);
    assert_eq!(count("subgraph cluster_"), plan.steps.len());
}

#[test]
fn quotes_in_names_do_not_break_dot() {
    let mut graph = Graph::new();
    let image = graph.create_image("the \"best\" \\ mask", super::desc());
    let image = super::make(&mut graph, "say \"hi\" \\", image);
    graph.keep(image);
    let plan = checked(graph.compile(&FakeMemory).unwrap().plan().clone());
    let dot = plan.to_dot();
    assert!(dot.contains(r#"label="say \"hi\" \\"];"#), "{dot}");
}

#[cfg(feature = "json")]
#[test]
fn json_says_what_the_plan_says() {
    let plan = frame(2);
    let json = plan.to_json();
    let text = serde_json::to_string(&json).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let list = |key: &str| json[key].as_array().unwrap();
    assert_eq!(json["schema"], 1);
    let names = |list: &[serde_json::Value]| -> Vec<String> {
        list.iter()
            .map(|v| v["name"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(names(list("passes")), super::running(&plan));
    let resources: Vec<String> = plan.resources.iter().map(|r| r.name.to_string()).collect();
    assert_eq!(names(list("resources")), resources);
    let culled: Vec<String> = plan.culled.iter().map(|p| p.name.to_string()).collect();
    assert_eq!(names(list("culled")), culled);
    for (pass, json) in plan.passes.iter().zip(list("passes")) {
        assert_eq!(json["kind"], pass.kind.name());
        let uses = json["uses"].as_array().unwrap();
        assert_eq!(uses.len(), pass.uses.len());
        for (used, json) in pass.uses.iter().zip(uses) {
            assert_eq!(json["resource"], resources[used.resource].as_str());
            assert_eq!(json["access"], format!("{:?}", used.access));
        }
        assert_eq!(
            json["attachments"].as_array().unwrap().len(),
            pass.attachments.len()
        );
    }
    assert_eq!(list("steps").len(), plan.steps.len());
    for (step, json) in plan.steps.iter().zip(list("steps")) {
        assert_eq!(
            json["barriers"].as_array().unwrap().len(),
            step.barriers.barriers.len()
        );
        assert_eq!(
            json["hand_over"].as_array().unwrap().len(),
            step.hand_over.barriers.len()
        );
        for (barrier, json) in step
            .barriers
            .barriers
            .iter()
            .zip(json["barriers"].as_array().unwrap())
        {
            let (resource, _) = barrier.target.unwrap();
            assert_eq!(json["resource"], resources[resource].as_str());
            assert_eq!(json["src_stages"], format!("{:?}", barrier.src_stages));
            assert_eq!(json["dst_access"], format!("{:?}", barrier.dst_access));
            let new = barrier.transition.map(|t| format!("{:?}", t.new));
            assert_eq!(json["new_layout"].as_str(), new.as_deref());
        }
    }
    assert_eq!(
        json["leave"].as_array().unwrap().len(),
        plan.leave.barriers.len()
    );
    assert_eq!(json["transient_bytes"], plan.peak_bytes());
    assert_eq!(json["unaliased_bytes"], plan.unaliased_bytes());
    let arenas: u64 = list("arenas")
        .iter()
        .map(|arena| arena["bytes"].as_u64().unwrap())
        .sum();
    assert_eq!(arenas, plan.peak_bytes());
}
