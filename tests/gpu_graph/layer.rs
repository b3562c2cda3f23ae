//! Which validation layer the graph's tests can rely on.

use antumbra::ash::{self, vk};

/// Fails where the layer is an old one.
#[track_caller]
pub fn assert_current_layer() {
    // SAFETY: the loader was loaded before, by the device under test.
    let layers = unsafe {
        let entry = ash::Entry::load().unwrap();
        entry.enumerate_instance_layer_properties().unwrap()
    };
    let layer = layers
        .iter()
        .find(|layer| layer.layer_name_as_c_str() == Ok(c"VK_LAYER_KHRONOS_validation"))
        .expect("the validation layer: apt install vulkan-validationlayers");
    let version = layer.spec_version;
    let (major, minor) = (
        vk::api_version_major(version),
        vk::api_version_minor(version),
    );
    assert!(
        (major, minor) >= (1, 4),
        "the validation layer is of Vulkan {major}.{minor} and too old: it sees no hazard on \
         attachments, and some where there is none; run scripts/setup.sh, which fetches a current \
         one to .deps/vulkan/validation"
    );
}
