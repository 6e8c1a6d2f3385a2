//! Shapes checked and made ready.

use volact_core::{
    Aabb, ActionError, Clip, Compositing, Slices, Tessellation, VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::{ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
};

use super::{
    carried::{Carried, Cells},
    cells::Grid,
    line::Place,
    medium::{Medium, Voxels},
    mesh::Mesh,
    options::{Method, NAME, ReferenceOptions},
    source::{self, Look},
    surfaces,
};

/// A shape made ready.
pub(super) struct Prepared {
    /// What identifies the shape: overlapping shapes are put in this order, so that the order of
    /// drawing changes no bit.
    pub id: u64,
    /// Its number among all that are drawn.
    pub order: usize,
    pub medium: Medium,
    pub body: Body,
    /// World to object.
    pub to_object: DAffine3,
    /// About the middle, in object space.
    pub center: DVec3,
    /// What cuts it, in object space.
    pub clip: Clip,
    pub compositing: Compositing,
    /// The planes on which it is drawn, where it is.
    pub slices: Option<Slices>,
    /// The highest number of any colour channel.
    pub brightest: f64,
    /// The highest opacity.
    pub max_opacity: f64,
}

/// What holds the fields.
pub(super) enum Body {
    /// A volume in a block.
    Grid(GridBody),
    /// A volume in a mesh, read by position.
    Carved(Mesh, GridBody),
    /// A mesh whose tetrahedra carry what is drawn.
    Cells(Cells),
}

/// A volume, and the block that it fills.
pub(super) struct GridBody {
    pub texture: VolumeTexture,
    pub grid: Grid,
    pub place: Place,
}

/// The most samples along the diagonal of a shape.
const MAX_SAMPLES: f64 = 1e9;

/// Refuses what cannot be drawn with the option `recognise` on.
///
/// # Errors
/// If the geometry is damaged or holds no volume, the shader is not known here and has no source,
/// reads a component that is not there, or an attribute does not go with the vertices.
pub fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    check_with(shape, true)
}

/// Refuses what cannot be drawn.
///
/// # Errors
/// As [`check`].
pub(super) fn check_with(shape: &ResolvedShape, recognise: bool) -> Result<(), ActionError> {
    match source::look(shape, recognise)? {
        Look::Surface => surfaces::check(shape),
        Look::Source(_) => source::check(shape),
        Look::Native(shader) => check_native(shape, shader),
    }
}

fn check_native(shape: &ResolvedShape, shader: &str) -> Result<(), ActionError> {
    let refuse = |what: String, cure: &str| {
        Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
    };
    if shape.state.geometry.slices().is_some() && shape.compositing() != Compositing::Over {
        return refuse(format!("slices with the shader {shader:?}"), "use simple, lut or attribute");
    }
    let (count, of) = match (shape.volume("volume"), shape.attribute("scalars")) {
        (Some(texture), _) => (texture.volume().desc().components, "a volume"),
        (None, Some(scalars)) => (scalars.components, "an attribute"),
        _ => {
            let cure = "use a shader that reads a volume or an attribute";
            return refuse(format!("shader {shader:?} without a volume or an attribute"), cure);
        }
    };
    let component = shape.int("component").unwrap_or(0);
    if component >= count as i64 {
        return refuse(format!("component {component} of {of} that has {count}"), "name a component that is there");
    }
    if shape.attribute("scalars").is_some() && shape.state.geometry.vertex_count().is_none() {
        check_attributes(shape, &tessellate(shape)?)?;
    }
    match Medium::new(shape, shader) {
        Some(_) => Ok(()),
        None => {
            let cure = "use simple, lut, mip, minip, average, xray or attribute";
            refuse(format!("shader {shader:?}"), cure)
        }
    }
}

/// A shape's tetrahedra, checked.
pub(super) fn tessellate(shape: &ResolvedShape) -> Result<Tessellation, ActionError> {
    let geometry = &shape.state.geometry;
    let made = geometry.tessellate().and_then(|made| made.validate(geometry.name()).map(|()| made));
    made.map_err(|source| ActionError::Geometry { shape: shape.name.clone(), source })
}

