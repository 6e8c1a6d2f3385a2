//! The plugin's side: makes the boundary's tables out of a [`Registry`] that a plugin filled.
//!
//! Authors do not use this module: the macro `export!` of the crate `volact-plugin` does.

mod action;
mod loader;

use std::{cell::RefCell, ffi::c_void, panic::AssertUnwindSafe, sync::OnceLock};

use super::{
    abi::{self, ActionTable, Answer, GeometryTable, GeometryView, Host, LoaderTable, Parameters, Plugin, ShaderTable},
    arena::Arena,
    declare::{compositing_code, lend_declaration},
    geometry::give_geometry,
    services,
    status::{Code, Fault},
    value::{Identities, decode_map},
};
use crate::{
    Registry,
    registry::{GeometryFactory, RegisterError},
};

/// What a plugin in Rust exports: its name and the function that registers everything.
pub struct Export {
    name: &'static str,
    version: &'static str,
    description: &'static str,
    register: fn(&mut Registry) -> Result<(), RegisterError>,
    made: OnceLock<Made>,
}

/// The tables; they live as long as the process.
struct Made {
    plugin: Plugin,
    _kept: Arena,
}

// SAFETY: the tables are only read once they are made, and their `user`s are `Sync`.
unsafe impl Send for Made {}
// SAFETY: as for Send.
unsafe impl Sync for Made {}

thread_local! {
    /// What results of the last call on this thread point to.
    static RESULT: RefCell<Arena> = RefCell::default();
}

/// Keeps what a result points to until the next call on this thread.
fn keep(arena: Arena) {
    let old = RESULT.with(|kept| kept.replace(arena));
    drop(old);
}

impl Export {
    /// An export, as the macro makes it.
    pub const fn new(
        name: &'static str,
        version: &'static str,
        description: &'static str,
        register: fn(&mut Registry) -> Result<(), RegisterError>,
    ) -> Self {
        Self { name, version, description, register, made: OnceLock::new() }
    }

    /// The one entry: agrees on a version and gives the table.
    ///
    /// # Safety
    /// `host` and `answer` are null or point to tables whose sizes are true; the host's lives as long
    /// as the process.
    pub unsafe fn enter(&'static self, host: *const Host, answer: *mut Answer) -> i32 {
        // SAFETY: as promised by the caller.
        services::answer(|| unsafe { self.negotiate(host, answer) })
    }

    /// # Safety
    /// As [`enter`](Self::enter).
    unsafe fn negotiate(&'static self, host: *const Host, answer: *mut Answer) -> Result<(), Fault> {
        // SAFETY: as promised by the caller.
        let host = unsafe { services::check_host(host) }?;
        // SAFETY: as promised by the caller.
        let answer = unsafe { answer.as_mut() }.ok_or_else(|| Fault::bad("answer", "a null pointer", "a table"))?;
        answer.version = abi::VERSION;
        services::set_host(host);
        let major = |version: u32| version >> 16;
        if major(host.oldest) > major(abi::VERSION) || major(host.newest) < major(abi::VERSION) {
            return Err(Fault::new(Code::BadVersion, "the host speaks no version that this plugin speaks"));
        }
        answer.version = abi::VERSION.min(host.newest);
        if !services::is_own(host) {
            services::redirect(self.name);
        }
        if self.made.get().is_none() {
            let made = self.make()?;
            _ = self.made.set(made);
        }
        let made = self.made.get().ok_or_else(|| Fault::new(Code::Failed, "no table could be made"))?;
        answer.plugin = &raw const made.plugin;
        Ok(())
    }

