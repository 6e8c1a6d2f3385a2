//! A plugin's render action as core's own trait.

use std::{collections::BTreeSet, ffi::c_void, sync::Arc};

use super::{call, needed};
use crate::{
    ActionError, Caps, Context, Declaration, Frame, FrameDesc, Options, ParameterValue, RenderAction, Severity,
    ShaderText, Shape,
    action::Watch,
    lifecycle::Lifecycle,
    parameter::ParameterProblem,
    plugin::{
        abi::{ActionContext, ActionTable, CapsView, FrameView, KnownShader, Parameter, ShapeView, Text},
        arena::{Arena, NO_TEXT, flag, list_of, string_of},
        declare::{compositing_code, compositings_of, lend_declaration},
        picture::Collector,
        shape::{lend_frame, lend_shape},
        status::{Fault, PluginError},
        value::{lend_map, lend_value},
    },
    registry::ActionFactory,
};

/// The functions of an action that must be there.
#[derive(Clone, Copy)]
struct Functions {
    destroy: unsafe extern "C" fn(*mut c_void),
    caps: unsafe extern "C" fn(*mut c_void, *mut CapsView) -> i32,
    begin_draw: unsafe extern "C" fn(*mut c_void, *const FrameView, *const *const ShapeView, u64) -> i32,
    draw: unsafe extern "C" fn(*mut c_void, u64) -> i32,
    end_draw: unsafe extern "C" fn(*mut c_void, *const crate::plugin::abi::FrameSink) -> i32,
}

/// What makes actions of a plugin's table.
pub(super) fn factory(
    plugin: &str,
    table: &'static ActionTable,
    declaration: &Declaration,
) -> Result<ActionFactory, Fault> {
    let of = format!("action {:?}", declaration.name);
    needed(table.create, &of, "create")?;
    let functions = Functions {
        destroy: needed(table.destroy, &of, "destroy")?,
        caps: needed(table.caps, &of, "caps")?,
        begin_draw: needed(table.begin_draw, &of, "begin_draw")?,
        draw: needed(table.draw, &of, "draw")?,
        end_draw: needed(table.end_draw, &of, "end_draw")?,
    };
    let (plugin, declaration, table) = (plugin.to_owned(), declaration.clone(), Shown(table));
    Ok(Arc::new(move |context, options| {
        let made = PluginAction::new(&plugin, table.get(), functions, &declaration, context, options);
        Ok(Box::new(made.map_err(|fault| fault.of(&plugin))?))
    }))
}

/// A table that lives as long as the process and is only read.
pub(super) struct Shown<T: 'static>(pub &'static T);

impl<T> Clone for Shown<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Shown<T> {}

impl<T> Shown<T> {
    pub fn get(&self) -> &'static T {
        self.0
    }
}

// SAFETY: the boundary's rules: tables are not written to, and their `user`s can be used from any thread.
unsafe impl<T> Send for Shown<T> {}
// SAFETY: as for Send.
unsafe impl<T> Sync for Shown<T> {}

struct PluginAction {
    plugin: String,
    table: Shown<ActionTable>,
    functions: Functions,
    declaration: Declaration,
    lifecycle: Lifecycle,
    handle: Handle,
    /// What the frame that is open points to.
    frame: Option<Arena>,
    /// Warnings that the process-wide handler has had.
    said: BTreeSet<String>,
    /// What the context points to, for as long as the action lives.
    _kept: Arena,
}

struct Handle(*mut c_void);

// SAFETY: an action may move from thread to thread, and is used by one at a time.
unsafe impl Send for Handle {}

unsafe extern "C" fn hear(user: *mut c_void, what: Text, done: u64, total: u64) {
    let heard = super::guarded(|| {
        // SAFETY: `user` is the watch that the action keeps, and the text is valid during the call.
        let (watch, what) = unsafe { (&*user.cast::<Watch>(), string_of(what, "what is done")?) };
        watch.report(&what, done, total);
        Ok(())
    });
    if let Err(fault) = heard {
        log::warn!("a plugin's progress cannot be told: {fault}");
    }
}