/// Refuses attributes that have not a number for each vertex.
pub(super) fn check_attributes(shape: &ResolvedShape, made: &Tessellation) -> Result<(), ActionError> {
    let wanted = shape.state.geometry.vertex_count().unwrap_or(made.vertices.len());
    for name in shape.parameters.keys() {
        let Some(attribute) = shape.attribute(name).filter(|a| a.len() != wanted) else { continue };
        let kind = ProblemKind::Mistyped {
            found: format!("attribute {:?} of {} vertices", attribute.name, attribute.len()),
            wanted: format!("one of {wanted}, the geometry's"),
        };
        let problems = vec![ParameterProblem { name: name.clone(), kind }];
        let (shape, shader) = (shape.name.clone(), shape.state.shader.clone());
        return Err(ActionError::Parameters { shape, shader, problems });
    }
    Ok(())
}

/// Shapes made ready, each kind in the order in which they are drawn.
#[derive(Default)]
pub(super) struct Ready {
    pub shapes: Vec<Prepared>,
    pub sources: Vec<source::Prepared>,
}

/// Makes shapes other than surfaces ready. [`check_with`] has let them pass.
///
/// # Errors
/// If a geometry cannot be tessellated, a program cannot be compiled, or a lattice is too fine.
pub(super) fn prepare(shapes: &[ResolvedShape], options: &ReferenceOptions) -> Result<Ready, ActionError> {
    let mut ready = Ready::default();
    let exact = options.method == Method::Exact;
    for (order, shape) in shapes.iter().enumerate() {
        let look = source::look(shape, options.recognise)?;
        if !exact && !matches!(look, Look::Surface) {
            check_samples(shape, options.sample_distance)?;
        }
        let shader = match look {
            Look::Surface => continue,
            Look::Native(shader) => shader,
            Look::Source(program) => {
                ready.sources.extend(source::prepare(shape, program, order)?);
                continue;
            }
        };
        let Some(medium) = Medium::new(shape, shader) else { continue };
        let compositing = shape.compositing();
        let skip = exact && compositing == Compositing::Over;
        let Some((body, center)) = body(shape, &medium, skip)? else { continue };
        ready.shapes.push(Prepared {
            id: shape.id,
            order,
            brightest: medium.brightest(),
            max_opacity: medium.max_opacity(),
            medium,
            body,
            to_object: shape.to_object,
            center,
            clip: shape.state.clip.clone(),
            compositing,
            slices: shape.state.geometry.slices().cloned(),
        });
    }
    Ok(ready)
}

/// What holds a shape's fields, and its middle; `None` where it holds nothing.
fn body(shape: &ResolvedShape, medium: &Medium, skip: bool) -> Result<Option<(Body, DVec3)>, ActionError> {
    if let (Some(block), Some(texture)) = (shape.block(), shape.volume("volume")) {
        return Ok(Some((Body::Grid(grid_body(texture, block, medium, skip)), block.center())));
    }
    let made = tessellate(shape)?;
    let mesh = Mesh::new(&made);
    let center = mesh.bounds().center();
    if made.tetrahedra.is_empty() {
        return Ok(None);
    }
    if let Some(scalars) = shape.attribute("scalars") {
        check_attributes(shape, &made)?;
        let carried = Carried::numbers(medium, made.vertices.len(), scalars, shape.attribute("opacity_scalars"));
        return Ok(Some((Body::Cells(Cells { mesh, carried }), center)));
    }
    let Some(texture) = shape.volume("volume") else { return Ok(None) };
    Ok(Some(match &made.texture_coordinates {
        Some(coordinates) => {
            let grid = Grid::new(medium, &Voxels::new(texture), skip);
            let carried = Carried::volume(texture.clone(), grid, coordinates.iter());
            (Body::Cells(Cells { mesh, carried }), center)
        }
        None => {
            let block = texture.geometry_roi();
            (Body::Carved(mesh, grid_body(texture, block, medium, skip)), center)
        }
    }))
}

fn grid_body(texture: &VolumeTexture, block: Aabb, medium: &Medium, skip: bool) -> GridBody {
    let grid = Grid::new(medium, &Voxels::new(texture), skip);
    let place = Place { to_index: texture.object_to_index(), block };
    GridBody { texture: texture.clone(), grid, place }
}

fn check_samples(shape: &ResolvedShape, step: f64) -> Result<(), ActionError> {
    let bounds = shape.block().unwrap_or_else(|| shape.state.geometry.bounds());
    let size = shape.state.transform.matrix3 * bounds.size();
    let count = size.length() / step;
    if step > 0.0 && count <= MAX_SAMPLES {
        return Ok(());
    }
    let wanted = format!("at most {MAX_SAMPLES:e}; raise sample_distance");
    let what = format!("samples a ray through shape {:?}", shape.name);
    Err(ActionError::Limit { action: NAME.into(), what, found: format!("{count:e}"), wanted })
}
