//! Which way a shape's shader is drawn: by a kernel of its own, or by evaluating its source.
//!
//! A source that does what a built-in shader does is drawn by that one's kernel, whatever it is
//! called. Without recognition it is the other way round: built-in shaders are evaluated from the
//! sources that they come with.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use volact_core::{ShaderEntry, resolve::ResolvedShape, shader};
use volact_shaders::{Program, recognise};

/// What was found of shaders.
#[derive(Debug, Default)]
pub struct Chosen {
    /// By the address of an entry, which it holds so that no other has it, and by recognition.
    known: Mutex<BTreeMap<(usize, bool), Known>>,
}

#[derive(Clone, Debug)]
struct Known {
    _entry: Arc<ShaderEntry>,
    /// What to draw in its place.
    instead: Option<Arc<ShaderEntry>>,
}

impl Chosen {
    /// A shape with the shader that it is to be drawn by: one with a source is evaluated.
    pub fn of(&self, shape: &ResolvedShape, recognise: bool) -> ResolvedShape {
        let mut drawn = shape.clone();
        self.apply(&mut drawn, recognise);
        drawn
    }

    /// The same in place.
    pub fn apply(&self, shape: &mut ResolvedShape, recognise: bool) {
        let key = (Arc::as_ptr(&shape.shader) as usize, recognise);
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().get(&key).cloned();
        let Known { instead, .. } = found.unwrap_or_else(|| {
            let made = Known { _entry: Arc::clone(&shape.shader), instead: instead(&shape.shader, recognise) };
            known().entry(key).or_insert(made).clone()
        });
        // A source may do without what a kernel needs.
        let complete = |entry: &Arc<ShaderEntry>| {
            let needed = entry.declaration.parameters.iter().filter(|p| p.required);
            needed.map(|p| &p.name).all(|name| shape.parameters.contains_key(name))
        };
        if let Some(entry) = instead.filter(complete) {
            shape.shader = entry;
        }
    }
}

/// What stands in for a shader.
fn instead(entry: &ShaderEntry, recognised: bool) -> Option<Arc<ShaderEntry>> {
    match (&entry.source, recognised) {
        (Some(_), true) => {
            // What is wrong with it is told when it is compiled.
            let native = recognise(&Program::new(entry).ok()?, true)?;
            shader::builtin().into_iter().find(|e| e.declaration.name == native.name()).map(Arc::new)
        }
        (None, false) => {
            let name = &entry.declaration.name;
            volact_shaders::builtin().ok()?.into_iter().find(|e| e.declaration.name == *name).map(Arc::new)
        }
        _ => None,
    }
}
