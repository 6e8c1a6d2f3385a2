//! The choices on volumes by rule.

use super::*;
use volact_core::{ScalarType, VolumeDesc, table::ResolvedTable};

/// A hash of a sample's place, 0 to 1: noise that is the same every time.
fn noise(x: usize, y: usize, z: usize) -> f64 {
    let mut h = (x * 73_856_093) ^ (y * 19_349_663) ^ (z * 83_492_791);
    h = (h ^ (h >> 13)).wrapping_mul(0x5bd1_e995);
    ((h >> 7) & 0xffff) as f64 / 65535.0
}

fn volume(desc: VolumeDesc, value: impl Fn([usize; 3]) -> f64) -> Volume {
    let [nx, ny, nz] = desc.dims;
    let at = |i: usize| value([i % nx, i / nx % ny, i / (nx * ny)]) as f32;
    Volume::new(desc, (0..nx * ny * nz).map(at).collect::<Vec<f32>>()).unwrap()
}

fn desc(n: usize) -> VolumeDesc {
    VolumeDesc::new([n; 3], ScalarType::F32, 1)
}

fn radius([x, y, z]: [usize; 3], n: usize) -> f64 {
    let d = |i: usize| i as f64 / (n - 1) as f64 * 2.0 - 1.0;
    (d(x).powi(2) + d(y).powi(2) + d(z).powi(2)).sqrt()
}

/// Noisy air, a soft ball, a dense core.
fn ball(n: usize) -> impl Fn([usize; 3]) -> f64 {
    move |at @ [x, y, z]| {
        let noise = 60.0 * (noise(x, y, z) - 0.5);
        noise
            + if radius(at, n) < 0.35 {
                1500.0
            } else if radius(at, n) < 0.7 {
                600.0
            } else {
                100.0
            }
    }
}

fn resolve(automatic: &Automatic) -> ResolvedTable {
    automatic.table.as_ref().unwrap().resolve([0.0, 1.0])
}

#[test]
fn noisy_surroundings_vanish_and_the_dense_is_densest() {
    let automatic = automatic(&volume(desc(40), ball(40)));
    let table = resolve(&automatic);
    assert_eq!(table.max_opacity(f64::NEG_INFINITY, 130.0), 0.0);
    assert!(table.classify(600.0)[3] > 0.01);
    assert!(table.classify(1500.0)[3] > 2.0 * table.classify(600.0)[3]);
    assert_eq!((automatic.shader.as_str(), automatic.filter, automatic.view), ("lut", Filter::Linear, View::Iso));
}

#[test]
fn camera_fits_the_subject_and_not_the_air() {
    let automatic = automatic(&volume(desc(40), ball(40)));
    let size = automatic.subject.size();
    assert!(size.max_element() < 34.0 && size.min_element() > 26.0, "{size}");
}

#[test]
fn bright_surroundings_vanish_too() {
    let at = ball(40);
    let table = resolve(&automatic(&volume(desc(40), move |p| -at(p))));
    assert_eq!(table.max_opacity(-130.0, f64::INFINITY), 0.0);
    assert!(table.classify(-1500.0)[3] > table.classify(-600.0)[3]);
}

#[test]
fn padding_and_what_is_no_number_are_left_out() {
    let at = ball(40);
    let padded = volume(desc(40), move |p| {
        if p[2] < 4 {
            -9000.0
        } else if p[2] > 37 {
            f64::NAN
        } else {
            at(p)
        }
    });
    let automatic = automatic(&padded);
    assert!(automatic.notes[0].contains("-9000"));
    assert_eq!(resolve(&automatic).max_opacity(-9000.0, 130.0), 0.0);
    assert!(resolve(&automatic).classify(600.0)[3] > 0.01);
}

#[test]
fn scale_of_the_world_changes_nothing() {
    let small = VolumeDesc { spacing: DVec3::splat(1e-9), ..desc(40) };
    let [a, b] = [desc(40), small].map(|d| resolve(&automatic(&volume(d, ball(40)))));
    for (a, b) in a.points().iter().zip(b.points()) {
        assert!((a.opacity - b.opacity).abs() < 1e-12);
    }
}

#[test]
fn twice_the_voxels_absorb_half_each() {
    let [a, b] = [32, 64].map(|n| resolve(&automatic(&volume(desc(n), ball(n)))).classify(600.0)[3]);
    let ratio = (1.0 - a).ln() / (1.0 - b).ln();
    assert!((ratio - 2.0).abs() < 0.35, "{ratio}");
}

