//! The smallest, the longest, the widest, and what cannot be.

use std::time::{Duration, Instant};

use volact_conformance::{
    metrics::{max_error, outside, within},
    rig::{Setup, draw, on_rays, truth},
    scene::{along_y, ball, constant, greys, lut, volume},
};
use volact_core::{
    ActionError, Camera, FrameDesc, LookupTable, ScalarType, Shape, View, VolumeTexture, WarningCode,
    glam::{DAffine3, DMat3, DVec3},
};

fn table() -> LookupTable {
    greys(&[(0.0, 0.2, 0.05), (200.0, 0.9, 0.4)])
}

/// `cpu` against the reference on the same lattice, in all ways of compositing.
fn agree(what: &str, data: &volact_core::Volume, desc: &dyn Fn(&Shape) -> FrameDesc, step: f64, tolerance: f64) {
    for shader in ["lut", "mip", "minip", "average", "xray"] {
        let shape = volact_conformance::scene::shaded(shader, &VolumeTexture::new(data), table(), 5.0);
        let desc = desc(&shape);
        let wanted = on_rays(std::slice::from_ref(&shape), &desc, step);
        assert!(wanted.lower.iter().any(|c| c[3] > 0.0), "{what}, {shader} shows nothing");
        let found = Setup::post(step).colors(std::slice::from_ref(&shape), &desc);
        within(&format!("{what}, {shader}"), outside(&found, &wanted), tolerance);
    }
}

#[test]
fn volumes_without_extent_along_some_axis() {
    let rule = |p: DVec3| 100.0 + 90.0 * (p.x + 2.0 * p.y + 3.0 * p.z).sin();
    for dims in [[1, 1, 1], [2, 1, 1], [1, 2, 1], [1, 1, 2], [3, 1, 4], [1, 9, 1], [5, 7, 1]] {
        for scalar in ScalarType::ALL {
            let data = volume(dims, scalar, |p| rule(p).round().min(120.0));
            agree(&format!("{dims:?} of {scalar}"), &data, &|s| FrameDesc::fit(s, View::Iso, 7, 6), 0.13, 1e-5);
        }
    }
}

/// Positions are local: an axis of 8192 samples keeps its fractions.
#[test]
fn long_thin_volumes() {
    let rule = |p: DVec3| 100.0 + 90.0 * (0.7 * (p.x + p.y + p.z)).sin();
    for dims in [[1, 1, 8191], [8192, 1, 1], [2, 8192, 3], [1, 2, 16000]] {
        for scalar in [ScalarType::U8, ScalarType::F32] {
            let data = volume(dims, scalar, |p| rule(p).round());
            let middle = DVec3::from_array(dims.map(|n| (n - 1) as f64 / 2.0));
            let desc = |_: &Shape| {
                let target = middle * 1.98;
                let camera = Camera::orthographic(target + DVec3::new(7.0, -9.0, 8.0), target, DVec3::Z, 3.0);
                FrameDesc::new(camera, 8, 8)
            };
            agree(&format!("{dims:?} of {scalar}"), &data, &desc, 0.4, 2e-5);
        }
    }
}

#[test]
fn pictures_of_one_pixel_and_one_row_and_odd_sizes() {
    let data = ball([12, 13, 11], ScalarType::U8);
    for (width, height) in [(1, 1), (1, 511), (511, 1), (3, 5), (17, 2)] {
        let desc = |s: &Shape| FrameDesc::fit(s, View::Iso, width, height);
        agree(&format!("{width} × {height}"), &data, &desc, 0.5, 1e-5);
    }
}

#[test]
fn the_widest_view_and_an_eye_inside() {
    let data = ball([12, 13, 11], ScalarType::I16);
    for (what, fov) in [("wide", 179.0), ("usual", 60.0), ("narrow", 1e-3)] {
        for eye in [
            DVec3::new(5.0, 6.0, 5.0),
            DVec3::new(4.2, 5.2, 6.6),
            DVec3::new(0.0, 0.0, 0.0),
            DVec3::new(6.0, -0.5, 5.0),
        ] {
            let camera = Camera::perspective(eye, DVec3::new(6.1, 9.0, 5.3), DVec3::Z, fov);
            agree(&format!("{what} from {eye}"), &data, &|_| FrameDesc::new(camera, 9, 9), 0.31, 1e-5);
        }
    }
}

