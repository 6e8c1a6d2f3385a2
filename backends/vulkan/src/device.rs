//! The instance, the adapter and the device, with their queues and their memory.

use std::{
    ffi::{CStr, c_char, c_void},
    sync::{Arc, Mutex, PoisonError},
};

use ash::{ext, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use thiserror::Error;
use volact_core::{ActionError, select::SOFTWARE};
use volact_shaders::gpu::scene::cuts_loops;

use crate::{check::NAME, pipeline::STORAGE};

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Why a device cannot be used, or failed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// There is no Vulkan.
    #[error("no Vulkan library can be loaded: {why}")]
    NoVulkan {
        /// Why.
        why: String,
    },
    /// The validation layers were asked for and are not there.
    #[error("validation was asked for, but the layer {layer:?} is not installed; known: {known}")]
    NoValidation {
        /// The layer's name.
        layer: String,
        /// The layers that are there.
        known: String,
    },
    /// No adapter has what is needed.
    #[error("no adapter fits{asked}; found: {found}; wanted Vulkan 1.3 and stores from fragment stages")]
    NoAdapter {
        /// The name asked for.
        asked: String,
        /// The adapters found, with what each lacks.
        found: String,
    },
    /// A call failed.
    #[error("adapter {adapter:?}: {call} failed: {result}")]
    Call {
        /// The adapter.
        adapter: String,
        /// The call.
        call: &'static str,
        /// What it gave.
        result: vk::Result,
    },
    /// Memory could not be had.
    #[error("adapter {adapter:?}: no memory for {what} of {bytes} bytes: {why}")]
    Memory {
        /// The adapter.
        adapter: String,
        /// For what.
        what: String,
        /// How much.
        bytes: u64,
        /// Why.
        why: String,
    },
    /// The validation layers had something to say.
    #[error("the validation layers say: {}", messages.join("; "))]
    Validation {
        /// Their messages.
        messages: Vec<String>,
    },
}

impl From<DeviceError> for ActionError {
    fn from(error: DeviceError) -> Self {
        Self::Backend { action: NAME.into(), source: Box::new(error) }
    }
}

/// What the validation layers said.
type Messages = Mutex<Vec<String>>;

/// A device with its queues. Everything made of it holds it.
pub struct Gpu {
    pub device: ash::Device,
    pub limits: vk::PhysicalDeviceLimits,
    pub properties: vk::PhysicalDeviceProperties,
    pub queue: Queue,
    /// A queue that only moves data; the same as `queue` where there is none.
    pub transfer: Queue,
    allocator: Mutex<Option<Allocator>>,
    name: String,
    physical: vk::PhysicalDevice,
    debug: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Option<Box<Messages>>,
    instance: ash::Instance,
    // Last: the library is unloaded with it.
    _entry: ash::Entry,
}

