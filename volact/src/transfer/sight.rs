//! From where a volume is seen, and what of it a camera should fit.

use std::f64::consts::PI;

use volact_core::{
    Aabb, Camera, FrameDesc, View, Volume, VolumeTexture,
    glam::{DQuat, DVec3},
    shape::smallest_voxel,
};

use super::statistics::Statistics;

/// A subject this much thinner along one axis than along both others is seen along it.
const FLAT: f64 = 0.6;
/// One sample in so many may lie outside what a camera fits.
const STRAY: usize = 10_000;
/// Samples by which strays are told, about.
const JUDGES: usize = 100_000;

/// A direction of view and what is to be seen, in world space.
#[derive(Clone, Debug)]
pub(super) struct Sight {
    pub view: View,
    pub bounds: Aabb,
    pub hull: Vec<DVec3>,
}

impl Sight {
    /// All of a volume, from in front, the right and above.
    pub fn whole(volume: &Volume) -> Self {
        let corners = corners(volume, volume.dims().map(|n| [0, n - 1]), 0);
        Self { view: View::Iso, bounds: around(&corners), hull: corners.to_vec() }
    }

    /// Looks along the axis in which a flat subject is thin, else from in front, the right and
    /// above; at patients (values in HU) straight from in front.
    pub fn new(volume: &Volume, statistics: &Statistics, inside: impl Fn(f64) -> bool) -> Self {
        let Some(extent) = statistics.extent(&inside) else { return Self::whole(volume) };
        let bounds = around(&corners(volume, extent.map(|r| r.map(|i| i * statistics.stride)), 2 * statistics.stride));
        let steps = world_steps(volume);
        let count = |a: usize| ((extent[a][1] - extent[a][0] + 1) * statistics.stride) as f64;
        let size: [f64; 3] = std::array::from_fn(|a| count(a) * steps[a].length());
        let view = match thin_axis(size) {
            Some(thin) => along(steps[thin]),
            None if volume.desc().unit == "HU" => View::Front,
            None => View::Iso,
        };
        Self { view, bounds, hull: hull(volume, statistics, extent, inside) }
    }
}

/// A picture over black of all points, or of a box where there are none.
pub(super) fn fit(hull: &[DVec3], bounds: &Aabb, view: View, width: usize, height: usize) -> FrameDesc {
    let camera = Camera::fit_points(hull, view, width, height);
    FrameDesc::new(camera.unwrap_or_else(|| Camera::fit(bounds, view, width, height)), width, height)
}

/// As [`fit`], where another direction than z is up: all is turned until that is z, and the camera
/// turned back. Unless a view is asked for, it is the one that suits, turned as well.
pub(super) fn fit_upright(
    hull: &[DVec3],
    bounds: &Aabb,
    [asked, suits]: [Option<View>; 2],
    up: DVec3,
    [width, height]: [usize; 2],
) -> FrameDesc {
    let turn = upright(up);
    let turned = |points: &[DVec3]| points.iter().map(|p| turn * *p).collect::<Vec<_>>();
    let view = asked.unwrap_or_else(|| match suits.unwrap_or_default() {
        View::Iso => View::Iso,
        view => along(turn * view.axes().0),
    });
    let mut frame = fit(&turned(hull), &around(&turned(&bounds.corners())), view, width, height);
    if let Camera::LookAt { eye, target, up, .. } = &mut frame.camera {
        let back = turn.inverse();
        [eye, target, up].into_iter().for_each(|v| *v = back * *v);
    }
    frame
}

/// The shortest turn of a direction up to z; what is upside down is turned about y, so that its
/// front stays in front.
fn upright(up: DVec3) -> DQuat {
    let up = up.normalize_or(DVec3::Z);
    if up.z < -1.0 + 1e-9 { DQuat::from_rotation_y(PI) } else { DQuat::from_rotation_arc(up, DVec3::Z) }
}

/// The axis along which something of that size is thin, if it is flat.
pub(super) fn thin_axis(size: [f64; 3]) -> Option<usize> {
    let thin = (0..3).min_by(|a, b| size[*a].total_cmp(&size[*b])).unwrap_or(2);
    let others = (0..3).filter(|a| *a != thin).map(|a| size[a]).fold(f64::INFINITY, f64::min);
    (size[thin] <= FLAT * others).then_some(thin)
}

/// The view that looks along a direction most nearly.
pub(super) fn along(direction: DVec3) -> View {
    let direction = direction.normalize_or(DVec3::Z).abs();
    let views = [(View::Top, direction.z), (View::Front, direction.y), (View::Right, direction.x)];
    views.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(View::Iso, |(view, _)| view)
}

pub(super) fn around(points: &[DVec3]) -> Aabb {
    points.iter().fold(Aabb::EMPTY, |b, &c| Aabb::new(b.min.min(c), b.max.max(c)))
}

/// The corners of samples from first to last along each axis and `rim` more on every side, in
/// world space.
fn corners(volume: &Volume, samples: [[usize; 2]; 3], rim: usize) -> [DVec3; 8] {
    let desc = volume.desc();
    let corner = |side: usize| {
        let at = |a: usize| match side {
            0 => samples[a][0].saturating_sub(rim),
            _ => (samples[a][1] + rim).min(desc.dims[a] - 1),
        };
        DVec3::new(at(0) as f64, at(1) as f64, at(2) as f64) * desc.spacing
    };
    let (min, max) = (corner(0), corner(1));
    // A plane of samples is one spacing thick.
    let thick = DVec3::select(min.cmpeq(max), desc.spacing / 2.0, DVec3::ZERO);
    Aabb::new(min - thick, max + thick).corners().map(|c| desc.placement.transform_point3(c))
}

