//! Render actions: what the host hands to one, and what comes back.

use std::ffi::c_void;

use super::{ArrayView, DeclarationView, GeometryView, Parameter, Parameters, Text};

/// A convex region between planes.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ClipRegionView {
    /// Unit normal and offset of each plane, four numbers; in front is `normal·p > offset`.
    pub planes: *const f64,
    /// How many.
    pub plane_count: u64,
    /// Whether what is in front of all planes is kept; else it is cut away.
    pub keep: u32,
    /// 0.
    pub reserved: u32,
}

/// A shape with everything looked up and checked.
#[repr(C)]
pub struct ShapeView {
    /// Bytes of this table.
    pub size: u32,
    /// How samples are put together: `COMPOSITE_…`.
    pub compositing: u32,
    /// What identifies it.
    pub id: u64,
    /// Its name in messages.
    pub name: Text,
    /// Where it is, in object space.
    pub geometry: *const GeometryView,
    /// Changes with the geometry.
    pub geometry_version: u64,
    /// The shader's name.
    pub shader: Text,
    /// The shader's parameters, checked against its declaration, defaults filled in.
    pub parameters: Parameters,
    /// Parameters that are kept for other shaders.
    pub unused: Parameters,
    /// Object to world: three columns of the matrix, then the translation.
    pub transform: [f64; 12],
    /// World to object.
    pub to_object: [f64; 12],
    /// Whether `block` holds: the geometry is a box.
    pub is_block: u32,
    /// 0.
    pub reserved: u32,
    /// The box to draw in object space: the geometry and the volume's geometry ROI; lowest corner,
    /// then highest.
    pub block: [f64; 6],
    /// What cuts it, in object space: what all regions keep.
    pub clip: *const ClipRegionView,
    /// See `clip`.
    pub clip_count: u64,
}

/// A camera as it was described.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct CameraView {
    /// 0: eye, target and up. 1: matrices.
    pub kind: u32,
    /// For kind 0: 0 perspective, 1 orthographic.
    pub projection: u32,
    /// For kind 1: near and far are 0 and 1 (0), or −1 and 1 (1).
    pub depth_range: u32,
    /// 0.
    pub reserved: u32,
    /// The eye.
    pub eye: [f64; 3],
    /// The point in the middle of the picture.
    pub target: [f64; 3],
    /// What points up.
    pub up: [f64; 3],
    /// The vertical field of view in degrees, or the height in world units.
    pub extent: f64,
    /// Distance of the near plane.
    pub near: f64,
    /// Distance of the far plane; may be infinite.
    pub far: f64,
    /// World to view space, column by column.
    pub view: [f64; 16],
    /// View to clip space, column by column.
    pub projection_matrix: [f64; 16],
}

/// All rays of a picture: the point of the image plane for pixel coordinates `(x, y)` is
/// `p = corner + x·dx + y·dy`; centres of pixels lie at +0.5.
///
/// Perspective: a ray starts at `eye` with direction `p/|p|`. Parallel: it has `direction` and
/// starts at `p − direction·(p·direction)`. It is seen where `near ≤ axis·point ≤ far` and, in
/// perspective, at distances of at least 0.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct RaysView {
    /// Whether rays meet in an eye.
    pub perspective: u32,
    /// 0.
    pub reserved: u32,
    /// The eye.
    pub eye: [f64; 3],
    /// The direction of parallel rays.
    pub direction: [f64; 3],
    /// The distance along a ray from which depth is counted.
    pub depth_zero: f64,
    /// See above.
    pub corner: [f64; 3],
    /// See above.
    pub dx: [f64; 3],
    /// See above.
    pub dy: [f64; 3],
    /// The normal of the near and far planes.
    pub axis: [f64; 3],
    /// See above; may be −∞.
    pub near: f64,
    /// See above; may be ∞.
    pub far: f64,
}

/// A frame that is asked for.
#[repr(C)]
pub struct FrameView {
    /// Bytes of this table.
    pub size: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Whether there are opaque depths.
    pub is_opaque: u32,
    /// The part that the camera fills: left column, top row, columns, rows.
    pub viewport: [u32; 4],
    /// What lies behind: straight red, green, blue and opacity. The host lays it under.
    pub background: [f32; 4],
    /// The accumulated opacity at which depth is taken.
    pub depth_threshold: f32,
    /// 0: opaque depths are distances along the rays. 1: a depth buffer with near at 0 and far at 1.
    /// 2: one with near at −1.
    pub opaque_kind: u32,
    /// The rays of the viewport's pixels, counted from its upper left corner.
    pub rays: RaysView,
    /// The camera that they come from.
    pub camera: CameraView,
    /// What cuts all shapes, in world space.
    pub clip: *const ClipRegionView,
    /// See `clip`.
    pub clip_count: u64,
    /// What the application has drawn: premultiplied f32, shape `[4, width, height]`; or none.
    pub opaque_color: ArrayView,
    /// How far away that is: f32, shape `[width, height]`.
    pub opaque_depth: ArrayView,
    /// World to clip space of that depth buffer, column by column.
    pub opaque_matrix: [f64; 16],
}

/// Hears warnings.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct WarningSink {
    /// What `warn` is called with.
    pub user: *mut c_void,
    /// Takes a warning: its stable code, what it is about, and what happened; `note` is 1 where
    /// it is no more than a choice made. An unknown code counts as the plugin's own.
    pub warn: Option<unsafe extern "C" fn(user: *mut c_void, note: u32, code: Text, subject: Text, message: Text)>,
}

