//! The registry: names → factories with their declarations. Built-ins and plugins register alike.

use std::{collections::BTreeMap, fmt, path::Path, sync::Arc};

use thiserror::Error;

use crate::{
    ActionError, Context, Data, Declaration, Geometry, LoadError, LoadOptions, Loader, MeshData, Options,
    ParameterDecl, ParameterType, ParameterValue, Progress, RenderAction, ShaderEntry, ShaderText, Volume,
    action::Watch,
    checked::{self, CheckedAction},
    geometry::{self, GeometryError},
    loader::{self, Content, NoProgress},
    null::{self, NullAction},
    parameter::{Kind, ParameterMap},
    planner::{self, Actor, Goals, PlannedAction, Rates},
    shader::{self, RefusedShader, ShaderCatalog},
};

/// Makes an action from its options, which are checked and have their defaults filled in.
pub type ActionFactory = Arc<dyn Fn(&Context, &Options) -> Result<Box<dyn RenderAction>, ActionError> + Send + Sync>;

/// Makes a geometry from its parameters, which are checked and have their defaults filled in.
pub type GeometryFactory = Arc<dyn Fn(&ParameterMap) -> Result<Arc<dyn Geometry>, GeometryError> + Send + Sync>;

/// Why something cannot be registered.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum RegisterError {
    /// The name is taken.
    #[error("{kind} {name:?} is registered already (version {version})")]
    Taken {
        /// What it is.
        kind: &'static str,
        /// The name.
        name: String,
        /// The version that is there.
        version: String,
    },
    /// The name cannot be used.
    #[error("{kind} name is {name:?}, wanted lower-case letters, digits, '_' and '-', starting with a letter")]
    Name {
        /// What it is.
        kind: &'static str,
        /// The name.
        name: String,
    },
}

/// Says what is wrong with a shader that comes from elsewhere, its source among it.
pub type ShaderCheck = Arc<dyn Fn(&ShaderEntry) -> Result<(), String> + Send + Sync>;

/// All that is known by name.
#[derive(Clone, Default)]
pub struct Registry {
    actions: BTreeMap<String, (Declaration, ActionFactory)>,
    geometries: BTreeMap<String, (Declaration, GeometryFactory)>,
    loaders: Vec<Arc<dyn Loader>>,
    shaders: ShaderCatalog,
    origins: BTreeMap<(Kind, String), String>,
    progress: Watch,
    rates: Rates,
    shader_check: Option<ShaderCheck>,
}

impl Registry {
    /// A registry that knows nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// What this crate itself offers: the `null` and `checked` actions, the `block` geometry, and
    /// the declarations of the shaders.
    pub fn with_core() -> Self {
        let mut registry = Self::new();
        registry.register_core().expect("the names of an empty registry are free");
        registry
    }

    fn register_core(&mut self) -> Result<(), RegisterError> {
        self.add_action(null::declaration(), Arc::new(|context, _| Ok(Box::new(NullAction::new(context)))))?;
        // `checked` and `planned` are made by `action`, which can look up what they wrap.
        self.add_action(planner::declaration(), Arc::new(|context, _| Ok(Box::new(NullAction::new(context)))))?;
        self.add_action(checked::declaration(), Arc::new(|context, _| Ok(Box::new(NullAction::new(context)))))?;
        for (declaration, factory) in geometry::builtin() {
            self.add_geometry(declaration, factory)?;
        }
        shader::builtin().into_iter().try_for_each(|entry| self.add_shader(entry))
    }

    /// Registers an action.
    ///
    /// # Errors
    /// If the name is taken or cannot be used; so for the other kinds.
    pub fn add_action(&mut self, declaration: Declaration, factory: ActionFactory) -> Result<(), RegisterError> {
        let taken = self.actions.get(&declaration.name).map(|(d, _)| d);
        check_name(&declaration, Kind::Action, taken)?;
        self.actions.insert(declaration.name.clone(), (declaration, factory));
        Ok(())
    }

    /// Registers a geometry.
    ///
    /// # Errors
    /// As [`add_action`](Self::add_action).
    pub fn add_geometry(&mut self, declaration: Declaration, factory: GeometryFactory) -> Result<(), RegisterError> {
        let taken = self.geometries.get(&declaration.name).map(|(d, _)| d);
        check_name(&declaration, Kind::Geometry, taken)?;
        self.geometries.insert(declaration.name.clone(), (declaration, factory));
        Ok(())
    }