#[test]
fn flat_subjects_are_seen_along_their_thin_axis() {
    let plate = |axis: usize| {
        let inside = move |p: [usize; 3]| (0..3).all(|a| p[a].abs_diff(20) < if a == axis { 4 } else { 16 });
        automatic(&volume(desc(40), move |p| f64::from(u8::from(inside(p))) * (5.0 + 0.1 * p[0] as f64))).view
    };
    assert_eq!([plate(0), plate(1), plate(2)], [View::Right, View::Front, View::Top]);
}

#[test]
fn patients_are_faced() {
    let patient = VolumeDesc { unit: "HU".into(), ..desc(40) };
    assert_eq!(automatic(&volume(patient, ball(40))).view, View::Front);
}

#[test]
fn labels_get_a_colour_each_and_the_nearest_sample() {
    let label = |at: [usize; 3]| match radius(at, 40) {
        _ if at[0] > 35 && at[1] == 39 && at[2] == 0 => 31.0,
        r if r < 0.3 => 7.0,
        r if r < 0.6 => 3.0,
        r if r < 0.8 => 12.0,
        _ => 0.0,
    };
    let automatic = automatic(&volume(desc(40), label));
    let table = resolve(&automatic);
    assert_eq!(automatic.filter, Filter::Nearest);
    assert_eq!(table.classify(0.0)[3], 0.0);
    let colors = [3.0, 7.0, 12.0, 31.0].map(|l| table.classify(l));
    for (i, a) in colors.iter().enumerate() {
        assert!(a[3] > 0.0);
        assert!(colors[..i].iter().all(|b| (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f64>() > 0.2));
    }
}

#[test]
fn smooth_whole_numbers_are_no_labels() {
    let automatic = automatic(&volume(desc(40), |p| (20.0 * (1.0 - radius(p, 40))).max(0.0).round()));
    assert_eq!(automatic.filter, Filter::Linear);
}

/// A machine part by rule, with smooth surfaces, was once taken for a segmentation of 83 labels.
#[test]
fn materials_with_smooth_surfaces_are_no_labels() {
    let value = |p: [usize; 3]| {
        let r = radius(p, 40);
        let share = |at: f64| (0.5 - (r - at) * 12.0).clamp(0.0, 1.0);
        (130.0 * share(0.7) + 95.0 * share(0.35)).round()
    };
    assert_eq!(automatic(&volume(desc(40), value)).filter, Filter::Linear);
}

#[test]
fn a_lonely_subject_is_found_and_all_else_vanishes() {
    let value = |[x, y, z]: [usize; 3]| if [x, y, z] == [20, 21, 22] { 9.5 } else { 1.25 };
    let automatic = automatic(&volume(desc(40), value));
    assert_eq!(resolve(&automatic).classify(1.25)[3], 0.0);
    assert!(resolve(&automatic).classify(9.5)[3] > 0.5);
    assert!(automatic.subject.size().max_element() < 8.0);
}

#[test]
fn a_constant_volume_is_a_faint_box_with_a_note() {
    let automatic = automatic(&volume(desc(8), |_| 5.0));
    let opacity = resolve(&automatic).classify(5.0)[3];
    assert!(opacity > 0.0 && opacity < 0.2);
    assert!(automatic.notes[0].contains("5 everywhere"));
}

#[test]
fn odd_volumes_neither_panic_nor_give_unusable_cameras() {
    for dims in [[1, 1, 1], [2, 1, 1], [1, 9, 1], [16, 16, 1], [1, 1, 70], [3, 2, 5]] {
        for kind in 0..4 {
            let desc = VolumeDesc::new(dims, ScalarType::F32, 1);
            let value = |[x, y, z]: [usize; 3]| [f64::NAN, f64::INFINITY, noise(x, y, z), 1e30 * x as f64][kind];
            let automatic = automatic(&volume(desc, value));
            automatic.frame(32, 24).validate().unwrap();
            assert!(automatic.table.is_some(), "{dims:?} {kind}");
        }
    }
}

#[test]
fn several_components_are_their_own_colours() {
    let desc = VolumeDesc::new([2; 3], ScalarType::U8, 4);
    let automatic = automatic(&Volume::new(desc, vec![9u8; 32]).unwrap());
    assert_eq!(automatic.shader, "simple");
    assert!(automatic.table.is_none());
}
