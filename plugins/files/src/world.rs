//! From a file's axes and origin to spacing and placement.

use std::path::Path;

use volact_core::{
    LoadError, VolumeDesc,
    glam::{DAffine3, DMat3, DVec3},
};

/// Sets spacing and placement from the steps between samples along x, y, z and the first sample's
/// place, all in world space.
///
/// The spacing is each step's length; what remains (rotation, mirroring, shear, origin) is the
/// placement.
pub(crate) fn place(
    path: &Path,
    what: &str,
    desc: &mut VolumeDesc,
    steps: [DVec3; 3],
    origin: DVec3,
) -> Result<(), LoadError> {
    let lengths = steps.map(DVec3::length);
    let unit = |a: usize| steps[a] / lengths[a];
    let matrix = DMat3::from_cols(unit(0), unit(1), unit(2));
    let good = lengths.iter().all(|l| l.is_finite() && *l > 0.0) && origin.is_finite();
    if !good || matrix.determinant().abs() < 1e-9 {
        let found = format!("{} {} {} from {origin}", steps[0], steps[1], steps[2]);
        return Err(LoadError::invalid(path, what, found, "three finite, independent directions"));
    }
    desc.spacing = DVec3::from_array(lengths);
    desc.placement = DAffine3::from_mat3_translation(matrix, origin);
    Ok(())
}

/// As [`place`], from unit directions and a spacing.
pub(crate) fn place_spaced(
    path: &Path,
    what: &str,
    desc: &mut VolumeDesc,
    directions: [DVec3; 3],
    spacing: [f64; 3],
    origin: DVec3,
) -> Result<(), LoadError> {
    if spacing.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(LoadError::invalid(path, "spacing", format!("{spacing:?}"), "positive and finite"));
    }
    place(path, what, desc, std::array::from_fn(|a| directions[a] * spacing[a]), origin)?;
    // A direction of unit length gives its spacing back without the rounding of its length.
    for a in 0..3 {
        if (directions[a].length() - 1.0).abs() < 1e-6 {
            desc.spacing[a] = spacing[a];
        }
    }
    Ok(())
}

/// The three unit directions.
pub(crate) const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

/// Turns RAS into LPS, and back.
pub(crate) fn flip_ras(v: DVec3) -> DVec3 {
    // Adding zero keeps -0 out of messages.
    DVec3::new(-v.x, -v.y, v.z) + DVec3::ZERO
}
