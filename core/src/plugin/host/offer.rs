//! What a plugin's table offers, checked and wrapped before anything is registered.

use std::{ffi::c_void, sync::Arc};

use super::{
    action::{self, Shown},
    call, check_size,
    loader::{self, PluginLoader},
    needed,
};
use crate::{
    Declaration, Geometry, Loader, ShaderEntry, ShaderText,
    geometry::GeometryError,
    parameter::{Kind, ParameterMap},
    plugin::{
        abi::{ActionTable, GeometryTable, GeometryView, LoaderTable, Parameters, Plugin, ShaderTable},
        arena::{Arena, list_of, string_of},
        array::Passing,
        declare::{compositing_of, decode_declaration},
        geometry::{decode_geometry, empty_geometry},
        status::{Code, Fault},
        value::lend_map,
    },
    registry::{ActionFactory, GeometryFactory},
};

/// The most registrations of a kind.
const MOST: u64 = 4096;

/// Something that a plugin registers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Registration {
    /// What it is.
    pub kind: Kind,
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
}

/// What a registry takes, by kind.
pub(super) enum Item {
    Action(ActionFactory),
    Shader(ShaderEntry),
    Geometry(GeometryFactory),
    Loader(Arc<dyn Loader>),
}

/// All that a plugin offers.
pub(super) struct Offer {
    pub name: String,
    pub version: String,
    pub description: String,
    pub items: Vec<(Declaration, Item)>,
}

/// The tables of one kind.
///
/// # Safety
/// `data` is null or points to `count` pointers, each null or to a table that lives as long as the process.
unsafe fn tables<T>(data: *const *const T, count: u64, kind: Kind) -> Result<Vec<&'static T>, Fault> {
    let what = format!("tables of kind {}", kind.name());
    if count > MOST {
        return Err(Fault::bad(format!("number of {what}"), count, format!("at most {MOST}")));
    }
    // SAFETY: as promised by the caller.
    let pointers = unsafe { list_of(data, count, &what) }?;
    let mut all = Vec::new();
    for (i, pointer) in pointers.iter().enumerate() {
        let aligned = pointer.is_null() || pointer.is_aligned();
        // SAFETY: as promised by the caller.
        let table = unsafe { pointer.as_ref() }.filter(|_| aligned);
        all.push(
            table.ok_or_else(|| Fault::bad(format!("table {i} of kind {}", kind.name()), "null or odd", "a table"))?,
        );
    }
    Ok(all)
}

impl Offer {
    /// Reads a table.
    ///
    /// # Safety
    /// What the table says is true, and it lives as long as the process.
    pub unsafe fn read(table: &'static Plugin) -> Result<Self, Fault> {
        // SAFETY: as promised by the caller.
        let name = unsafe { string_of(table.name, "name of the plugin") }?;
        if name.is_empty() || name.len() > 256 {
            return Err(Fault::new(Code::BadName, format!("name of the plugin is {name:?}, wanted 1 to 256 bytes")));
        }
        // SAFETY: as above.
        let version = unsafe { string_of(table.version, "version of the plugin") }?;
        // SAFETY: as above.
        let description = unsafe { string_of(table.description, "description of the plugin") }?;
        let mut offer = Self { name, version, description, items: Vec::new() };
        // SAFETY: as above.
        for table in unsafe { tables(table.actions, table.action_count, Kind::Action) }? {
            // SAFETY: as above.
            unsafe { offer.action(table) }?;
        }
        // SAFETY: as above.
        for table in unsafe { tables(table.shaders, table.shader_count, Kind::Shader) }? {
            // SAFETY: as above.
            unsafe { offer.shader(table) }?;
        }
        // SAFETY: as above.
        for table in unsafe { tables(table.geometries, table.geometry_count, Kind::Geometry) }? {
            // SAFETY: as above.
            unsafe { offer.geometry(table) }?;
        }
        // SAFETY: as above.
        for table in unsafe { tables(table.loaders, table.loader_count, Kind::Loader) }? {
            // SAFETY: as above.
            unsafe { offer.loader(table) }?;
        }
        Ok(offer)
    }

