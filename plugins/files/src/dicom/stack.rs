//! Slices put in a row.

use volact_core::{LoadError, glam::DVec3};

use super::{Layout, Slice};
use crate::format::name_of;

/// How far from its even place a slice may lie, in slice distances.
const EVEN: f64 = 0.01;
/// How many times more slices resampling may make.
const MOST_GROWTH: usize = 8;

/// Checks that the slices make one stack; returns the planes' normal.
pub(super) fn consistent(slices: &[Slice]) -> Result<DVec3, LoadError> {
    let first = &slices[0];
    for other in &slices[1..] {
        let differs = |what: &str, found: String, wanted: String| {
            let wanted = format!("{wanted} as in {}", name_of(&first.path));
            Err(LoadError::invalid(&other.path, what, found, wanted))
        };
        let (a, b) = (&first.layout, &other.layout);
        if (a.rows, a.columns, a.components, a.scalar) != (b.rows, b.columns, b.components, b.scalar) {
            let size = |l: &Layout| format!("{} x {}, {} of {}", l.columns, l.rows, l.components, l.scalar);
            return differs("slice", size(b), size(a));
        }
        if (a.slope, a.intercept) != (b.slope, b.intercept) {
            let map = |l: &Layout| format!("{} and {}", l.slope, l.intercept);
            return differs("rescale slope and intercept", map(b), map(a));
        }
        if a != b {
            return differs("pixel format", format!("{b:?}"), format!("{a:?}"));
        }
        if first.row.distance(other.row) > 1e-4 || first.column.distance(other.column) > 1e-4 {
            let axes = |s: &Slice| format!("{} {}", s.row, s.column);
            return differs("ImageOrientationPatient", axes(other), axes(first));
        }
        if (0..2).any(|n| (first.spacing[n] - other.spacing[n]).abs() > 1e-4 * first.spacing[n].abs()) {
            return differs("PixelSpacing", format!("{:?}", other.spacing), format!("{:?}", first.spacing));
        }
    }
    Ok(first.row.cross(first.column).normalize())
}

/// The slices' places along the line that their first samples lie on.
pub(super) struct Stack {
    /// Distance of each slice from the first.
    pub(super) places: Vec<f64>,
    direction: DVec3,
    /// The distances in words, if they are not even.
    pub(super) uneven: Option<String>,
}

impl Stack {
    /// The stack of slices that are sorted along the normal of their planes.
    pub(super) fn of(slices: &[Slice], normal: DVec3) -> Result<Self, LoadError> {
        let (first, last) = (&slices[0], &slices[slices.len() - 1]);
        if slices.len() == 1 {
            let thickness = first.thickness.filter(|t| *t > 0.0).unwrap_or(1.0);
            return Ok(Self { places: vec![0.0], direction: normal * thickness, uneven: None });
        }
        let span = last.position - first.position;
        let length = span.length();
        let direction = span / length;
        let places: Vec<f64> = slices.iter().map(|s| (s.position - first.position).dot(direction)).collect();
        for (n, pair) in places.windows(2).enumerate() {
            let along = (slices[n + 1].position - slices[n].position).dot(normal);
            if !(pair[1] - pair[0] > 1e-6 && along > 1e-6) {
                let found = format!("{} of two slices", slices[n + 1].position);
                let wanted = format!("another than that of {}", name_of(&slices[n].path));
                return Err(LoadError::invalid(&slices[n + 1].path, "ImagePositionPatient", found, wanted));
            }
        }
        let pixel = first.spacing[0].min(first.spacing[1]);
        for (slice, place) in slices.iter().zip(&places) {
            let beside = (first.position + direction * place).distance(slice.position);
            if beside > EVEN * pixel.max(length / (slices.len() - 1) as f64) {
                let found = format!("{beside:.4} mm beside the line from the first slice to the last");
                return Err(LoadError::invalid(&slice.path, "ImagePositionPatient", found, "all slices on one line"));
            }
        }
        let even = length / (slices.len() - 1) as f64;
        let off = places.iter().enumerate().any(|(n, place)| (place - n as f64 * even).abs() > EVEN * even);
        Ok(Self { uneven: off.then(|| distances(&places)), places, direction })
    }

    fn length(&self) -> f64 {
        self.places.last().copied().unwrap_or(0.0)
    }

    /// From one of `count` even slices to the next.
    pub(super) fn step(&self, count: usize) -> DVec3 {
        if count > 1 { self.direction * (self.length() / (count - 1) as f64) } else { self.direction }
    }

    /// How many even slices lose none of these.
    pub(super) fn even_count(&self) -> usize {
        let smallest = self.places.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let wanted = (self.length() / smallest).round() + 1.0;
        (wanted as usize).clamp(self.places.len(), self.places.len() * MOST_GROWTH)
    }
}

/// `4.22 mm (slices 1 to 14), 1.14 mm (14 to 15)`
fn distances(places: &[f64]) -> String {
    let mut runs: Vec<(f64, usize, usize)> = Vec::new();
    for (n, pair) in places.windows(2).enumerate() {
        let distance = pair[1] - pair[0];
        match runs.last_mut() {
            Some((d, _, last)) if (*d - distance).abs() <= EVEN * d.abs() => *last = n + 2,
            _ => runs.push((distance, n + 1, n + 2)),
        }
    }
    let shown = runs.iter().take(8).map(|(d, a, b)| format!("{d:.2} mm (slices {a} to {b})")).collect::<Vec<_>>();
    let more = if runs.len() > 8 { format!(" and {} more", runs.len() - 8) } else { String::new() };
    shown.join(", ") + &more
}