impl PluginAction {
    fn new(
        plugin: &str,
        table: &'static ActionTable,
        functions: Functions,
        declaration: &Declaration,
        context: &Context,
        options: &Options,
    ) -> Result<Self, Fault> {
        let create = needed(table.create, "the action", "create")?;
        let mut kept = Arena::default();
        let mut shaders = Vec::new();
        for entry in context.shaders.iter() {
            let declaration = lend_declaration(&entry.declaration, &mut kept);
            let text = |of: fn(&ShaderText) -> &str, kept: &mut Arena| {
                entry.source.as_ref().map_or(NO_TEXT, |source| kept.text(of(source)))
            };
            let (file, source) = (text(|s| &s.file, &mut kept), text(|s| &s.text, &mut kept));
            let compositing = compositing_code(entry.compositing);
            shaders.push(KnownShader { declaration, compositing, reserved: 0, file, source });
        }
        let (shaders, shader_count) = kept.list(shaders);
        let user = kept.one(context.progress.clone()).cast_mut().cast();
        let view = kept.one(ActionContext {
            size: size_of::<ActionContext>() as u32,
            reserved: 0,
            shaders,
            shader_count,
            user,
            progress: Some(hear),
        });
        let mut arena = Arena::default();
        let options = lend_map(options, &mut arena);
        let mut handle = std::ptr::null_mut();
        // SAFETY: the table's own function with what the boundary's rules demand.
        call(|| unsafe { create(table.user, view, options, &raw mut handle) })?;
        if handle.is_null() {
            return Err(Fault::bad(format!("what create of action {:?} made", declaration.name), "null", "an action"));
        }
        Ok(Self {
            plugin: plugin.into(),
            table: Shown(table),
            functions,
            declaration: declaration.clone(),
            lifecycle: Lifecycle::new(context.clone()),
            handle: Handle(handle),
            frame: None,
            said: BTreeSet::new(),
            _kept: kept,
        })
    }

    fn read_caps(&self) -> Result<Caps, Fault> {
        let mut view = CapsView {
            size: size_of::<CapsView>() as u32,
            compositing: 0,
            overlap: 0,
            depth: 0,
            any_shader: 0,
            any_geometry: 0,
            shaders: std::ptr::null(),
            shader_count: 0,
            geometries: std::ptr::null(),
            geometry_count: 0,
            device: NO_TEXT,
            shader_sources: 0,
            reserved: 0,
        };
        // SAFETY: the action's own function and handle.
        call(|| unsafe { (self.functions.caps)(self.handle.0, &raw mut view) })?;
        let names = |data, count, what| {
            // SAFETY: the plugin answers for what it says, until its next call.
            let texts: &[Text] = unsafe { list_of(data, count, what) }?;
            // SAFETY: as above.
            texts.iter().map(|t| unsafe { string_of(*t, what) }).collect::<Result<Vec<_>, _>>()
        };
        let some =
            |any: u32, names: Vec<String>| Ok(if flag(any, "whether any will do")? { None } else { Some(names) });
        Ok(Caps {
            shaders: some(view.any_shader, names(view.shaders, view.shader_count, "shaders")?)?,
            sources: flag(view.shader_sources, "whether it draws shaders by their source")?,
            geometries: some(view.any_geometry, names(view.geometries, view.geometry_count, "geometries")?)?,
            compositing: compositings_of(view.compositing),
            overlap: flag(view.overlap, "whether shapes may overlap")?,
            depth: flag(view.depth, "whether frames carry depth")?,
            // SAFETY: as above.
            device: unsafe { string_of(view.device, "device") }?,
        })
    }
}

fn by(plugin: &str) -> impl Fn(Fault) -> ActionError + use<'_> {
    move |fault| ActionError::Plugin(fault.of(plugin))
}