    /// Registers a loader.
    ///
    /// # Errors
    /// As [`add_action`](Self::add_action).
    pub fn add_loader(&mut self, loader: Arc<dyn Loader>) -> Result<(), RegisterError> {
        let name = &loader.declaration().name;
        let taken = self.loaders.iter().map(|l| l.declaration()).find(|d| d.name == *name);
        check_name(loader.declaration(), Kind::Loader, taken)?;
        self.loaders.push(loader);
        Ok(())
    }

    /// Registers a shader.
    ///
    /// # Errors
    /// As [`add_action`](Self::add_action).
    pub fn add_shader(&mut self, entry: ShaderEntry) -> Result<(), RegisterError> {
        let taken = self.shaders.get(&entry.declaration.name).map(|s| &s.declaration);
        check_name(&entry.declaration, Kind::Shader, taken)?;
        self.shaders.insert(entry);
        Ok(())
    }

    /// Sets what shaders of plugins must pass. This crate reads no sources itself, and takes all.
    pub fn set_shader_check(&mut self, check: ShaderCheck) {
        self.shader_check = Some(check);
    }

    pub(crate) fn check_shader(&self, entry: &ShaderEntry) -> Result<(), String> {
        self.shader_check.as_ref().map_or(Ok(()), |check| check(entry))
    }

    /// Remembers why a shader that was found is not registered: whoever asks for it is told.
    pub fn refuse_shader(&mut self, name: &str, refused: RefusedShader) {
        self.shaders.refuse(name, refused);
    }

    /// Registers a shader with its source in WGSL.
    ///
    /// # Errors
    /// As [`add_action`](Self::add_action).
    pub fn add_shader_source(&mut self, entry: ShaderEntry, source: impl Into<String>) -> Result<(), RegisterError> {
        let file = format!("{}.wgsl", entry.declaration.name);
        self.add_shader(ShaderEntry { source: Some(Arc::new(ShaderText { file, text: source.into() })), ..entry })
    }

    /// The source in WGSL that a shader was registered with.
    pub fn shader_source(&self, name: &str) -> Option<&str> {
        Some(&self.shaders.get(name)?.source.as_ref()?.text)
    }

    /// The plugin that registered a name; `None` for built-ins and the application's own.
    pub fn origin(&self, kind: Kind, name: &str) -> Option<&str> {
        self.origins.get(&(kind, name.to_owned())).map(String::as_str)
    }

    pub(crate) fn set_origin(&mut self, kind: Kind, name: &str, plugin: &str) {
        self.origins.insert((kind, name.to_owned()), plugin.to_owned());
    }

    pub(crate) fn declaration(&self, kind: Kind, name: &str) -> Option<&Declaration> {
        self.declarations().into_iter().find(|d| d.kind == kind && d.name == name)
    }

    pub(crate) fn remove(&mut self, kind: Kind, name: &str) {
        match kind {
            Kind::Action => _ = self.actions.remove(name),
            Kind::Geometry => _ = self.geometries.remove(name),
            Kind::Loader => self.loaders.retain(|l| l.declaration().name != name),
            Kind::Shader => self.shaders.remove(name),
        }
        self.origins.remove(&(kind, name.to_owned()));
    }

    pub(crate) fn actions(&self) -> impl Iterator<Item = &(Declaration, ActionFactory)> {
        self.actions.values()
    }

    pub(crate) fn geometries(&self) -> impl Iterator<Item = &(Declaration, GeometryFactory)> {
        self.geometries.values()
    }

    /// All declarations, by kind and name.
    pub fn declarations(&self) -> Vec<&Declaration> {
        let actions = self.actions.values().map(|(d, _)| d);
        let shaders = self.shaders.iter().map(|s| &s.declaration);
        let geometries = self.geometries.values().map(|(d, _)| d);
        let loaders = self.loaders.iter().map(|l| l.declaration());
        let mut all: Vec<_> = actions.chain(shaders).chain(geometries).chain(loaders).collect();
        all.sort_by(|a, b| (a.kind, &a.name).cmp(&(b.kind, &b.name)));
        all
    }

    /// The shaders.
    pub fn shaders(&self) -> &ShaderCatalog {
        &self.shaders
    }

    /// The loaders.
    pub fn loaders(&self) -> &[Arc<dyn Loader>] {
        &self.loaders
    }

    /// The names of all actions.
    pub fn action_names(&self) -> impl Iterator<Item = &str> {
        self.actions.keys().map(String::as_str)
    }

    /// Sets who hears how far long preparations of actions are, for actions made from now on.
    pub fn set_progress(&mut self, progress: Watch) {
        self.progress = progress;
    }