/// A queue and its family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Queue {
    pub raw: vk::Queue,
    pub family: u32,
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Gpu {
    /// Opens the adapter whose name holds `wanted`, in any case; the first discrete one, or the first, where
    /// it is empty.
    ///
    /// # Errors
    /// If there is no Vulkan, no such adapter, or validation is asked for and cannot be had.
    pub fn open(wanted: &str, validation: bool) -> Result<Arc<Self>, DeviceError> {
        // SAFETY: the system's Vulkan loader is a library that is meant to be loaded; it lives in the
        // entry, which outlives all that is made of it.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| DeviceError::NoVulkan { why: error.to_string() })?;
        let instance = make_instance(&entry, validation)?;
        let parts = Opening { entry, instance: Some(instance) };
        let (debug, messages) = if validation { parts.listen()? } else { (None, None) };
        match parts.device(wanted) {
            Ok((physical, device, queue, transfer)) => {
                parts.finish(physical, device, [queue, transfer], debug, messages)
            }
            Err(error) => {
                if let Some((debug, messenger)) = debug {
                    // SAFETY: the messenger was made of this instance, which is still there.
                    unsafe { debug.destroy_debug_utils_messenger(messenger, None) };
                }
                Err(error)
            }
        }
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The adapter, its driver's version, and Vulkan's.
    pub fn description(&self) -> String {
        let [api, driver] = [self.properties.api_version, self.properties.driver_version];
        let version =
            |v| format!("{}.{}.{}", vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v));
        let software = if self.properties.device_type == vk::PhysicalDeviceType::CPU { SOFTWARE } else { "" };
        format!("{software}{} (Vulkan {}, driver {})", self.name, version(api), version(driver))
    }

    /// See [`cuts_loops`].
    pub fn cuts_loops(&self) -> bool {
        cuts_loops(&self.name)
    }

    /// The families that share what both queues touch.
    pub fn families(&self) -> Vec<u32> {
        let mut all = vec![self.queue.family, self.transfer.family];
        all.dedup();
        all
    }

    /// Whether images of a format can be sampled, and interpolated.
    pub fn samples(&self, format: vk::Format, linear: bool) -> bool {
        // SAFETY: the adapter belongs to the instance.
        let found = unsafe { self.instance.get_physical_device_format_properties(self.physical, format) };
        let mut wanted = vk::FormatFeatureFlags::SAMPLED_IMAGE | vk::FormatFeatureFlags::TRANSFER_DST;
        if linear {
            wanted |= vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        }
        found.optimal_tiling_features.contains(wanted)
    }

    /// The error of a call.
    pub fn failed(&self, call: &'static str) -> impl Fn(vk::Result) -> DeviceError + '_ {
        move |result| DeviceError::Call { adapter: self.name.clone(), call, result }
    }

    /// Works with the allocator.
    pub fn allocator<T>(&self, work: impl FnOnce(&mut Allocator) -> T) -> Option<T> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner).as_mut().map(work)
    }

    /// What the validation layers said since the last call.
    ///
    /// # Errors
    /// If they said anything.
    pub fn heard(&self) -> Result<(), DeviceError> {
        let Some(messages) = &self.messages else { return Ok(()) };
        let messages = std::mem::take(&mut *messages.lock().unwrap_or_else(PoisonError::into_inner));
        if messages.is_empty() { Ok(()) } else { Err(DeviceError::Validation { messages }) }
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: everything made of the device holds it and is gone; the allocator's memory goes before
        // the device, the messenger and the device before the instance.
        unsafe {
            _ = self.device.device_wait_idle();
            self.allocator.lock().unwrap_or_else(PoisonError::into_inner).take();
            self.device.destroy_device(None);
            if let Some((debug, messenger)) = self.debug.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

/// An instance that is destroyed unless it becomes a device's.
struct Opening {
    entry: ash::Entry,
    instance: Option<ash::Instance>,
}

type Debug = Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>;

impl Opening {
    fn instance(&self) -> Result<&ash::Instance, DeviceError> {
        self.instance.as_ref().ok_or_else(|| DeviceError::NoVulkan { why: "the instance is gone".into() })
    }

    /// Has the layers' messages collected.
    fn listen(&self) -> Result<(Debug, Option<Box<Messages>>), DeviceError> {
        let messages = Box::<Messages>::default();
        let debug = ext::debug_utils::Instance::new(&self.entry, self.instance()?);
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(hear))
            .user_data(std::ptr::from_ref::<Messages>(&messages).cast_mut().cast());
        // SAFETY: the box stays where it is and is kept until after the messenger is destroyed.
        let made = unsafe { debug.create_debug_utils_messenger(&info, None) };
        let messenger = made.map_err(|e| DeviceError::NoVulkan { why: format!("no debug messenger: {e}") })?;
        Ok((Some((debug, messenger)), Some(messages)))
    }

    fn device(&self, wanted: &str) -> Result<(vk::PhysicalDevice, ash::Device, Queue, Queue), DeviceError> {
        let instance = self.instance()?;
        let why = |result: vk::Result| DeviceError::NoVulkan { why: result.to_string() };
        // SAFETY: the instance is there.
        let all = unsafe { instance.enumerate_physical_devices() }.map_err(why)?;
        let mut found = Vec::new();
        let mut fitting = Vec::new();
        for physical in all {
            let adapter = Adapter::new(instance, physical);
            let lacks = adapter.lacks(wanted);
            found.push(format!("{:?}{}", adapter.name, lacks.map_or(String::new(), |l| format!(" ({l})"))));
            if lacks.is_none() {
                fitting.push(adapter);
            }
        }
        // A stable sort: of equals the first.
        fitting.sort_by_key(|a| a.rank());
        let Some(adapter) = fitting.first() else {
            let asked = if wanted.is_empty() { String::new() } else { format!(" {wanted:?}") };
            return Err(DeviceError::NoAdapter { asked, found: found.join(", ") });
        };
        adapter.open(instance)
    }

    fn finish(
        mut self,
        physical: vk::PhysicalDevice,
        device: ash::Device,
        [queue, transfer]: [Queue; 2],
        debug: Debug,
        messages: Option<Box<Messages>>,
    ) -> Result<Arc<Gpu>, DeviceError> {
        let instance =
            self.instance.take().ok_or_else(|| DeviceError::NoVulkan { why: "the instance is gone".into() })?;
        // SAFETY: the adapter belongs to the instance.
        let properties = unsafe { instance.get_physical_device_properties(physical) };
        let name = text(&properties.device_name);
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        });
        let (allocator, why) = match allocator {
            Ok(allocator) => (Some(allocator), None),
            Err(error) => (None, Some(error.to_string())),
        };
        let gpu = Gpu {
            device,
            limits: properties.limits,
            properties,
            queue,
            transfer,
            allocator: Mutex::new(allocator),
            name: name.clone(),
            physical,
            debug,
            messages,
            instance,
            _entry: self.entry.clone(),
        };
        match why {
            Some(why) => Err(DeviceError::Memory { adapter: name, what: "an allocator".into(), bytes: 0, why }),
            None => Ok(Arc::new(gpu)),
        }
    }
}

