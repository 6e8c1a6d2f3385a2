//! The device: found by name or power, with what it has and what it lacks.

use std::sync::{Arc, Mutex, PoisonError};

use thiserror::Error;
use volact_core::{ActionError, select::SOFTWARE};
use volact_shaders::gpu::scene::cuts_loops;

use crate::{NAME, options::Adapter};

/// Why there is no device, or no more.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// No adapter that could be taken.
    #[error("no adapter {wanted}; found: {found}")]
    NoAdapter {
        /// What was wanted.
        wanted: String,
        /// All that there are.
        found: String,
    },
    /// The adapter gives no device.
    #[error("adapter {adapter:?} gives no device: {why}")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// What it says.
        why: String,
    },
    /// Memory of the device is used up.
    #[error("adapter {adapter:?} is out of memory; draw fewer or smaller volumes, or take a smaller format")]
    OutOfMemory {
        /// The adapter's name.
        adapter: String,
    },
    /// The device is gone.
    #[error("adapter {adapter:?} was lost: {why}; make the action anew")]
    Lost {
        /// The adapter's name.
        adapter: String,
        /// What it says.
        why: String,
    },
    /// Something that the device refused.
    #[error("adapter {adapter:?} failed: {why}")]
    Failed {
        /// The adapter's name.
        adapter: String,
        /// What it says.
        why: String,
    },
}

impl From<DeviceError> for ActionError {
    fn from(error: DeviceError) -> Self {
        Self::Backend { action: NAME.into(), source: Box::new(error) }
    }
}

/// A device with its queue.
#[derive(Debug)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// What it has.
    pub limits: wgpu::Limits,
    features: wgpu::Features,
    name: String,
    description: String,
    failed: Arc<Mutex<Option<DeviceError>>>,
    /// Whether it is an application's.
    shared: bool,
    stores: Option<bool>,
}

/// Features that are used where they are there.
const USEFUL: [wgpu::Features; 3] =
    [wgpu::Features::TEXTURE_FORMAT_16BIT_NORM, wgpu::Features::FLOAT32_FILTERABLE, wgpu::Features::TIMESTAMP_QUERY];

impl Gpu {
    /// A device of its own on the adapter asked for.
    ///
    /// # Errors
    /// If there is none, or it gives no device.
    pub fn open(wanted: &Adapter) -> Result<Self, DeviceError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapter = choose(&instance, wanted)?;
        let info = adapter.get_info();
        let useful = USEFUL.into_iter().fold(wgpu::Features::empty(), |all, f| all | f);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("volact"),
            required_features: adapter.features() & useful,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let made = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) =
            made.map_err(|error| DeviceError::NoDevice { adapter: info.name.clone(), why: error.to_string() })?;
        let flags = adapter.get_downlevel_capabilities().flags;
        let stores = Some(flags.contains(wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE));
        Ok(Self { stores, ..Self::new(device, queue) })
    }

    fn new(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let made = Self { shared: false, ..Self::of_application(device, queue) };
        let keep = |failed: &Arc<Mutex<Option<DeviceError>>>, error| {
            log::error!("wgpu: {error}");
            failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        };
        let (adapter, place) = (made.name.clone(), Arc::clone(&made.failed));
        made.device.on_uncaptured_error(Arc::new(move |error| keep(&place, told(&adapter, error))));
        let (adapter, place) = (made.name.clone(), Arc::clone(&made.failed));
        made.device.set_device_lost_callback(move |reason, why| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep(&place, DeviceError::Lost { adapter: adapter.clone(), why });
            }
        });
        made
    }

    /// A device that an application has made, whose handlers of errors are left as they are.
    pub fn of_application(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let wgpu::AdapterInfo { name, backend, driver, driver_info, device_type, .. } = device.adapter_info();
        let software = if device_type == wgpu::DeviceType::Cpu { SOFTWARE } else { "" };
        let description = format!("{software}{name} ({backend:?}, {driver} {driver_info})");
        let (limits, features) = (device.limits(), device.features());
        log::info!("wgpu: {description}");
        let failed = Arc::new(Mutex::new(None));
        Self { device, queue, limits, features, name, description, failed, shared: true, stores: None }
    }

    /// Catches errors of an application's device until they are closed.
    pub fn scopes(&self) -> Scopes {
        use wgpu::ErrorFilter as F;
        let filters = if self.shared { vec![F::OutOfMemory, F::Validation, F::Internal] } else { Vec::new() };
        Scopes(filters.into_iter().map(|filter| self.device.push_error_scope(filter)).collect())
    }

    /// The first failure since this was asked last. A lost device stays lost.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), DeviceError> {
        let mut failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        let lost = matches!(*failed, Some(DeviceError::Lost { .. }));
        let error = if lost { failed.clone() } else { failed.take() };
        error.map_or(Ok(()), Err)
    }

    /// The adapter's name, and what runs it.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// See [`cuts_loops`].
    pub fn cuts_loops(&self) -> bool {
        cuts_loops(&self.name)
    }

    /// Whether fragment stages may write to buffers; `None` where an application's device does not say.
    pub fn stores_from_fragments(&self) -> Option<bool> {
        self.stores
    }

    /// Whether it has a feature.
    pub fn has(&self, feature: wgpu::Features) -> bool {
        self.features.contains(feature)
    }
}

/// Errors that are caught.
pub struct Scopes(Vec<wgpu::ErrorScopeGuard>);

impl Scopes {
    /// The first error since they were opened, if there was one.
    ///
    /// # Errors
    /// That.
    pub fn close(mut self, adapter: &str) -> Result<(), DeviceError> {
        let mut first = None;
        while let Some(scope) = self.0.pop() {
            let error = pollster::block_on(scope.pop());
            first = first.or(error.map(|error| told(adapter, error)));
        }
        first.map_or(Ok(()), Err)
    }
}

fn told(adapter: &str, error: wgpu::Error) -> DeviceError {
    let adapter = adapter.to_owned();
    match error {
        wgpu::Error::OutOfMemory { .. } => DeviceError::OutOfMemory { adapter },
        other => DeviceError::Failed { adapter, why: other.to_string() },
    }
}

fn choose(instance: &wgpu::Instance, wanted: &Adapter) -> Result<wgpu::Adapter, DeviceError> {
    let mut all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let describe = |a: &wgpu::Adapter| format!("{:?} ({:?})", a.get_info().name, a.get_info().backend);
    let found = all.iter().map(describe).collect::<Vec<_>>().join(", ");
    let rank = |a: &wgpu::Adapter| match (a.get_info().device_type, wanted.low_power) {
        (wgpu::DeviceType::DiscreteGpu, false) | (wgpu::DeviceType::IntegratedGpu, true) => 0,
        (wgpu::DeviceType::IntegratedGpu, false) | (wgpu::DeviceType::DiscreteGpu, true) => 1,
        (wgpu::DeviceType::VirtualGpu, _) => 2,
        (wgpu::DeviceType::Other, _) => 3,
        (wgpu::DeviceType::Cpu, _) => 4,
    };
    let named = wanted.name.to_lowercase();
    all.retain(|a| a.get_info().name.to_lowercase().contains(&named));
    // Adapters without compute stages draw nothing here.
    all.retain(|a| a.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS));
    all.sort_by_key(rank);
    all.into_iter().next().ok_or_else(|| DeviceError::NoAdapter {
        wanted: if named.is_empty() {
            "with compute stages".into()
        } else {
            format!("with {:?} in its name", wanted.name)
        },
        found: if found.is_empty() { "none".into() } else { found },
    })
}