    /// # Safety
    /// As [`read`](Self::read); so for the other kinds.
    unsafe fn action(&mut self, table: &'static ActionTable) -> Result<(), Fault> {
        check_size(table.size, size_of::<ActionTable>(), "an action")?;
        // SAFETY: as promised by the caller.
        let declaration = unsafe { decode_declaration(&table.declaration, Kind::Action) }?;
        let factory = action::factory(&self.name, table, &declaration)?;
        self.items.push((declaration, Item::Action(factory)));
        Ok(())
    }

    /// # Safety
    /// As [`read`](Self::read).
    unsafe fn shader(&mut self, table: &'static ShaderTable) -> Result<(), Fault> {
        check_size(table.size, size_of::<ShaderTable>(), "a shader")?;
        // SAFETY: as promised by the caller.
        let declaration = unsafe { decode_declaration(&table.declaration, Kind::Shader) }?;
        let what = format!("source of shader {:?}", declaration.name);
        // SAFETY: as promised by the caller.
        let text = unsafe { string_of(table.source, &what) }?;
        let file = format!("{}: {}.wgsl", self.name, declaration.name);
        let source = Some(Arc::new(ShaderText { file, text }));
        let compositing = compositing_of(table.compositing)?;
        let entry = ShaderEntry { declaration: declaration.clone(), compositing, source };
        self.items.push((declaration, Item::Shader(entry)));
        Ok(())
    }

    /// # Safety
    /// As [`read`](Self::read).
    unsafe fn geometry(&mut self, table: &'static GeometryTable) -> Result<(), Fault> {
        check_size(table.size, size_of::<GeometryTable>(), "a geometry")?;
        // SAFETY: as promised by the caller.
        let declaration = unsafe { decode_declaration(&table.declaration, Kind::Geometry) }?;
        let make = needed(table.make, &format!("geometry {:?}", declaration.name), "make")?;
        let factory = geometry_factory(&self.name, Shown(table), make, &declaration.name);
        self.items.push((declaration, Item::Geometry(factory)));
        Ok(())
    }

    /// # Safety
    /// As [`read`](Self::read).
    unsafe fn loader(&mut self, table: &'static LoaderTable) -> Result<(), Fault> {
        check_size(table.size, size_of::<LoaderTable>(), "a loader")?;
        // SAFETY: as promised by the caller.
        let declaration = unsafe { decode_declaration(&table.declaration, Kind::Loader) }?;
        let loader = PluginLoader::new(&self.name, table, &declaration)?;
        self.items.push((declaration, Item::Loader(loader::shared(loader))));
        Ok(())
    }
}

type Make = unsafe extern "C" fn(*mut c_void, Parameters, *mut GeometryView) -> i32;

fn geometry_factory(plugin: &str, table: Shown<GeometryTable>, make: Make, name: &str) -> GeometryFactory {
    let (plugin, name) = (plugin.to_owned(), name.to_owned());
    Arc::new(move |parameters| {
        let made = make_geometry(&plugin, table.get(), make, parameters);
        let made = made.map_err(|fault| GeometryError::Plugin(fault.of(&plugin)))?;
        // Whatever it calls itself, it is known by the name that it was asked for.
        Ok(if made.name() == name {
            made
        } else {
            Arc::new(crate::plugin::geometry::Named { name: name.clone(), inner: made })
        })
    })
}

fn make_geometry(
    plugin: &str,
    table: &GeometryTable,
    make: Make,
    parameters: &ParameterMap,
) -> Result<Arc<dyn Geometry>, Fault> {
    let mut arena = Arena::default();
    let parameters = lend_map(parameters, &mut arena);
    let mut view = GeometryView { kind: u32::MAX, ..empty_geometry() };
    // SAFETY: the table's own function with what the boundary's rules demand.
    call(|| unsafe { make(table.user, parameters, &raw mut view) })?;
    if view.kind == u32::MAX {
        return Err(Fault::bad("what make made", "nothing", "a geometry with a kind"));
    }
    // A plugin need not set it; the host gave this many bytes.
    view.size = empty_geometry().size;
    // SAFETY: the plugin answers for what it says.
    unsafe { decode_geometry(&view, Passing::Given, plugin) }
}
