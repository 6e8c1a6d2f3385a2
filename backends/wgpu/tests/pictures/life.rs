//! What is moved and made from frame to frame, what is refused, and what never differs.

use std::{error::Error, sync::Arc};

use volact_conformance::{
    metrics::{identical, max_error, wide, within},
    rig::{Setup, draw_managed},
    scene::{ball, colors, greys, lut, lut_of, shaded, square, volume},
};
use volact_core::{
    Compositing, Declaration, Frame, FrameDesc, Options, ParameterDecl, ParameterType, RenderAction, ScalarType,
    ShaderEntry, ShaderText, Shape, Volume, VolumeDesc, VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::Kind,
};

use crate::common::{draw, draw_in, rays, registry};

const STEP: f64 = 0.31;

fn view() -> FrameDesc {
    square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 24)
}

fn warm() -> volact_core::LookupTable {
    colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.9)])
}

fn a_ball() -> Shape {
    lut(&ball([20, 24, 28], ScalarType::U8), warm(), 1.0)
}

fn far() -> FrameDesc {
    square(DVec3::splat(12.0), DVec3::new(4.0, -9.0, 5.0), 36.0, 24)
}

/// An error with its causes.
fn told(error: &dyn Error) -> String {
    error.source().map_or(error.to_string(), |cause| format!("{error}: {}", told(cause)))
}

fn made(frame: &Frame) -> Vec<String> {
    frame.statistics.rebuilt.iter().map(|r| r.what.clone()).collect()
}

#[test]
fn a_frame_like_the_last_moves_and_makes_nothing() {
    let (shape, desc) = (a_ball(), far());
    let mut action = rays(STEP).action_in(&registry());
    let shapes = std::slice::from_ref(&shape);
    action.manage(&shape).unwrap();
    let first = draw_managed(&mut *action, shapes, &desc).unwrap();
    assert_eq!(made(&first), ["texture", "pipeline", "occupancy"]);
    assert!(first.statistics.uploaded_bytes >= 20 * 24 * 28);
    let second = draw_managed(&mut *action, shapes, &desc).unwrap();
    assert_eq!((made(&second).len(), second.statistics.uploaded_bytes), (0, 0));
    assert!(identical(&first, &second));
    // A table moves itself, and what it empties is found on the device.
    shape.set_parameter("lookup_table", greys(&[(50.0, 0.2, 0.0), (90.0, 1.0, 0.4), (91.0, 0.5, 0.1)]));
    let third = draw_managed(&mut *action, shapes, &desc).unwrap();
    assert_eq!(made(&third), ["occupancy"]);
    assert!((1..=16 * 64).contains(&third.statistics.uploaded_bytes), "{}", third.statistics.uploaded_bytes);
    // A camera moves the frame and the shape's place.
    let turned = square(DVec3::splat(12.0), DVec3::new(9.0, -4.0, 5.0), 36.0, 24);
    let fourth = draw_managed(&mut *action, shapes, &turned).unwrap();
    assert_eq!(made(&fourth).len(), 0);
    assert!((1..600).contains(&fourth.statistics.uploaded_bytes), "{}", fourth.statistics.uploaded_bytes);
    // Another shader moves no voxel.
    shape.set_shader("gradient");
    let fifth = draw_managed(&mut *action, shapes, &turned).unwrap();
    assert_eq!(made(&fifth)[0], "pipeline");
    assert!(fifth.statistics.uploaded_bytes < 2000, "{}", fifth.statistics.uploaded_bytes);
}

#[test]
fn voxels_changed_in_place_are_moved_again() {
    let volume = volume([8, 8, 8], ScalarType::U8, |p| 20.0 * p.x);
    let shape = lut(&volume, warm(), 1.0);
    let mut action = rays(STEP).action_in(&registry());
    action.manage(&shape).unwrap();
    let shapes = std::slice::from_ref(&shape);
    draw_managed(&mut *action, shapes, &view()).unwrap();
    volume.touch();
    let again = draw_managed(&mut *action, shapes, &view()).unwrap();
    assert_eq!((made(&again), again.statistics.uploaded_bytes), (vec!["texture".into(), "occupancy".into()], 512));
}

#[test]
fn one_volume_in_two_shapes_is_resident_once() {
    let volume = ball([20, 24, 28], ScalarType::U8);
    let [a, b] = [lut(&volume, warm(), 1.0), lut(&volume, greys(&[(0.0, 1.0, 0.1)]), 2.0)];
    b.set_transform(DAffine3::from_translation(DVec3::X * 5.0));
    let frame = draw(&rays(STEP), &[a, b], &far());
    let textures = made(&frame).iter().filter(|what| *what == "texture").count();
    assert_eq!(textures, 1);
}

