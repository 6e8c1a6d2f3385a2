//! Render actions in Rust behind the table that the host calls.

use std::{collections::BTreeMap, ffi::c_void, sync::Arc};

use super::{drop_quietly, given, place, user};
use crate::{
    ActionError, Appearance, Caps, Context, Declaration, FrameDesc, Options, RenderAction, ShaderEntry, ShaderText,
    Shape,
    action::Watch,
    parameter::Kind,
    plugin::{
        abi::{ActionContext, ActionTable, CapsView, FrameSink, FrameView, Parameter, Parameters, ShapeView, Text},
        arena::{Arena, list_of, string_of},
        declare::{compositing_bits, compositing_of, decode_declaration, lend_declaration},
        geometry::Named,
        picture::show,
        services::answer,
        shape::{SeenShape, decode_frame, decode_shape},
        status::{Code, Fault, chain},
        value::{Identities, decode_map, decode_named},
    },
    registry::ActionFactory,
    shader::ShaderCatalog,
    warning::quietly,
};

/// The table of an action.
pub(super) fn table(declaration: &Declaration, factory: &ActionFactory, arena: &mut Arena) -> ActionTable {
    ActionTable {
        size: size_of::<ActionTable>() as u32,
        reserved: 0,
        declaration: lend_declaration(declaration, arena),
        user: arena.one(Arc::clone(factory)).cast_mut().cast(),
        create: Some(create),
        destroy: Some(destroy),
        caps: Some(caps),
        manage: Some(manage),
        unmanage: Some(unmanage),
        begin_draw: Some(begin_draw),
        draw: Some(draw),
        end_draw: Some(end_draw),
        set_option: Some(set_option),
    }
}

/// An action, and the shapes that it knows under the host's ids.
struct Instance {
    inner: Box<dyn RenderAction>,
    shapes: BTreeMap<u64, (Shape, u64)>,
    known: Identities,
    caps: Arena,
}

fn fault(error: ActionError) -> Fault {
    let code = match &error {
        ActionError::Unsupported { .. } => Code::Unsupported,
        ActionError::UnknownShader { .. } | ActionError::UnknownAction { .. } => Code::BadName,
        ActionError::Limit { .. } => Code::OutOfMemory,
        ActionError::Backend { .. } => Code::Failed,
        ActionError::Plugin(inner) => inner.code,
        ActionError::NotManaged { .. }
        | ActionError::NotDrawing { .. }
        | ActionError::Drawing { .. }
        | ActionError::ManagedLate { .. }
        | ActionError::ChangedLate { .. }
        | ActionError::DrawnTwice { .. } => Code::BadState,
        _ => Code::BadValue,
    };
    Fault::new(code, chain(&error))
}

/// # Safety
/// `action` is what `create` made, and nobody else uses it meanwhile.
unsafe fn instance<'a>(action: *mut c_void) -> Result<&'a mut Instance, Fault> {
    // SAFETY: as promised by the caller.
    unsafe { place(action.cast(), "action") }
}

struct Hook(*mut c_void, unsafe extern "C" fn(*mut c_void, Text, u64, u64));

// SAFETY: the host says that its progress is heard from any thread.
unsafe impl Send for Hook {}
// SAFETY: as for Send.
unsafe impl Sync for Hook {}

impl Hook {
    fn tell(&self, what: &str, done: u64, total: u64) {
        let what = Text { data: what.as_ptr(), length: what.len() as u64 };
        // SAFETY: the host keeps both as long as the action.
        unsafe { (self.1)(self.0, what, done, total) };
    }
}