#[test]
fn nothing_visible_is_said() {
    let shape = lut(&ball([9, 9, 9], ScalarType::U8), table(), 1.0);
    let away = Camera::perspective(DVec3::new(4.0, -30.0, 4.0), DVec3::new(4.0, -60.0, 4.0), DVec3::Z, 30.0);
    let frame = Setup::cpu().draw(std::slice::from_ref(&shape), &FrameDesc::new(away, 8, 8));
    assert!(frame.color.iter().all(|c| *c == [0.0; 4]));
    assert!(frame.warnings.iter().any(|w| w.code == WarningCode::NothingVisible), "{:?}", frame.warnings);
    let seen = Setup::cpu().draw(std::slice::from_ref(&shape), &FrameDesc::fit(&shape, View::Front, 8, 8));
    assert!(seen.warnings.iter().all(|w| w.code != WarningCode::NothingVisible));
    let nobody = Setup::cpu().draw(&[], &FrameDesc::fit(&shape, View::Front, 8, 8));
    assert!(nobody.color.iter().all(|c| *c == [0.0; 4]));
}

#[test]
fn absurd_steps_are_refused_at_once_or_drawn() {
    let shape = lut(&ball([9, 9, 9], ScalarType::U8), table(), 1.0);
    let desc = FrameDesc::fit(&shape, View::Iso, 4, 4);
    let start = Instant::now();
    for step in [1e-12, 1e-300, f64::MIN_POSITIVE] {
        let error = draw(&mut *Setup::cpu().step(step).action(), std::slice::from_ref(&shape), &desc).unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, ActionError::Limit { .. }) && text.contains("larger sample_distance"), "{text}");
    }
    assert!(start.elapsed() < Duration::from_secs(5));
    // After an error the action is usable again.
    let mut action = Setup::cpu().step(1e-12).action();
    action.manage(&shape).unwrap();
    assert!(action.begin_draw(&desc).is_err());
    action.set_option("sample_distance", 0.5.into()).unwrap();
    draw(&mut *action, std::slice::from_ref(&shape), &desc).unwrap();
    // Larger than the volume: one segment.
    let wanted = Setup::rays(14.0).colors(std::slice::from_ref(&shape), &desc);
    within("one segment", max_error(&Setup::post(14.0).colors(std::slice::from_ref(&shape), &desc), &wanted), 2e-5);
}

/// Far from the eye the numbers of segments pass what 32 bits hold.
#[test]
fn far_eyes_and_fine_steps_count_their_segments_right() {
    let shape = lut(&constant(100.0, [1, 1, 1]), greys(&[(0.0, 0.7, 0.3)]), 1.0);
    let eye = DVec3::new(0.5, -3e9, 0.5);
    let camera = Camera::perspective(eye, DVec3::new(0.5, 0.0, 0.5), DVec3::Z, 1e-9);
    for desc in [FrameDesc::new(camera, 1, 1), along_y(0.5, 0.5)] {
        let found = Setup::post(0.1).pixel(&shape, &desc);
        // f64 holds positions 3e9 away to 4e-7.
        within("far", max_error(&[found], &[[0.21, 0.21, 0.21, 0.3]]), 4e-6);
    }
}