    /// Makes an action.
    ///
    /// # Errors
    /// If nobody registered the name, options are wrong, or the action cannot run here.
    pub fn action(&self, name: &str, options: &Options) -> Result<Box<dyn RenderAction>, ActionError> {
        let (declaration, factory) = self.actions.get(name).ok_or_else(|| self.unknown_action(name))?;
        let context = self.context();
        if name == "planned" {
            return Ok(Box::new(self.planned(options)?));
        }
        if name == "checked" {
            let mut inner = options.clone();
            let decl = declaration.parameter("of").cloned().unwrap_or_else(|| {
                ParameterDecl::new("of", ParameterType::Choice, "the action to wrap").default("cpu")
            });
            let named = inner.remove("of").or(decl.default.clone()).map(|v| decl.accept(&v)).transpose();
            let named = named.map_err(|p| ActionError::Options { action: name.into(), problems: vec![p] })?;
            let Some(ParameterValue::Choice(of)) = named else { return Err(self.unknown_action("")) };
            if of == "checked" {
                return Err(self.unknown_action("checked of checked"));
            }
            return Ok(Box::new(CheckedAction::new(&context, self.action(&of, &inner)?)));
        }
        let options = declaration
            .resolve(options, |_| false)
            .map_err(|problems| ActionError::Options { action: name.into(), problems })?;
        log::debug!("action {name} {} with {options:?}", declaration.version);
        factory(&context, &options)
    }

    fn context(&self) -> Context {
        Context { shaders: self.shaders.clone(), progress: self.progress.clone() }
    }

    /// Makes the action that plans for those which its option `of` names, with the options that are not its own.
    /// Errors are taken from `cpu` where that is known, which interpolates and accumulates in f32 throughout.
    ///
    /// # Errors
    /// As [`Self::action`].
    pub fn planned(&self, options: &Options) -> Result<PlannedAction, ActionError> {
        let declaration = planner::declaration();
        let own = |name: &str| declaration.parameter(name).is_some();
        let (given, passed): (Options, Options) = options.clone().into_iter().partition(|(name, _)| own(name));
        let wrong = |problems| ActionError::Options { action: "planned".into(), problems };
        let resolved = declaration.resolve(&given, |_| false).map_err(wrong)?;
        let Some(ParameterValue::Choice(of)) = resolved.get("of") else { return Err(self.unknown_action("")) };
        let mut actors = Vec::new();
        for name in of.split_whitespace() {
            if name == "planned" {
                return Err(self.unknown_action("planned of planned"));
            }
            let (known, _) = self.actions.get(name).ok_or_else(|| self.unknown_action(name))?;
            // An option is for those who have it; one that nobody has is told by the first.
            let anybody = |option: &str| {
                let has = |n: &str| self.actions.get(n).is_some_and(|(d, _)| d.parameter(option).is_some());
                of.split_whitespace().any(has)
            };
            let theirs = |(option, _): &(String, ParameterValue)| known.parameter(option).is_some() || !anybody(option);
            let theirs: Options = passed.clone().into_iter().filter(theirs).collect();
            actors.push(Actor::new(name, self.action(name, &theirs)?, theirs));
        }
        if actors.is_empty() {
            return Err(self.unknown_action(of));
        }
        PlannedAction::new(&self.context(), (actors, self.truth()), given, self.rates.clone())
    }

    /// Makes an action that keeps goals: the one of this name, planned for. Without goals it is [`Self::action`].
    ///
    /// # Errors
    /// As [`Self::action`].
    pub fn action_for(
        &self,
        name: &str,
        options: &Options,
        goals: &Goals,
    ) -> Result<Box<dyn RenderAction>, ActionError> {
        match (*goals == Goals::default(), name) {
            (true, _) => self.action(name, options),
            (false, "planned") => self.action(name, &goals.above(options)),
            (false, _) => {
                let actor = Actor::new(name, self.action(name, options)?, options.clone());
                Ok(Box::new(self.plan_for(vec![actor], goals)?))
            }
        }
    }

    /// Plans for actions that are made already, with their options, to goals.
    ///
    /// # Errors
    /// None that goals of this type can have.
    pub fn plan_for(&self, actors: Vec<Actor>, goals: &Goals) -> Result<PlannedAction, ActionError> {
        PlannedAction::new(&self.context(), (actors, self.truth()), goals.options(), self.rates.clone())
    }

    /// Who draws what errors are taken from.
    fn truth(&self) -> Option<Actor> {
        let action = self.action("cpu", &Options::new()).ok()?;
        Some(Actor::new("cpu", action, Options::new()))
    }

    /// Sets how fast actions are on this machine, for plans made from now on.
    pub fn set_rates(&mut self, rates: Rates) {
        self.rates = rates;
    }