/// # Safety
/// What the view says is true.
unsafe fn context_of(view: &ActionContext) -> Result<Context, Fault> {
    let mut shaders = ShaderCatalog::default();
    // SAFETY: as promised by the caller.
    for known in unsafe { list_of(view.shaders, view.shader_count, "shaders") }? {
        // SAFETY: as promised by the caller.
        let declaration = unsafe { decode_declaration(&known.declaration, Kind::Shader) }?;
        // SAFETY: as promised by the caller.
        let [file, text] = unsafe { [string_of(known.file, "file of a shader")?, string_of(known.source, "source")?] };
        let source = (!text.is_empty()).then(|| Arc::new(ShaderText { file, text }));
        shaders.insert(ShaderEntry { declaration, compositing: compositing_of(known.compositing)?, source });
    }
    let hook = view.progress.map(|progress| Hook(view.user, progress));
    let progress =
        hook.map_or_else(Watch::default, |hook| Watch::new(move |what, done, total| hook.tell(what, done, total)));
    Ok(Context { shaders, progress })
}

unsafe extern "C" fn create(
    at: *mut c_void,
    context: *const ActionContext,
    options: Parameters,
    action: *mut *mut c_void,
) -> i32 {
    answer(|| {
        // SAFETY: the host gives what the table was made with, and valid arguments.
        let (factory, view, action) =
            unsafe { (user::<ActionFactory>(at), given(context, "context")?, place(action, "action")?) };
        // SAFETY: as above.
        let (context, options): (Context, Options) =
            unsafe { (context_of(view)?, decode_map(options, &mut Identities::default())?) };
        let inner = factory(&context, &options).map_err(fault)?;
        let made = Instance { inner, shapes: BTreeMap::new(), known: Identities::default(), caps: Arena::default() };
        *action = Box::into_raw(Box::new(made)).cast();
        Ok(())
    })
}

unsafe extern "C" fn destroy(action: *mut c_void) {
    answer(|| {
        if !action.is_null() {
            // SAFETY: `action` is what `create` made, and the host gives it up.
            drop_quietly(unsafe { Box::from_raw(action.cast::<Instance>()) }, "an action");
        }
        Ok(())
    });
}

unsafe extern "C" fn caps(action: *mut c_void, out: *mut CapsView) -> i32 {
    answer(|| {
        // SAFETY: the host gives an action of `create` and a place.
        let (instance, out) = unsafe { (instance(action)?, place(out, "caps")?) };
        let Caps { shaders, sources, geometries, compositing, overlap, depth, device } = instance.inner.caps();
        let mut arena = Arena::default();
        let mut list = |names: &Option<Vec<String>>| {
            let texts = names.iter().flatten().map(|name| arena.text(name)).collect();
            arena.list::<Text>(texts)
        };
        ((out.shaders, out.shader_count), (out.geometries, out.geometry_count)) = (list(&shaders), list(&geometries));
        (out.any_shader, out.any_geometry) = (u32::from(shaders.is_none()), u32::from(geometries.is_none()));
        (out.overlap, out.depth) = (u32::from(overlap), u32::from(depth));
        out.shader_sources = u32::from(sources);
        out.compositing = compositing_bits(&compositing);
        out.device = arena.text(&device);
        instance.caps = arena;
        Ok(())
    })
}

/// Brings a shape up to what the host shows.
fn update(shape: &Shape, seen: SeenShape) {
    let SeenShape { geometry, appearance, transform, clip, .. } = seen;
    if let Some(inner) = geometry {
        shape.set_geometry(Named { name: inner.name().to_owned(), inner });
    }
    let Appearance { shader, parameters } = appearance;
    let gone: Vec<_> = shape.state().parameters.into_keys().filter(|name| !parameters.contains_key(name)).collect();
    gone.iter().for_each(|name| _ = shape.remove_parameter(name));
    parameters.into_iter().for_each(|(name, value)| shape.set_parameter(name, value));
    shape.set_shader(shader);
    shape.set_transform(transform);
    shape.set_clip(clip);
}

/// A shape that was not known.
fn build(seen: SeenShape) -> Result<Shape, Fault> {
    let geometry = seen.geometry.clone();
    let geometry = geometry.ok_or_else(|| Fault::new(Code::BadState, "a shape without a geometry"))?;
    let shape = Shape::build(seen.name.clone(), geometry, seen.appearance.clone(), seen.transform);
    update(&shape, SeenShape { geometry: None, ..seen });
    Ok(shape)
}