/// World points around the samples that `inside` accepts: the first and the last of each row,
/// without strays, and two samples farther out.
fn hull(volume: &Volume, statistics: &Statistics, extent: [[usize; 2]; 3], inside: impl Fn(f64) -> bool) -> Vec<DVec3> {
    let desc = volume.desc();
    let [nx, ny, _] = statistics.dims;
    let world = |x: usize, y: usize, z: usize| {
        let at = DVec3::new(x as f64, y as f64, z as f64) * statistics.stride as f64;
        desc.placement.transform_point3(at * desc.spacing)
    };
    let (mut ends, mut all) = (Vec::new(), Vec::new());
    let [rows_y, rows_z] = [1, 2].map(|a| extent[a][0]..=extent[a][1]);
    for z in rows_z {
        for y in rows_y.clone() {
            let start = (z * ny + y) * nx;
            let row = &statistics.values[start..start + nx];
            let found = |x: &usize| inside(f64::from(row[*x]));
            let mut here = (extent[0][0]..=extent[0][1]).filter(found);
            let Some(first) = here.next() else { continue };
            let rest = here.collect::<Vec<_>>();
            all.extend(std::iter::once(first).chain(rest.iter().copied()).map(|x| [x as u32, y as u32, z as u32]));
            let last = rest.last().copied().unwrap_or(first);
            ends.extend([world(first, y, z), world(last, y, z)]);
        }
    }
    let every = (all.len() / JUDGES).max(1);
    let judges = all.iter().step_by(every).map(|at| at.map(|i| i as usize)).map(|[x, y, z]| world(x, y, z));
    without_strays(&mut ends, &judges.collect::<Vec<_>>());
    let middle = around(&ends).center();
    let rim = 2.0 * statistics.stride as f64 * smallest_voxel(&VolumeTexture::new(volume), &desc.placement);
    ends.iter().map(|p| *p + (*p - middle).normalize_or_zero() * rim).collect()
}

/// Leaves out points that lie farther along any of 26 directions than nearly all judges.
fn without_strays(points: &mut Vec<DVec3>, judges: &[DVec3]) {
    if judges.is_empty() {
        return;
    }
    let part = |i: usize, n: usize| f64::from((i / n % 3) as u8) - 1.0;
    let directions = (0..27).filter(|i| *i != 13).map(|i| DVec3::new(part(i, 1), part(i, 3), part(i, 9)).normalize());
    for direction in directions {
        let mut along: Vec<f64> = judges.iter().map(|p| p.dot(direction)).collect();
        let rank = along.len() - 1 - along.len() / STRAY;
        let (_, limit, _) = along.select_nth_unstable_by(rank, f64::total_cmp);
        points.retain(|p| p.dot(direction) <= *limit);
    }
}

/// From one sample to the next along each axis, in world space.
pub(super) fn world_steps(volume: &Volume) -> [DVec3; 3] {
    let desc = volume.desc();
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    std::array::from_fn(|a| desc.placement.transform_vector3(axes[a] * desc.spacing[a]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The column and row, 0 to 1, at which a point stands in a picture.
    fn place(frame: &FrameDesc, point: DVec3) -> [f64; 2] {
        let Camera::LookAt { eye, target, up, .. } = frame.camera else { panic!() };
        let forward = (target - eye).normalize();
        let right = forward.cross(up).normalize();
        let (p, half) = (point - eye, 15f64.to_radians().tan());
        let [x, y] = [right, right.cross(forward)].map(|axis| p.dot(axis) / p.dot(forward) / half);
        [0.5 + x / 2.0, 0.5 - y / 2.0]
    }

    #[test]
    fn what_is_said_to_be_up_is_up_and_all_is_seen() {
        let room = Aabb::new(DVec3::ZERO, DVec3::new(6.0, 2.5, 2.4));
        let hull = room.corners();
        for up in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z] {
            for view in [View::Front, View::Left, View::Iso] {
                let frame = fit_upright(&hull, &room, [Some(view), None], up, [64, 64]);
                frame.validate().unwrap();
                let [low, high] = [-1.0, 1.0].map(|side| place(&frame, room.center() + side * up));
                assert!((low[0] - high[0]).abs() < 0.05 && high[1] < low[1] - 0.1, "{up} {view:?}: {low:?} {high:?}");
                let inside = |p: &DVec3| place(&frame, *p).iter().all(|at| (0.0..=1.0).contains(at));
                assert!(hull.iter().all(inside), "{up} {view:?}");
            }
        }
    }

    #[test]
    fn with_z_up_nothing_changes_and_a_view_that_suits_is_turned() {
        let plate = Aabb::new(DVec3::ZERO, DVec3::new(4.0, 3.0, 0.5));
        let hull = plate.corners();
        let upright = |up, suits| fit_upright(&hull, &plate, [None, Some(suits)], up, [80, 60]).camera;
        assert_eq!(upright(DVec3::Z, View::Top), fit(&hull, &plate, View::Top, 80, 60).camera);
        let Camera::LookAt { eye, target, .. } = upright(DVec3::Y, View::Top) else { panic!() };
        assert!((eye - target).normalize().z > 0.999);
    }
}