#[test]
fn skipping_changes_no_bit_and_saves_samples() {
    let desc = far();
    let other = lut(&ball([20, 24, 28], ScalarType::F32), greys(&[(100.0, 0.0, 0.0), (180.0, 1.0, 0.5)]), 1.0);
    other.set_transform(DAffine3::from_translation(DVec3::new(3.0, 2.0, 1.0)) * DAffine3::from_rotation_z(0.3));
    let lit = shaded("gradient", &VolumeTexture::new(&ball([20, 24, 28], ScalarType::U16)), warm(), 1.0);
    for shapes in [vec![a_ball()], vec![a_ball(), other], vec![lit]] {
        let [with, without] = [true, false].map(|on| draw(&rays(STEP).with("skipping", on), &shapes, &desc));
        assert!(identical(&with, &without));
        let samples = [&with, &without].map(|f| f.statistics.samples);
        assert!(samples[0] < samples[1] * 4 / 5, "{samples:?}");
        // What was not taken is counted, and rays that took nothing are rays all the same.
        let counts = [&with, &without].map(|f| (f.statistics.samples + f.statistics.skipped, f.statistics.rays));
        assert_eq!(counts[0], counts[1]);
        assert_eq!(without.statistics.skipped, 0);
        let ended = rays(STEP).with("termination", 0.05);
        let [with, without] = [true, false].map(|on| draw(&ended.clone().with("skipping", on), &shapes, &desc));
        assert!(identical(&with, &without));
    }
}

#[test]
fn the_order_of_drawing_means_nothing() {
    let [a, b] = [a_ball(), lut(&ball([20, 24, 28], ScalarType::F32), greys(&[(0.0, 1.0, 0.1)]), 2.0)];
    let one = draw(&rays(STEP), &[a.clone(), b.clone()], &far());
    assert!(identical(&one, &draw(&rays(STEP), &[b, a], &far())));
}

#[test]
fn coarse_formats_and_filters_are_as_wrong_as_they_say() {
    let smooth = volume([9, 9, 9], ScalarType::F32, |p| 100.0 + 90.0 * (0.5 * p.x).sin() * (0.4 * p.y + p.z).cos());
    // Opacity and colour rise by at most 1/190 a unit of value.
    let shape = lut_of(&VolumeTexture::new(&smooth), greys(&[(5.0, 0.0, 0.0), (195.0, 1.0, 1.0)]), 20.0);
    let exact = wide(&draw(&rays(STEP), std::slice::from_ref(&shape), &view()));
    let off = |setup: Setup| max_error(&wide(&draw(&setup, std::slice::from_ref(&shape), &view())), &exact);
    // Half a step of 190 units, in colour and in an opacity of which less than half is seen.
    for (format, steps) in [("r8", 255.0), ("r16", 65535.0), ("r16f", 2048.0)] {
        let error = off(rays(STEP).with("format", format));
        within(format, error, 1.5 * 0.5 / steps);
        assert!(error > 0.0, "{format} draws like r32f");
    }
    // Samplers have at least 8 bits of weight in each of three axes; values differ by 60 in a cell.
    within("hardware", off(rays(STEP).with("filter", "hardware")), 1.5 * 3.0 * 60.0 / 190.0 / 256.0);
}

fn looping(text: &str) -> (volact_core::Registry, Shape) {
    let mut all = registry();
    let declaration = Declaration::new(Kind::Shader, "looping", "1", "loops")
        .with(ParameterDecl::new("volume", ParameterType::Volume, "data").required());
    let source = Some(Arc::new(ShaderText { file: "looping.wgsl".into(), text: text.into() }));
    all.add_shader(ShaderEntry { declaration, compositing: Compositing::Over, source }).unwrap();
    let shape = a_ball();
    shape.set_shader("looping");
    (all, shape)
}

#[test]
fn loops_without_end_are_an_error_that_names_the_shader() {
    let text = "fn shade(s: Sample) -> Medium {
        var n = 0.0;
        loop { n += 1.0; if n < 0.0 { break; } }
        return Medium(vec3<f32>(n), 1.0);
    }";
    let (registry, shape) = looping(text);
    let mut action = rays(30.0).action_in(&registry);
    action.manage(&shape).unwrap();
    let shapes = std::slice::from_ref(&shape);
    let desc = square(DVec3::splat(12.0), DVec3::new(4.0, -9.0, 5.0), 36.0, 2);
    let error = told(&draw_managed(&mut *action, shapes, &desc).unwrap_err());
    assert!(error.contains("looping") && error.contains("rounds of loops"), "{error}");
    shape.set_shader("lut");
    assert!(draw_managed(&mut *action, shapes, &desc).is_ok());
}

#[test]
fn loops_within_the_budget_are_right() {
    let text = "fn shade(s: Sample) -> Medium {
        var sum = 0.0;
        for (var i = 0; i < 100; i++) { if i % 2 == 0 { continue; } sum += 0.01; }
        return Medium(vec3<f32>(sum), 0.1);
    }";
    let (registry, shape) = looping(text);
    let frame = draw_in(&registry, &rays(STEP), &[shape], &far());
    let middle = frame.pixel(12, 12);
    assert!((middle[0] / middle[3] - 0.5).abs() < 1e-5, "{middle:?}");
}

