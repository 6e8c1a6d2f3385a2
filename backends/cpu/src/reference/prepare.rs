//! Shapes checked and made ready.

use volact_core::{
    ActionError, Clip, Compositing, VolumeTexture,
    glam::{DAffine3, DVec3},
    resolve::ResolvedShape,
};

use super::{
    cells::Grid,
    line::Place,
    medium::{Medium, Voxels},
    options::{Method, NAME, ReferenceOptions},
};

/// A shape made ready.
pub(super) struct Prepared {
    /// What identifies the shape: overlapping shapes are put in this order, so that the order of
    /// drawing changes no bit.
    pub id: u64,
    pub medium: Medium,
    pub body: Body,
    /// World to object.
    pub to_object: DAffine3,
    /// About the middle, in object space.
    pub center: DVec3,
    /// What cuts it, in object space.
    pub clip: Clip,
    pub compositing: Compositing,
    /// The highest number of any colour channel.
    pub brightest: f64,
    /// The highest opacity.
    pub max_opacity: f64,
}

/// What holds the fields.
pub(super) enum Body {
    /// A volume in a block.
    Grid(GridBody),
}

/// A volume in a block.
pub(super) struct GridBody {
    pub texture: VolumeTexture,
    pub grid: Grid,
    pub place: Place,
}

/// The most samples along the diagonal of a shape.
const MAX_SAMPLES: f64 = 1e9;

/// Refuses what cannot be drawn.
///
/// # Errors
/// If the geometry is no block, the shader is not known here or reads a component that is not
/// there.
pub fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    let refuse = |what: String, cure: &str| {
        Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
    };
    let Some(texture) = shape.volume("volume") else {
        return refuse(format!("shader {:?} without a volume", shape.state.shader), "use a shader that reads a volume");
    };
    if shape.block().is_none() {
        return refuse(format!("geometry {:?}", shape.state.geometry.name()), "use a block");
    }
    let (count, component) = (texture.volume().desc().components, shape.int("component").unwrap_or(0));
    if component >= count as i64 {
        return refuse(format!("component {component} of a volume that has {count}"), "name a component that is there");
    }
    match Medium::new(shape) {
        Some(_) => Ok(()),
        None => refuse(format!("shader {:?}", shape.state.shader), "use simple, lut, mip, minip, average or xray"),
    }
}

/// Makes shapes ready, in the order in which they are drawn.
///
/// # Errors
/// If a shape is refused by [`check`], or a lattice is too fine.
pub(super) fn prepare(shapes: &[ResolvedShape], options: &ReferenceOptions) -> Result<Vec<Prepared>, ActionError> {
    let mut prepared: Vec<Prepared> = Vec::new();
    for shape in shapes {
        check(shape)?;
        let Some(medium) = Medium::new(shape) else { continue };
        let compositing = shape.compositing();
        let exact = options.method == Method::Exact;
        if !exact {
            check_samples(shape, options.sample_distance)?;
        }
        let skip = exact && compositing == Compositing::Over;
        let Some((body, center)) = grid_body(shape, &medium, skip) else { continue };
        prepared.push(Prepared {
            id: shape.id,
            brightest: medium.brightest(),
            max_opacity: medium.max_opacity(),
            medium,
            body,
            to_object: shape.to_object,
            center,
            clip: shape.state.clip.clone(),
            compositing,
        });
    }
    Ok(prepared)
}

fn grid_body(shape: &ResolvedShape, medium: &Medium, skip: bool) -> Option<(Body, DVec3)> {
    let (texture, block) = (shape.volume("volume")?.clone(), shape.block()?);
    let grid = Grid::new(medium, &Voxels::new(&texture), skip);
    let place = Place { to_index: texture.object_to_index(), block };
    Some((Body::Grid(GridBody { texture, grid, place }), block.center()))
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