unsafe extern "C" fn manage(action: *mut c_void, shape: *const ShapeView) -> i32 {
    answer(|| {
        // SAFETY: the host gives an action of `create` and a shape.
        let (instance, view) = unsafe { (instance(action)?, given(shape, "shape")?) };
        let have = instance.shapes.get(&view.id).map(|(_, version)| *version);
        // SAFETY: as above.
        let seen = unsafe { decode_shape(view, &mut instance.known, have) }?;
        let (id, version) = (seen.id, seen.geometry_version);
        let shape = match instance.shapes.get(&id) {
            Some((shape, _)) => {
                update(shape, seen);
                shape.clone()
            }
            None => build(seen)?,
        };
        instance.inner.manage(&shape).map_err(fault)?;
        instance.shapes.insert(id, (shape, version));
        Ok(())
    })
}

unsafe extern "C" fn unmanage(action: *mut c_void, id: u64) -> i32 {
    answer(|| {
        // SAFETY: the host gives an action of `create`.
        let instance = unsafe { instance(action) }?;
        let (shape, _) = instance.shapes.remove(&id).ok_or_else(|| unknown(id))?;
        instance.inner.unmanage(&shape).map_err(fault)
    })
}

fn unknown(id: u64) -> Fault {
    Fault::new(Code::BadState, format!("shape {id} is not managed"))
}

unsafe extern "C" fn begin_draw(
    action: *mut c_void,
    frame: *const FrameView,
    shapes: *const *const ShapeView,
    shape_count: u64,
) -> i32 {
    answer(|| {
        // SAFETY: the host gives an action of `create` and a frame.
        let (instance, frame) = unsafe { (instance(action)?, given(frame, "frame")?) };
        // SAFETY: as above.
        let desc: FrameDesc = unsafe { decode_frame(frame) }?;
        instance.known.begin();
        // SAFETY: as above.
        for view in unsafe { list_of(shapes, shape_count, "shapes") }? {
            // SAFETY: as above.
            let view = unsafe { given(*view, "shape") }?;
            let Some((shape, version)) = instance.shapes.get_mut(&view.id) else { return Err(unknown(view.id)) };
            // SAFETY: as above.
            let seen = unsafe { decode_shape(view, &mut instance.known, Some(*version)) }?;
            *version = seen.geometry_version;
            update(shape, seen);
        }
        instance.known.end();
        instance.inner.begin_draw(&desc).map_err(fault)
    })
}

unsafe extern "C" fn draw(action: *mut c_void, id: u64) -> i32 {
    answer(|| {
        // SAFETY: the host gives an action of `create`.
        let instance = unsafe { instance(action) }?;
        let (shape, _) = instance.shapes.get(&id).ok_or_else(|| unknown(id))?;
        instance.inner.draw(shape).map_err(fault)
    })
}

unsafe extern "C" fn end_draw(action: *mut c_void, sink: *const FrameSink) -> i32 {
    answer(|| {
        // SAFETY: the host gives an action of `create` and a sink.
        let (instance, sink) = unsafe { (instance(action)?, given(sink, "sink")?) };
        // The frame has its warnings, and the host hands them to the application's handler.
        let frame = quietly(|| instance.inner.end_draw()).map_err(fault)?;
        // SAFETY: as above.
        unsafe { show(frame, sink) }
    })
}

unsafe extern "C" fn set_option(action: *mut c_void, option: *const Parameter) -> i32 {
    answer(|| {
        // SAFETY: the host gives an action of `create` and an option.
        let (instance, option) = unsafe { (instance(action)?, given(option, "option")?) };
        // SAFETY: as above.
        let (name, value) = unsafe { decode_named(option, &mut Identities::default()) }?;
        instance.inner.set_option(&name, value).map_err(fault)
    })
}
