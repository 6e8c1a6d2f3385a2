//! Along which levels each shape is cut, and which shapes are swept together.

use glam::{DAffine3, DVec3};

use super::{
    Levels, SamplingMode, SlicingError, Solid,
    order::{Relation, Sight, Solidly},
};
use crate::LinearRays;

/// The levels of each shape.
pub(super) fn levels(solids: &[&Solid], boxes: &[Solidly], mode: SamplingMode, linear: &LinearRays) -> Vec<Levels> {
    let origin = linear.eye.unwrap_or(DVec3::ZERO);
    let planes = Levels::Planes { normal: linear.axis, origin };
    match (mode, linear.eye) {
        (SamplingMode::SphericalShells, Some(center)) => vec![Levels::Shells { center }; solids.len()],
        (SamplingMode::AxisAligned, eye) => {
            let mut known: Vec<DVec3> = Vec::new();
            let of = |(solid, solidly): (&&Solid, &Solidly)| {
                let towards = eye.map_or(linear.direction, |eye| solidly.center() - eye);
                let normal = face_towards(solid.to_object(), towards, linear);
                // Shapes that turn the same way share their planes to the last bit.
                let same = known.iter().copied().find(|n| n.dot(normal) > 1.0 - 1e-14);
                let normal = same.unwrap_or_else(|| {
                    known.push(normal);
                    normal
                });
                Levels::Planes { normal, origin }
            };
            solids.iter().zip(boxes).map(of).collect()
        }
        _ => vec![planes; solids.len()],
    }
}

/// The unit normal of the faces of object space that turn most towards the eye.
fn face_towards(to_object: &DAffine3, towards: DVec3, linear: &LinearRays) -> DVec3 {
    let rows = to_object.matrix3.transpose();
    let normals = [rows.x_axis, rows.y_axis, rows.z_axis].map(|r| r.try_normalize().unwrap_or(linear.axis));
    let turned = |n: &&DVec3| n.dot(towards).abs();
    let best = normals.iter().max_by(|a, b| turned(a).total_cmp(&turned(b))).copied().unwrap_or(linear.axis);
    // With an eye the sense says nothing but must be the same for all; without, levels rise away.
    let sense = if linear.eye.is_some() { linear.axis } else { linear.direction };
    if best.dot(sense) < 0.0 { -best } else { best }
}

/// Shapes that have to be swept together: all of one kind of planes, or those that overlap.
pub(super) fn clusters(
    solids: &[&Solid],
    boxes: &[Solidly],
    levels: &[Levels],
    sight: Sight,
) -> Result<Vec<Vec<usize>>, SlicingError> {
    let all: Vec<usize> = (0..solids.len()).collect();
    if levels.windows(2).all(|l| l[0] == l[1]) {
        return Ok(if all.is_empty() { Vec::new() } else { vec![all] });
    }
    let mut group: Vec<usize> = all.clone();
    for i in 0..solids.len() {
        for j in i + 1..solids.len() {
            if boxes[i].relation(&boxes[j], sight) != Relation::Overlap {
                continue;
            }
            if levels[i] != levels[j] {
                let (first, second) = (solids[i].name().to_owned(), solids[j].name().to_owned());
                return Err(SlicingError::Axes { first, second });
            }
            let (from, to) = (group[j], group[i]);
            group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
        }
    }
    let members = |g: &usize| all.iter().copied().filter(|i| group[*i] == *g).collect::<Vec<_>>();
    Ok(all.iter().map(members).filter(|m| !m.is_empty()).collect())
}

/// Clusters by the place of their foremost shape.
pub(super) fn in_order(mut clusters: Vec<Vec<usize>>, ranks: &[usize]) -> Vec<Vec<usize>> {
    clusters.sort_by_key(|c| c.iter().map(|i| ranks[*i]).min());
    clusters
}