impl RenderAction for PluginAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        self.read_caps().unwrap_or_else(|fault| {
            let error: PluginError = fault.of(&self.plugin);
            log::error!("what action {} can do is not known: {error}", self.declaration.name);
            Caps::default()
        })
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        let Self { plugin, table, handle, lifecycle, .. } = self;
        let manage = |resolved: &crate::resolve::ResolvedShape| {
            let Some(manage) = table.get().manage else { return Ok(()) };
            let mut arena = Arena::default();
            let view = lend_shape(resolved, &mut arena);
            // SAFETY: the action's own function and handle.
            call(|| unsafe { manage(handle.0, &raw const view) }).map_err(by(plugin))
        };
        lifecycle.manage(shape, manage).map(|_| ())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)?;
        let Some(unmanage) = self.table.get().unmanage else { return Ok(()) };
        // SAFETY: the action's own function and handle.
        call(|| unsafe { unmanage(self.handle.0, shape.id()) }).map_err(by(&self.plugin))
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        let mut arena = Arena::default();
        let open = self.lifecycle.begin(frame, |_| Ok(()))?;
        let views: Vec<_> = open.shapes.values().map(|shape| lend_shape(shape, &mut arena)).collect();
        let shapes: Vec<*const ShapeView> = views.into_iter().map(|view| arena.one(view)).collect();
        let (shapes, count) = arena.list(shapes);
        let begun = lend_frame(frame, &mut arena).and_then(|view| {
            let view = arena.one(view);
            // SAFETY: the action's own function and handle; the arena lives until `end_draw`.
            call(|| unsafe { (self.functions.begin_draw)(self.handle.0, view, shapes, count) })
        });
        self.frame = Some(arena);
        begun.map_err(|fault| {
            self.lifecycle.abandon();
            by(&self.plugin)(fault)
        })
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)?;
        // SAFETY: the action's own function and handle.
        call(|| unsafe { (self.functions.draw)(self.handle.0, shape.id()) }).map_err(by(&self.plugin))
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let mut collector = Collector::new(&open.desc);
        let sink = collector.sink();
        // SAFETY: the action's own function and handle; the collector is used by the sink only.
        let drawn = call(|| unsafe { (self.functions.end_draw)(self.handle.0, &raw const sink) });
        self.frame = None;
        drawn.map_err(by(&self.plugin))?;
        let mut frame = collector.finish().map_err(by(&self.plugin))?;
        // What the host knows about the shapes comes first, unless the plugin says it, too.
        let mut warnings: Vec<_> = open.drawn_shapes().flat_map(|s| s.warnings.clone()).collect();
        warnings.retain(|w| !frame.warnings.contains(w));
        warnings.append(&mut frame.warnings);
        frame.warnings = warnings;
        for warning in frame.warnings.iter().filter(|w| w.severity == Severity::Warning) {
            if self.said.insert(warning.to_string()) {
                warning.emit();
            }
        }
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.lifecycle.outside("set_option")?;
        let wrong =
            |problems: Vec<ParameterProblem>| ActionError::Options { action: self.declaration.name.clone(), problems };
        let given = Options::from([(name.to_owned(), value)]);
        let Some(declared) = self.declaration.parameter(name) else {
            let problems = self.declaration.resolve(&given, |_| false).err().unwrap_or_default();
            return Err(wrong(problems));
        };
        let value = declared.accept(&given[name]).map_err(|problem| wrong(vec![problem]))?;
        let of = format!("action {:?}", self.declaration.name);
        let set = needed(self.table.get().set_option, &of, "set_option").map_err(by(&self.plugin))?;
        let mut arena = Arena::default();
        let option = Parameter { name: arena.text(name), value: lend_value(&value, &mut arena) };
        // SAFETY: the action's own function and handle.
        call(|| unsafe { set(self.handle.0, &raw const option) }).map_err(by(&self.plugin))
    }
}

impl Drop for PluginAction {
    fn drop(&mut self) {
        let _state = crate::plugin::FloatState::save();
        // SAFETY: the action's own function and handle, which nobody uses after.
        unsafe { (self.functions.destroy)(self.handle.0) };
    }
}
