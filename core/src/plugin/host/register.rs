//! Loads plugins into a registry: each wholly or not at all.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use super::{
    Registration, Search, Wanted, guarded,
    library::entry_of,
    negotiate,
    offer::{Item, Offer},
};
use crate::{
    Registry,
    plugin::{
        abi::Entry,
        status::{Code, Fault, PluginError},
    },
};

/// A plugin that is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// One line that says what it is.
    pub description: String,
    /// Its file; `None` where it is linked statically.
    pub path: Option<PathBuf>,
    /// What it registered.
    pub registered: Vec<Registration>,
    /// What it offers but the config gives to another plugin.
    pub passed_over: Vec<Registration>,
}

/// What came of a plugin that was wanted.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its name.
    pub name: String,
    /// What it is, or why it is not there.
    pub result: Result<Loaded, PluginError>,
}

/// Loads all plugins wanted, each from the first folder that has it. One that cannot be loaded
/// leaves the registry as it was.
///
/// # Safety
/// Loading a library runs its code. The user trusts every plugin wanted: a name must come from the
/// user or a config, never from a scene or a data file.
pub unsafe fn load(search: &Search, registry: &mut Registry) -> Vec<Outcome> {
    let mut all = Vec::new();
    for wanted in &search.wanted {
        // SAFETY: as promised by the caller.
        let result = unsafe { load_one(search, wanted, registry) };
        match &result {
            Ok(loaded) => log::info!("plugin {} {} is loaded", loaded.name, loaded.version),
            Err(error) => log::debug!("{error}"),
        }
        all.push(Outcome { name: wanted.name.clone(), result });
    }
    // A name that the config gives to a plugin must be one that it has.
    for (name, plugin) in &search.names {
        let Some(outcome) = all.iter().find(|o| plain(&o.name) == plain(plugin)) else {
            log::warn!("the config gives {name:?} to {plugin:?}, which is none of its plugins");
            continue;
        };
        let has = |loaded: &Loaded| loaded.registered.iter().any(|r| r.name == *name);
        if outcome.result.as_ref().is_ok_and(|loaded| !has(loaded)) {
            log::warn!("the config gives {name:?} to plugin {plugin:?}, which does not register it");
        }
    }
    all
}

/// A plugin's name as its library and its crate have it.
fn plain(name: &str) -> String {
    name.replace('-', "_")
}

/// # Safety
/// As [`load`].
unsafe fn load_one(search: &Search, wanted: &Wanted, registry: &mut Registry) -> Result<Loaded, PluginError> {
    let load = || {
        let path = search.find(&wanted.name)?;
        // SAFETY: as promised by the caller.
        let entry = unsafe { entry_of(&path, wanted) }?;
        // SAFETY: as promised by the caller.
        let offer = unsafe { offer_of(entry) }?;
        if plain(&offer.name) != plain(&wanted.name) {
            let message = format!("calls itself {:?}, wanted the name of its library", offer.name);
            return Err(Fault::new(Code::BadName, message));
        }
        take(offer, Some(&path), &search.names, registry)
    };
    guarded(load).map_err(|fault| fault.of(&wanted.name))
}

/// # Safety
/// As [`load`].
unsafe fn offer_of(entry: Entry) -> Result<Offer, Fault> {
    // SAFETY: as promised by the caller.
    let table = unsafe { negotiate(entry) }?;
    // SAFETY: as promised by the caller.
    unsafe { Offer::read(table) }
}

/// Registers a plugin that is linked statically, through the same entry as one that is loaded.
///
/// # Safety
/// `entry` keeps the boundary's rules, as every entry that the macro `export!` makes does.
///
/// # Errors
/// If versions do not go together, a table is damaged or a name is taken; nothing is registered then.
pub unsafe fn link(entry: Entry, registry: &mut Registry) -> Result<Loaded, PluginError> {
    // SAFETY: as promised by the caller.
    let offer = guarded(|| unsafe { offer_of(entry) }).map_err(|fault| fault.of("linked"))?;
    let name = offer.name.clone();
    guarded(|| take(offer, None, &BTreeMap::new(), registry)).map_err(|fault| fault.of(&name))
}

/// Registers what a plugin offers, all of it or nothing.
fn take(
    offer: Offer,
    path: Option<&Path>,
    names: &BTreeMap<String, String>,
    registry: &mut Registry,
) -> Result<Loaded, Fault> {
    let Offer { name: plugin, version, description, items } = offer;
    let mut next = registry.clone();
    let (mut registered, mut passed_over, mut claims) = (Vec::new(), Vec::new(), Vec::new());
    for (declaration, item) in items {
        let (kind, name) = (declaration.kind, declaration.name.clone());
        let about = Registration { kind, name: name.clone(), version: declaration.version.clone() };
        let chosen = names.get(&name);
        if chosen.is_some_and(|chosen| plain(chosen) != plain(&plugin)) {
            passed_over.push(about);
            continue;
        }
        if next.declaration(kind, &name).is_some() {
            if chosen.is_none() {
                claims.push(about);
                continue;
            }
            next.remove(kind, &name);
        }
        let added = match item {
            Item::Action(factory) => next.add_action(declaration, factory),
            Item::Shader(entry) => {
                let wrong = |why| Fault::new(Code::BadValue, format!("shader {name:?} cannot be used: {why}"));
                next.check_shader(&entry).map_err(wrong)?;
                next.add_shader(entry)
            }
            Item::Geometry(factory) => next.add_geometry(declaration, factory),
            Item::Loader(loader) => next.add_loader(loader),
        };
        added.map_err(|error| Fault::new(Code::BadName, error.to_string()))?;
        next.set_origin(kind, &name, &plugin);
        registered.push(about);
    }
    if !claims.is_empty() {
        return Err(claimed(&next, &claims, &plugin));
    }
    *registry = next;
    Ok(Loaded { name: plugin, version, description, path: path.map(Path::to_owned), registered, passed_over })
}

/// All names that a plugin claims and that others have, with the words for the config.
fn claimed(registry: &Registry, claims: &[Registration], plugin: &str) -> Fault {
    let mut by_other: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for r in claims {
        let other = registry.origin(r.kind, &r.name).map_or("what is built in".into(), |o| format!("plugin {o:?}"));
        by_other.entry(other).or_default().push(format!("{} {:?}", r.kind.name(), r.name));
    }
    let claim = |(other, list): (&String, &Vec<String>)| {
        let verb = if list.len() > 1 { "are" } else { "is" };
        format!("{} {verb} claimed by plugin {plugin:?} and by {other}", list.join(", "))
    };
    let all: Vec<_> = by_other.iter().map(claim).collect();
    let names: BTreeSet<_> = claims.iter().map(|r| &r.name).collect();
    let cure: Vec<_> = names.iter().map(|name| format!("{name:?}: {plugin:?}")).collect();
    let message = format!("{}; say which in the config: names: {{{}}}", all.join("; "), cure.join(", "));
    Fault::new(Code::BadName, message)
}
