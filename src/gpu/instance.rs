//! The instance of a device of our own, with or without validation.

use std::ffi::CStr;
use std::sync::Arc;

use ash::vk;

use super::debug::{MessageLog, Messenger, c_string, messenger_info};
use super::error::{CallResult, GpuError};

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Loader, instance and messenger, until a device is made of them.
pub(super) struct OwnInstance {
    pub(super) entry: ash::Entry,
    pub(super) instance: ash::Instance,
    pub(super) messenger: Option<Messenger>,
    pub(super) log: Arc<MessageLog>,
    pub(super) debug_utils: bool,
}

fn has(extensions: &[vk::ExtensionProperties], name: &CStr) -> bool {
    extensions
        .iter()
        .any(|e| e.extension_name_as_c_str().is_ok_and(|n| n == name))
}

/// What the validation layer offers.
struct Layer {
    extensions: Vec<vk::ExtensionProperties>,
}

fn find_layer(entry: &ash::Entry) -> Result<Layer, GpuError> {
    let missing = |what: &CStr| GpuError::NoValidation {
        what: what.to_string_lossy().into_owned(),
    };
    // SAFETY: the loader is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .call("vkEnumerateInstanceLayerProperties", "the loader")?;
    if !layers
        .iter()
        .any(|l| l.layer_name_as_c_str().is_ok_and(|n| n == LAYER))
    {
        return Err(missing(LAYER));
    }
    // SAFETY: the layer is there, and its name is a C string.
    let extensions = unsafe { entry.enumerate_instance_extension_properties(Some(LAYER)) }.call(
        "vkEnumerateInstanceExtensionProperties",
        "the validation layer",
    )?;
    Ok(Layer { extensions })
}

impl OwnInstance {
    pub(super) fn create(application_name: &str, validation: bool) -> Result<Self, GpuError> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers, which every Vulkan
        // program relies on.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| GpuError::NoLoader {
            reason: e.to_string().replace('\n', " "),
        })?;
        // SAFETY: the loader is loaded.
        let offered = unsafe { entry.enumerate_instance_extension_properties(None) };
        let offered = match offered {
            Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) => return Err(GpuError::NoDriver),
            other => other.call("vkEnumerateInstanceExtensionProperties", "the loader")?,
        };
        let layer = if validation {
            Some(find_layer(&entry)?)
        } else {
            None
        };
        let layer_has = |name| layer.as_ref().is_some_and(|l| has(&l.extensions, name));

        let debug_utils =
            has(&offered, vk::EXT_DEBUG_UTILS_NAME) || layer_has(vk::EXT_DEBUG_UTILS_NAME);
        let features = layer_has(vk::EXT_VALIDATION_FEATURES_NAME);
        let settings = layer_has(vk::EXT_LAYER_SETTINGS_NAME);
        if validation && !debug_utils {
            return Err(GpuError::NoValidation {
                what: "VK_EXT_debug_utils".to_owned(),
            });
        }
        if validation && !features && !settings {
            return Err(GpuError::NoValidation {
                what: "a layer with synchronization validation".to_owned(),
            });
        }

        let mut extension_names = Vec::new();
        let mut layer_names = Vec::new();
        if debug_utils {
            extension_names.push(vk::EXT_DEBUG_UTILS_NAME.as_ptr());
        }
        if features {
            extension_names.push(vk::EXT_VALIDATION_FEATURES_NAME.as_ptr());
        }
        let without_settings = extension_names.len();
        if settings {
            extension_names.push(vk::EXT_LAYER_SETTINGS_NAME.as_ptr());
        }
        if validation {
            layer_names.push(LAYER.as_ptr());
        }

        let name = c_string(application_name);
        let application = vk::ApplicationInfo::default()
            .application_name(&name)
            .engine_name(c"antumbra")
            .api_version(vk::API_VERSION_1_3);
        let log = Arc::<MessageLog>::default();
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut validation_features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        // Without the heuristic the layer skips what shaders do to images bound as descriptors.
        let on = vk::TRUE;
        let layer_settings: Vec<vk::LayerSettingEXT<'_>> = [
            c"validate_sync",
            c"syncval_shader_accesses_heuristic",
            c"syncval_full_validation",
        ]
        .into_iter()
        .map(|setting| {
            let mut info = vk::LayerSettingEXT::default()
                .layer_name(LAYER)
                .setting_name(setting)
                .ty(vk::LayerSettingTypeEXT::BOOL32)
                .values(bytemuck::bytes_of(&on));
            // The builder counts bytes; the layer counts values.
            info.value_count = 1;
            info
        })
        .collect();
        let mut settings_info = vk::LayerSettingsCreateInfoEXT::default().settings(&layer_settings);
        let mut messenger = messenger_info(&log);

        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_extension_names(&extension_names)
            .enabled_layer_names(&layer_names);
        if validation {
            info = info.push_next(&mut messenger);
        }
        if features {
            info = info.push_next(&mut validation_features);
        }
        if settings {
            info = info.push_next(&mut settings_info);
        }
        // SAFETY: every pointer of the chain is live, all layers and extensions are offered, and
        // the log outlives the instance because it is dropped after it.
        let mut created = unsafe { entry.create_instance(&info, None) };
        if settings && matches!(created, Err(vk::Result::ERROR_EXTENSION_NOT_PRESENT)) {
            // A loader older than the layer refuses extensions that it does not know. The layer
            // reads the structure all the same.
            log.lock().clear();
            info = info.enabled_extension_names(&extension_names[..without_settings]);
            // SAFETY: as above.
            created = unsafe { entry.create_instance(&info, None) };
        }
        let instance = match created {
            Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) => return Err(GpuError::NoDriver),
            Err(vk::Result::ERROR_LAYER_NOT_PRESENT) => {
                return Err(GpuError::NoValidation {
                    what: LAYER.to_string_lossy().into_owned(),
                });
            }
            other => other.call("vkCreateInstance", application_name)?,
        };
        let mut own = Self {
            entry,
            instance,
            messenger: None,
            log,
            debug_utils,
        };
        if validation {
            match Messenger::create(&own.entry, &own.instance, &own.log) {
                Ok(messenger) => own.messenger = Some(messenger),
                Err(error) => {
                    own.destroy();
                    return Err(error);
                }
            }
        }
        Ok(own)
    }

    /// Undoes `create` when no device came of it.
    pub(super) fn destroy(mut self) {
        if let Some(messenger) = &mut self.messenger {
            messenger.destroy();
        }
        // SAFETY: the instance is ours and has no children left.
        unsafe { self.instance.destroy_instance(None) };
    }
}