impl Drop for Opening {
    fn drop(&mut self) {
        if let Some(instance) = self.instance.take() {
            // SAFETY: no device was made of it, or it would have been taken.
            unsafe { instance.destroy_instance(None) };
        }
    }
}

/// An adapter that may be opened.
struct Adapter {
    physical: vk::PhysicalDevice,
    properties: vk::PhysicalDeviceProperties,
    features: vk::PhysicalDeviceFeatures,
    families: Vec<vk::QueueFamilyProperties>,
    name: String,
}

impl Adapter {
    fn new(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Self {
        // SAFETY: the adapter belongs to the instance.
        let (properties, features, families) = unsafe {
            (
                instance.get_physical_device_properties(physical),
                instance.get_physical_device_features(physical),
                instance.get_physical_device_queue_family_properties(physical),
            )
        };
        Self { physical, properties, features, families, name: text(&properties.device_name) }
    }

    /// Why it cannot be taken. Dynamic rendering, synchronization2 and timeline semaphores are part of
    /// Vulkan 1.3.
    fn lacks(&self, wanted: &str) -> Option<&'static str> {
        if !self.name.to_lowercase().contains(&wanted.to_lowercase()) {
            return Some("another name");
        }
        if self.properties.api_version < vk::API_VERSION_1_3 {
            return Some("no Vulkan 1.3");
        }
        if self.features.fragment_stores_and_atomics == vk::FALSE {
            return Some("no stores from fragment stages");
        }
        if (self.properties.limits.max_per_stage_descriptor_storage_buffers as usize) < STORAGE.len() {
            return Some("too few storage buffers a stage");
        }
        self.family(vk::QueueFlags::GRAPHICS).is_none().then_some("no queue for graphics")
    }