    /// Makes a geometry.
    ///
    /// # Errors
    /// If nobody registered the name, or parameters are wrong.
    pub fn geometry(&self, name: &str, parameters: &ParameterMap) -> Result<Arc<dyn Geometry>, GeometryError> {
        let invalid = |what: String, found: String, wanted: String| GeometryError::Invalid {
            geometry: name.into(),
            what,
            found,
            wanted,
        };
        let Some((declaration, factory)) = self.geometries.get(name) else {
            let known: Vec<_> = self.geometries.keys().map(String::as_str).collect();
            let hint = crate::names::hint(name, known.iter().copied());
            return Err(invalid("name".into(), "unknown".into(), format!("one of {}{hint}", known.join(", "))));
        };
        let parameters = declaration.resolve(parameters, |_| false).map_err(|problems| {
            invalid("description".into(), "wrong".into(), format!("no problems: {}", shader::join(&problems)))
        })?;
        factory(&parameters)
    }

    /// Reads a volume: the loader is chosen by content before extension.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or no loader knows it.
    pub fn load(&self, path: impl AsRef<Path>) -> Result<Volume, LoadError> {
        self.load_with(path, None, &LoadOptions::new(), &NoProgress)
    }

    /// Reads a volume with a named loader, options and progress.
    ///
    /// # Errors
    /// As [`load`](Self::load), and if no loader has that name or options are wrong.
    pub fn load_with(
        &self,
        path: impl AsRef<Path>,
        loader: Option<&str>,
        options: &LoadOptions,
        progress: &dyn Progress,
    ) -> Result<Volume, LoadError> {
        let path = path.as_ref();
        let loader = match loader {
            Some(name) => self.loader(name)?,
            None => loader::choose(&self.loaders, path)?,
        };
        log::debug!("{}: read by loader {}", path.display(), loader.declaration().name);
        loader::load(loader.as_ref(), path, options, progress)
    }

    /// Reads a mesh or surface: the loader is chosen by content before extension.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, no loader knows it, or it holds a volume.
    pub fn load_mesh(&self, path: impl AsRef<Path>) -> Result<MeshData, LoadError> {
        let path = path.as_ref();
        let loader = loader::choose(&self.loaders, path)?;
        loader::load_mesh(loader.as_ref(), path, &LoadOptions::new(), &NoProgress)
    }

    /// Reads whatever a file holds, with a named loader or the one that is surest of it.
    ///
    /// # Errors
    /// As [`load_with`](Self::load_with) and [`load_mesh`](Self::load_mesh).
    pub fn load_any(
        &self,
        path: impl AsRef<Path>,
        loader: Option<&str>,
        options: &LoadOptions,
        progress: &dyn Progress,
    ) -> Result<Data, LoadError> {
        let path = path.as_ref();
        let loader = match loader {
            Some(name) => self.loader(name)?,
            None => loader::choose(&self.loaders, path)?,
        };
        log::debug!("{}: read by loader {}", path.display(), loader.declaration().name);
        match loader.content() {
            Content::Volume => loader::load(loader.as_ref(), path, options, progress).map(Data::Volume),
            Content::Mesh => loader::load_mesh(loader.as_ref(), path, options, progress).map(Data::Mesh),
        }
    }

    fn loader(&self, name: &str) -> Result<&Arc<dyn Loader>, LoadError> {
        let names: Vec<_> = self.loaders.iter().map(|l| l.declaration().name.as_str()).collect();
        self.loaders.iter().find(|l| l.declaration().name == name).ok_or_else(|| LoadError::UnknownLoader {
            name: name.into(),
            hint: crate::names::hint(name, names.iter().copied()),
            known: names.join(", "),
        })
    }

    fn unknown_action(&self, name: &str) -> ActionError {
        let known: Vec<_> = self.action_names().collect();
        let hint = crate::names::hint(name, known.iter().copied());
        ActionError::UnknownAction { name: name.into(), hint, known: known.join(", ") }
    }
}

impl fmt::Debug for Registry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.declarations().iter().map(|d| (d.kind.name(), &d.name))).finish()
    }
}

fn check_name(declaration: &Declaration, kind: Kind, taken: Option<&Declaration>) -> Result<(), RegisterError> {
    let name = declaration.name.clone();
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(allowed) {
        return Err(RegisterError::Name { kind: kind.name(), name });
    }
    match taken {
        Some(there) => Err(RegisterError::Taken { kind: kind.name(), name, version: there.version.clone() }),
        None => Ok(()),
    }
}
