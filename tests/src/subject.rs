//! Who is tested: an action of a registry, with options of the user's choice.

use volact_core::{
    ActionError, Caps, Declaration, Options, ParameterValue, Registry, RenderAction, parameter::Kind,
    planner::knobs::word,
};

/// An action under test.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The action's name.
    pub action: String,
    /// Options that the user set; they win over what cases wish.
    pub options: Options,
    /// What it says of itself.
    pub declaration: Declaration,
    /// What it can do.
    pub caps: Caps,
}

impl Subject {
    /// Makes the action once, to see that it can be made and what it can do.
    ///
    /// # Errors
    /// If nobody registered it, options are wrong, or it cannot run here.
    pub fn new(registry: &Registry, action: &str, options: &Options) -> Result<Self, ActionError> {
        let made = registry.action(action, options)?;
        let known = registry.declarations().into_iter().find(|d| d.kind == Kind::Action && d.name == action);
        let declaration = known.unwrap_or_else(|| made.declaration()).clone();
        Ok(Self { action: action.into(), options: options.clone(), declaration, caps: made.caps() })
    }

    /// Name, options and device: `cpu/AVX-512`, `cpu unit=plain/plain`.
    pub fn label(&self) -> String {
        let options: String = self.options.iter().map(|(name, value)| format!(" {name}={}", word(value))).collect();
        let device = self.caps.device.split(',').next().unwrap_or("").trim();
        format!("{}{options}/{}", self.action, if device.is_empty() { "?" } else { device })
    }

    /// Whether the action declares an option.
    pub fn has(&self, option: &str) -> bool {
        self.declaration.parameter(option).is_some()
    }

    /// A fresh action with what the user set and those wishes that it declares and that fit.
    ///
    /// # Errors
    /// Those of the action.
    pub fn action(
        &self,
        registry: &Registry,
        wishes: &[(String, ParameterValue)],
    ) -> Result<Box<dyn RenderAction>, ActionError> {
        let mut options = self.options.clone();
        for (name, value) in wishes {
            let declared = self.declaration.parameter(name).is_some_and(|p| p.accept(value).is_ok());
            if declared && !options.contains_key(name) {
                options.insert(name.clone(), value.clone());
            }
        }
        registry.action(&self.action, &options)
    }
}
