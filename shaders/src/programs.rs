//! Programs of shaders, parsed once: a shader without a source is the built-in one of its name.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use volact_core::{ActionError, ShaderEntry, resolve::ResolvedShape};

use crate::{Program, builtin};

/// What an action has parsed.
#[derive(Debug)]
pub struct Programs {
    action: &'static str,
    /// By the address of an entry, which it holds so that no other has it.
    known: Mutex<BTreeMap<usize, (Arc<ShaderEntry>, Program)>>,
}

impl Programs {
    /// None yet; `action` is whose errors are told.
    pub fn new(action: &'static str) -> Self {
        Self { action, known: Mutex::default() }
    }

    /// The program of a shape's shader.
    ///
    /// # Errors
    /// If the shader has no source and is none of those built in, or its source is wrong.
    pub fn of(&self, shape: &ResolvedShape) -> Result<Program, ActionError> {
        let key = Arc::as_ptr(&shape.shader) as usize;
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, program)) = known().get(&key) {
            return Ok(program.clone());
        }
        let program = self.parse(shape)?;
        known().insert(key, (Arc::clone(&shape.shader), program.clone()));
        Ok(program)
    }

    fn parse(&self, shape: &ResolvedShape) -> Result<Program, ActionError> {
        let name = &shape.shader.declaration.name;
        let wrong = |error| ActionError::Shader { shape: shape.name.clone(), source: Box::new(error) };
        if shape.shader.source.is_some() {
            return Program::new(&shape.shader).map_err(wrong);
        }
        let shipped = builtin().unwrap_or_default().into_iter().find(|s| s.declaration.name == *name);
        match shipped {
            Some(entry) => Program::new(&entry).map_err(wrong),
            None => Err(ActionError::Unsupported {
                action: self.action.into(),
                shape: shape.name.clone(),
                what: format!("shader {name:?}, which has no source"),
                cure: "draw it with the action cpu, or give its source".into(),
            }),
        }
    }
}