/// A device that ends loops early, as llvmpipe does after 65,535 rounds, is an error, not another picture.
#[test]
fn loops_that_a_device_cuts_short_are_an_error() {
    let text = |rounds: u32| {
        format!(
            "fn shade(s: Sample) -> Medium {{
                var n = 0u;
                for (var i = 0u; i < {rounds}u; i++) {{ n += 1u; }}
                return Medium(vec3<f32>(f32(n) / {rounds}.0), 0.1);
            }}"
        )
    };
    let desc = square(DVec3::splat(12.0), DVec3::new(4.0, -9.0, 5.0), 36.0, 3);
    let mut pictures = Vec::new();
    for method in ["rays", "slices"] {
        for rounds in [10, 1_000, 4_000, 12_000, 30_000] {
            let (registry, shape) = looping(&text(rounds));
            let mut action = rays(0.7).with("method", method).action_in(&registry);
            let device = action.caps().device;
            action.manage(&shape).unwrap();
            match draw_managed(&mut *action, &[shape], &desc) {
                Ok(frame) => pictures.push(frame.pixel(1, 1)),
                Err(error) => {
                    let told = told(&error);
                    assert!(told.contains("number of rounds of loops along a ray"), "{told}");
                    assert!(device.contains("llvmpipe") && rounds > 1_000, "{device}, {rounds} rounds");
                }
            }
        }
    }
    let first = pictures[0];
    assert!(first[3] > 0.5 && (first[0] / first[3] - 1.0).abs() < 1e-5, "{first:?}");
    for found in pictures {
        assert!(found.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}, wanted {first:?}");
    }
    // Many samples are as many rounds.
    let shape = a_ball();
    let wanted = draw(&rays(0.05), std::slice::from_ref(&shape), &desc).pixel(1, 1);
    let mut action = rays(0.0005).action_in(&registry());
    action.manage(&shape).unwrap();
    match draw_managed(&mut *action, &[shape], &desc) {
        Ok(frame) => {
            assert!((frame.pixel(1, 1)[3] - wanted[3]).abs() < 1e-3, "{:?}, wanted {wanted:?}", frame.pixel(1, 1))
        }
        Err(error) => assert!(told(&error).contains("rounds of loops along a ray"), "{}", told(&error)),
    }
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let registry = registry();
    let mut action = rays(STEP).action_in(&registry);
    let refused = |action: &mut dyn RenderAction, shape: &Shape| told(&action.manage(shape).unwrap_err());
    let pre = shaded("mip", &VolumeTexture::new(&ball([4, 4, 4], ScalarType::U8)), warm().pre_interpolated(), 1.0);
    assert!(refused(&mut *action, &pre).contains("pre-interpolated table \"lookup_table\""));
    let other = a_ball();
    other.set_parameter("component", 2i64);
    assert!(refused(&mut *action, &other).contains("component 2 of parameter \"volume\" with 1"));
    let options = Options::from([("adapter".to_owned(), "no such thing".into())]);
    let error = registry.action("wgpu", &options).map(|_| ()).unwrap_err();
    assert!(told(&error).contains("no adapter with \"no such thing\" in its name; found: "), "{}", told(&error));
    // Larger than any 3D texture.
    let long = Volume::new(VolumeDesc::new([1 << 16, 1, 2], ScalarType::U8, 1), vec![0u8; 1 << 17]).unwrap();
    let shape = lut(&long, warm(), 1.0);
    action.manage(&shape).unwrap();
    let error = told(&draw_managed(&mut *action, &[shape], &view()).unwrap_err());
    assert!(error.contains("65536 × 1 × 2") && error.contains("at most"), "{error}");
    let holes = volume([4, 4, 4], ScalarType::F32, |p| if p.x == 1.0 { f64::NAN } else { p.y });
    let mut action = rays(STEP).with("format", "r8").action_in(&registry);
    let shape = lut(&holes, warm(), 1.0);
    action.manage(&shape).unwrap();
    let error = told(&draw_managed(&mut *action, &[shape], &view()).unwrap_err());
    assert!(error.contains("format of whole numbers"), "{error}");
}

#[test]
fn a_frame_without_shapes_is_transparent() {
    let frame = draw(&rays(STEP), &[], &view());
    assert!(frame.color.iter().all(|c| *c == [0.0; 4]) && frame.depth.iter().all(|d| *d == f32::INFINITY));
}

#[test]
fn a_frame_says_how_it_was_made() {
    let frame = draw(&rays(STEP), &[a_ball()], &far());
    let method = &frame.method;
    assert_eq!((method.sample_distance, method.texture_format.as_str(), method.blend.as_str()), (STEP, "r8", "f32"));
    assert!(frame.statistics.rays > 100 && frame.statistics.samples > frame.statistics.rays);
    assert!(!method.device.is_empty() && frame.statistics.resident_bytes > 0);
}