#[test]
fn maps_that_are_nearly_none_are_refused_or_right() {
    let shape = lut(&ball([9, 9, 9], ScalarType::U8), table(), 1.0);
    let desc = FrameDesc::fit(&shape, View::Iso, 6, 6);
    let columns = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::X + DVec3::Y);
    for map in [
        DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)),
        DAffine3::from_mat3(columns),
        DAffine3::from_scale(DVec3::splat(1e-200)),
        DAffine3::from_translation(DVec3::splat(f64::NAN)),
        DAffine3::from_translation(DVec3::splat(f64::INFINITY)),
    ] {
        shape.set_transform(map);
        for name in ["cpu", "reference"] {
            let error = draw(&mut *Setup::new(name).action(), std::slice::from_ref(&shape), &desc).unwrap_err();
            assert!(matches!(error, ActionError::Transform { .. }), "{name}, {map:?}: {error}");
        }
    }
    // Thin, but a volume: drawn, and right.
    let thin = lut(&constant(100.0, [2, 2, 2]), greys(&[(0.0, 1.0, 0.5)]), 1e-5);
    thin.set_transform(DAffine3::from_scale(DVec3::new(1.0, 1e-5, 1.0)));
    let wanted = [[1.0 - 0.25; 4]];
    within("thin, exact", max_error(&[truth(std::slice::from_ref(&thin), &along_y(0.5, 0.5)).color[0]], &wanted), 1e-9);
    // f64 holds positions 100 away to 1e-14, of a length of 2e-5.
    within("thin", max_error(&[Setup::post(1e-6).pixel(&thin, &along_y(0.5, 0.5))], &wanted), 4e-6);
}

#[test]
fn frames_that_cannot_be_are_refused() {
    let shape = lut(&ball([9, 9, 9], ScalarType::U8), table(), 1.0);
    let good = FrameDesc::fit(&shape, View::Iso, 6, 6);
    let bad = [
        (FrameDesc { width: 0, ..good.clone() }, "size is 0"),
        (FrameDesc { width: usize::MAX, height: 2, ..good.clone() }, "size is"),
        (FrameDesc { depth_threshold: 0.0, ..good.clone() }, "depth threshold"),
        (good.clone().with_background([0.0, 0.0, f32::NAN, 1.0]), "background"),
        (FrameDesc::new(Camera::perspective(DVec3::ONE, DVec3::ONE, DVec3::Z, 30.0), 4, 4), "eye"),
        (FrameDesc::new(Camera::perspective(DVec3::ONE, DVec3::ZERO, DVec3::Z, 180.0), 4, 4), "field of view"),
    ];
    for name in ["cpu", "reference", "null"] {
        let mut action = Setup::new(name).action();
        action.manage(&shape).unwrap();
        for (desc, words) in &bad {
            let error = action.begin_draw(desc).unwrap_err().to_string();
            assert!(error.contains(words), "{name}: {error}, wanted {words}");
        }
        action.begin_draw(&good).unwrap();
    }
}

/// Values at the ends of what a type holds, and infinite ones, which clamp in the table.
#[test]
fn extreme_values_agree() {
    for (scalar, top) in [
        (ScalarType::U8, 255.0),
        (ScalarType::U16, 65535.0),
        (ScalarType::U32, 4_294_967_295.0),
        (ScalarType::F32, 3e38),
    ] {
        let data = volume([5, 5, 5], scalar, |p| if (p.x + p.y + p.z) % 2.0 == 0.0 { top } else { 0.0 });
        let table = greys(&[(0.0, 0.2, 0.0), (top, 0.9, 0.6)]);
        let shape = [lut(&data, table, 1.0)];
        let desc = FrameDesc::fit(&shape[0], View::Iso, 8, 8);
        let wanted = Setup::rays(0.21).colors(&shape, &desc);
        within(&format!("{scalar}"), max_error(&Setup::post(0.21).colors(&shape, &desc), &wanted), 1e-5);
    }
    for v in [f64::INFINITY, f64::NEG_INFINITY] {
        let shape = [lut(&volume([3, 3, 3], ScalarType::F32, |_| v), greys(&[(0.0, 0.2, 0.3), (1.0, 0.9, 0.6)]), 1.0)];
        let a = if v > 0.0 { 1.0 - 0.4f64.powi(2) } else { 1.0 - 0.7f64.powi(2) };
        let grey = if v > 0.0 { 0.9 } else { 0.2 };
        let desc = along_y(1.0 - 1e-3, 1.0);
        for setup in [Setup::exact(), Setup::rays(0.3)] {
            within("infinite", max_error(&[setup.pixel(&shape[0], &desc)], &[[grey * a, grey * a, grey * a, a]]), 4e-6);
        }
    }
}