/// Takes a picture. Valid during the call that it is given to.
#[repr(C)]
pub struct FrameSink {
    /// Bytes of this table.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// What the functions are called with.
    pub user: *mut c_void,
    /// Gives the host's memory of the picture to draw into: premultiplied RGBA without background
    /// and distances, row by row from the top; transparent and infinite at first.
    pub target: Option<unsafe extern "C" fn(user: *mut c_void, color: *mut *mut f32, depth: *mut *mut f32) -> i32>,
    /// Shares a picture of the plugin's own instead, without a copy: shapes `[4, width, height]`
    /// and `[width, height]` of f32. The host retains both, and nobody writes to them any more.
    pub share: Option<unsafe extern "C" fn(user: *mut c_void, color: *const ArrayView, depth: *const ArrayView) -> i32>,
    /// Takes warnings.
    pub warnings: WarningSink,
    /// Says how the picture was made: `sampling`, `classification`, `texture_format`, `filter`,
    /// `blend` or `device`; any other name is a figure of the plugin's own.
    pub say: Option<unsafe extern "C" fn(user: *mut c_void, name: Text, value: Text) -> i32>,
    /// Says how much it took: `sample_distance`, `table_width`, `termination`, `total`, `prepare`,
    /// `render` (seconds), `rays`, `samples`, `skipped`, `resident_bytes`, `uploaded_bytes`,
    /// `threads`.
    pub count: Option<unsafe extern "C" fn(user: *mut c_void, name: Text, value: f64) -> i32>,
    /// Says what of a shape was prepared anew, and its bytes.
    pub rebuilt: Option<unsafe extern "C" fn(user: *mut c_void, shape: Text, what: Text, bytes: u64) -> i32>,
}

/// What an action can do. The host fills in zeros and the size.
#[repr(C)]
pub struct CapsView {
    /// Bytes of this table.
    pub size: u32,
    /// The ways of compositing: bit `1 << COMPOSITE_…` for each.
    pub compositing: u32,
    /// Whether `over` shapes may overlap.
    pub overlap: u32,
    /// Whether frames carry depth.
    pub depth: u32,
    /// Whether it draws any shader; else those of `shaders`.
    pub any_shader: u32,
    /// Whether it draws any geometry; else those of `geometries`.
    pub any_geometry: u32,
    /// Names of shaders; valid until the action's next call.
    pub shaders: *const Text,
    /// See `shaders`.
    pub shader_count: u64,
    /// Names of geometries; valid until the action's next call.
    pub geometries: *const Text,
    /// See `geometries`.
    pub geometry_count: u64,
    /// What it runs on.
    pub device: Text,
    /// Whether it draws shaders by their source that `shaders` does not name.
    pub shader_sources: u32,
    /// 0.
    pub reserved: u32,
}

/// A shader that the host knows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct KnownShader {
    /// Its declaration.
    pub declaration: DeclarationView,
    /// `COMPOSITE_…`.
    pub compositing: u32,
    /// 0.
    pub reserved: u32,
    /// The file of the source, as messages name it; without length where there is none.
    pub file: Text,
    /// The source in WGSL; without length where there is none.
    pub source: Text,
}

/// What the host gives to an action when it is made. What it points to lives as long as the action.
#[repr(C)]
pub struct ActionContext {
    /// Bytes of this table.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// All shaders known.
    pub shaders: *const KnownShader,
    /// See `shaders`.
    pub shader_count: u64,
    /// What `progress` is called with.
    pub user: *mut c_void,
    /// Hears how far something long is; from any thread.
    pub progress: Option<unsafe extern "C" fn(user: *mut c_void, what: Text, done: u64, total: u64)>,
}

/// A render action. An action belongs to one thread at a time. The host keeps the order of calls
/// and makes every check that needs no device before it calls.
#[repr(C)]
pub struct ActionTable {
    /// Bytes of this table.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Name, version and options.
    pub declaration: DeclarationView,
    /// What `create` is called with.
    pub user: *mut c_void,
    /// Makes an action from options that were checked against the declaration.
    pub create: Option<
        unsafe extern "C" fn(
            user: *mut c_void,
            context: *const ActionContext,
            options: Parameters,
            action: *mut *mut c_void,
        ) -> i32,
    >,
    /// Ends it.
    pub destroy: Option<unsafe extern "C" fn(action: *mut c_void)>,
    /// What it can do.
    pub caps: Option<unsafe extern "C" fn(action: *mut c_void, caps: *mut CapsView) -> i32>,
    /// Takes a shape in, or refuses it. Null for an action that takes every shape it can find in
    /// its `caps`.
    pub manage: Option<unsafe extern "C" fn(action: *mut c_void, shape: *const ShapeView) -> i32>,
    /// Lets a shape go. May be null.
    pub unmanage: Option<unsafe extern "C" fn(action: *mut c_void, id: u64) -> i32>,
    /// Opens a frame, with all managed shapes as they are now. They and the frame stay valid until
    /// `end_draw` returns.
    pub begin_draw: Option<
        unsafe extern "C" fn(
            action: *mut c_void,
            frame: *const FrameView,
            shapes: *const *const ShapeView,
            shape_count: u64,
        ) -> i32,
    >,
    /// Records a shape of those given to `begin_draw`.
    pub draw: Option<unsafe extern "C" fn(action: *mut c_void, id: u64) -> i32>,
    /// Draws what was recorded, in order, and closes the frame, also when it fails.
    pub end_draw: Option<unsafe extern "C" fn(action: *mut c_void, sink: *const FrameSink) -> i32>,
    /// Changes an option. Null where none can be changed.
    pub set_option: Option<unsafe extern "C" fn(action: *mut c_void, option: *const Parameter) -> i32>,
}
