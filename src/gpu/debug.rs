//! Names and labels for tools, and the validation layer's messages.

use std::ffi::{CStr, CString, c_void};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;

use super::context::Gpu;
use super::error::{CallResult, GpuError};

/// How grave a validation message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MessageSeverity {
    /// Allowed, but hardly meant.
    Warning,
    /// A use that the specification forbids.
    Error,
}

/// One message of the validation layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValidationMessage {
    /// The message's identifier, such as a VUID or `SYNC-HAZARD-..`.
    pub id: String,
    /// How grave it is.
    pub severity: MessageSeverity,
    /// What the layer says.
    pub text: String,
}

impl std::fmt::Display for ValidationMessage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} [{}] {}", self.severity, self.id, self.text)
    }
}

/// Where the driver's callback puts its messages.
#[derive(Debug, Default)]
pub(super) struct MessageLog(Mutex<Vec<ValidationMessage>>);

impl MessageLog {
    pub(super) fn lock(&self) -> MutexGuard<'_, Vec<ValidationMessage>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The messenger that collects the layer's warnings and errors.
pub(super) struct Messenger {
    functions: ash::ext::debug_utils::Instance,
    raw: vk::DebugUtilsMessengerEXT,
}

/// # Safety
/// `text` is null or a valid C string.
unsafe fn lossy(text: *const std::ffi::c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: by the function's contract.
    unsafe { CStr::from_ptr(text) }
        .to_string_lossy()
        .into_owned()
}

unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid structure, and `log` is the MessageLog given in
    // `messenger_info`, which outlives the instance.
    let (data, log) = unsafe { (data.as_ref(), log.cast::<MessageLog>().as_ref()) };
    if let (Some(data), Some(log)) = (data, log) {
        // SAFETY: the layer's strings are null or valid for the duration of the call.
        let (id, text) = unsafe { (lossy(data.p_message_id_name), lossy(data.p_message)) };
        let severity = if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
            MessageSeverity::Error
        } else {
            MessageSeverity::Warning
        };
        log.lock().push(ValidationMessage { id, severity, text });
    }
    vk::FALSE
}

/// The messenger's description. The log has to outlive every instance made with it.
pub(super) fn messenger_info(
    log: &Arc<MessageLog>,
) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT {
        message_severity: vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
            | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
        message_type: vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
            | vk::DebugUtilsMessageTypeFlagsEXT::GENERAL,
        pfn_user_callback: Some(on_message),
        p_user_data: Arc::as_ptr(log).cast_mut().cast(),
        ..Default::default()
    }
}

impl Messenger {
    pub(super) fn create(
        entry: &ash::Entry,
        instance: &ash::Instance,
        log: &Arc<MessageLog>,
    ) -> Result<Self, GpuError> {
        let functions = ash::ext::debug_utils::Instance::new(entry, instance);
        // SAFETY: the extension is enabled on the instance, and the log outlives it.
        let raw = unsafe { functions.create_debug_utils_messenger(&messenger_info(log), None) }
            .call("vkCreateDebugUtilsMessengerEXT", "the validation messenger")?;
        Ok(Self { functions, raw })
    }

    /// Call once, before the instance is destroyed.
    pub(super) fn destroy(&mut self) {
        // SAFETY: made in `create` on an instance that is still live; called once.
        unsafe { self.functions.destroy_debug_utils_messenger(self.raw, None) };
        self.raw = vk::DebugUtilsMessengerEXT::null();
    }
}

/// A C string of `text`, with zero bytes inside left out.
pub(super) fn c_string(text: &str) -> CString {
    let bytes: Vec<u8> = text.bytes().filter(|&b| b != 0).collect();
    CString::new(bytes).unwrap_or_default()
}

impl Gpu {
    /// The messages that the validation layer has given so far, oldest first. Empty without
    /// validation.
    #[must_use]
    pub fn messages(&self) -> Vec<ValidationMessage> {
        self.log.lock().clone()
    }

    /// As [`Gpu::messages`], and forgets them.
    pub fn take_messages(&mut self) -> Vec<ValidationMessage> {
        std::mem::take(&mut *self.log.lock())
    }

    /// Names an object for validation messages, captures and debuggers. Does nothing without
    /// `VK_EXT_debug_utils`.
    pub fn set_name<T: vk::Handle>(&self, handle: T, name: &str) {
        let Some(debug) = &self.debug_utils else {
            return;
        };
        let name = c_string(name);
        let info = vk::DebugUtilsObjectNameInfoEXT::default()
            .object_handle(handle)
            .object_name(&name);
        // SAFETY: the extension is enabled, the handle is one of this device. A lost name is no
        // reason to fail.
        if let Err(result) = unsafe { debug.set_debug_utils_object_name(&info) } {
            log::debug!("vkSetDebugUtilsObjectNameEXT failed for {name:?}: {result:?}");
        }
    }

    /// Opens a label in a command buffer being recorded.
    pub fn begin_label(&self, cmd: vk::CommandBuffer, name: &str) {
        if let Some(debug) = &self.debug_utils {
            let name = c_string(name);
            // SAFETY: the extension is enabled and the command buffer is being recorded, by the
            // caller's promise.
            unsafe {
                debug.cmd_begin_debug_utils_label(
                    cmd,
                    &vk::DebugUtilsLabelEXT::default().label_name(&name),
                )
            };
        }
    }

    /// Closes the label opened last.
    pub fn end_label(&self, cmd: vk::CommandBuffer) {
        if let Some(debug) = &self.debug_utils {
            // SAFETY: as in `begin_label`, and a label is open.
            unsafe { debug.cmd_end_debug_utils_label(cmd) };
        }
    }
}