    fn make(&self) -> Result<Made, Fault> {
        let mut registry = Registry::new();
        (self.register)(&mut registry).map_err(|error| Fault::new(Code::BadName, error.to_string()))?;
        let mut arena = Arena::default();
        let actions = registry.actions().map(|(d, f)| arena_one(&mut arena, |a| action::table(d, f, a))).collect();
        let geometries = registry.geometries().map(|(d, f)| {
            let made = GeometryTable {
                size: size_of::<GeometryTable>() as u32,
                reserved: 0,
                declaration: lend_declaration(d, &mut arena),
                user: arena.one(f.clone()).cast_mut().cast(),
                make: Some(make_geometry),
            };
            arena.one(made)
        });
        let geometries: Vec<*const GeometryTable> = geometries.collect();
        let loaders = registry.loaders().iter().map(|l| arena_one(&mut arena, |a| loader::table(l, a))).collect();
        let mut shaders: Vec<*const ShaderTable> = Vec::new();
        for entry in registry.shaders().iter() {
            let source = registry.shader_source(&entry.declaration.name).unwrap_or("");
            let made = ShaderTable {
                size: size_of::<ShaderTable>() as u32,
                compositing: compositing_code(entry.compositing),
                declaration: lend_declaration(&entry.declaration, &mut arena),
                source: arena.text(source),
            };
            shaders.push(arena.one(made));
        }
        Ok(self.table(arena, actions, shaders, geometries, loaders))
    }

    fn table(
        &self,
        mut arena: Arena,
        actions: Vec<*const ActionTable>,
        shaders: Vec<*const ShaderTable>,
        geometries: Vec<*const GeometryTable>,
        loaders: Vec<*const LoaderTable>,
    ) -> Made {
        let (actions, action_count) = arena.list(actions);
        let (shaders, shader_count) = arena.list(shaders);
        let (geometries, geometry_count) = arena.list(geometries);
        let (loaders, loader_count) = arena.list(loaders);
        let plugin = Plugin {
            size: size_of::<Plugin>() as u32,
            reserved: 0,
            name: arena.text(self.name),
            version: arena.text(self.version),
            description: arena.text(self.description),
            actions,
            action_count,
            shaders,
            shader_count,
            geometries,
            geometry_count,
            loaders,
            loader_count,
        };
        Made { plugin, _kept: arena }
    }
}

fn arena_one<T: 'static>(arena: &mut Arena, make: impl FnOnce(&mut Arena) -> T) -> *const T {
    let made = make(arena);
    arena.one(made)
}

/// What stands behind a table's `user`.
///
/// # Safety
/// `user` is what the table was made with.
unsafe fn user<'a, T>(user: *mut c_void) -> &'a T {
    // SAFETY: as promised by the caller; tables live as long as the process.
    unsafe { &*user.cast() }
}

/// An argument that must be there.
///
/// # Safety
/// `pointer` is null or valid for the call.
unsafe fn given<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Fault> {
    // SAFETY: as promised by the caller.
    unsafe { pointer.as_ref() }.ok_or_else(|| Fault::bad(what, "a null pointer", "an address"))
}

/// A place for a result that must be there.
///
/// # Safety
/// `pointer` is null or valid for the call.
unsafe fn place<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut T, Fault> {
    // SAFETY: as promised by the caller.
    unsafe { pointer.as_mut() }.ok_or_else(|| Fault::bad(what, "a null pointer", "an address"))
}

unsafe extern "C" fn make_geometry(at: *mut c_void, parameters: Parameters, made: *mut GeometryView) -> i32 {
    services::answer(|| {
        // SAFETY: the host gives what the table was made with, and valid arguments.
        let (factory, made) = unsafe { (user::<GeometryFactory>(at), place(made, "geometry")?) };
        // SAFETY: as above.
        let parameters = unsafe { decode_map(parameters, &mut Identities::default()) }?;
        let geometry = factory(&parameters).map_err(|e| Fault::new(Code::BadValue, e.to_string()))?;
        let mut arena = Arena::default();
        *made = give_geometry(&geometry, &mut arena);
        keep(arena);
        Ok(())
    })
}

/// Drops something of the plugin's author, which may panic.
fn drop_quietly<T>(value: T, what: &str) {
    if let Err(payload) = std::panic::catch_unwind(AssertUnwindSafe(|| drop(value))) {
        std::mem::forget(payload);
        log::error!("{what} panicked when it was dropped");
    }
}