    fn family(&self, wanted: vk::QueueFlags) -> Option<u32> {
        self.families.iter().position(|f| f.queue_flags.contains(wanted)).map(|i| i as u32)
    }

    fn rank(&self) -> u32 {
        match self.properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => 0,
            vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
            vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
            _ => 3,
        }
    }

    fn open(&self, instance: &ash::Instance) -> Result<(vk::PhysicalDevice, ash::Device, Queue, Queue), DeviceError> {
        let graphics = self.family(vk::QueueFlags::GRAPHICS).unwrap_or(0);
        let only = |f: &vk::QueueFamilyProperties| {
            let other = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
            f.queue_flags.contains(vk::QueueFlags::TRANSFER) && !f.queue_flags.intersects(other)
        };
        // Whole images are moved slice by slice: any granularity will do that leaves whole slices.
        let transfer = self.families.iter().position(only).map_or(graphics, |i| i as u32);
        let priorities = [1.0];
        let mut families = vec![graphics, transfer];
        families.dedup();
        let queue = |family: &u32| {
            vk::DeviceQueueCreateInfo::default().queue_family_index(*family).queue_priorities(&priorities)
        };
        let queues: Vec<_> = families.iter().map(queue).collect();
        let features = vk::PhysicalDeviceFeatures::default().fragment_stores_and_atomics(true);
        let mut newer = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let mut newest = vk::PhysicalDeviceVulkan13Features::default().dynamic_rendering(true).synchronization2(true);
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&features)
            .push_next(&mut newer)
            .push_next(&mut newest);
        // SAFETY: the families are the adapter's, and the features are those it has by `lacks`.
        let made = unsafe { instance.create_device(self.physical, &info, None) };
        let device =
            made.map_err(|result| DeviceError::Call { adapter: self.name.clone(), call: "vkCreateDevice", result })?;
        // SAFETY: both queues were asked for.
        let queue = |family| Queue { raw: unsafe { device.get_device_queue(family, 0) }, family };
        let (graphics, transfer) = (queue(graphics), queue(transfer));
        Ok((self.physical, device, graphics, transfer))
    }
}

fn make_instance(entry: &ash::Entry, validation: bool) -> Result<ash::Instance, DeviceError> {
    let why = |result: vk::Result| DeviceError::NoVulkan { why: result.to_string() };
    if validation {
        // SAFETY: the library is loaded.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.map_err(why)?;
        let names: Vec<String> = layers.iter().map(|l| text(&l.layer_name)).collect();
        let layer = VALIDATION.to_string_lossy().into_owned();
        if !names.contains(&layer) {
            return Err(DeviceError::NoValidation { layer, known: names.join(", ") });
        }
    }
    let about = vk::ApplicationInfo::default().application_name(c"volact").api_version(vk::API_VERSION_1_3);
    let layers = [VALIDATION.as_ptr()];
    let extensions = [ext::debug_utils::NAME.as_ptr(), ext::validation_features::NAME.as_ptr()];
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    let mut info = vk::InstanceCreateInfo::default().application_info(&about);
    if validation {
        info = info.enabled_layer_names(&layers).enabled_extension_names(&extensions).push_next(&mut features);
    }
    // SAFETY: all that the description points to lives until the call returns.
    unsafe { entry.create_instance(&info, None) }.map_err(why)
}

/// Takes down what a layer says.
unsafe extern "system" fn hear(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `messages` is the box given to the messenger, which outlives it; `data` and its message are
    // the layer's, for the time of this call.
    unsafe {
        let messages = &*messages.cast::<Messages>();
        if let Some(message) = data.as_ref().and_then(|d| d.message_as_c_str()) {
            messages.lock().unwrap_or_else(PoisonError::into_inner).push(message.to_string_lossy().into_owned());
        }
    }
    vk::FALSE
}

fn text(name: &[c_char]) -> String {
    let bytes: Vec<u8> = name.iter().take_while(|c| **c != 0).map(|c| c.cast_unsigned()).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
