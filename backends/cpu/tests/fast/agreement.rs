//! Agreement with `reference`, and bits that must not change.

use volact_core::{Frame, ParameterValue, Shape};

use super::scenes::{Scene, action, all, cpu, draw};

const STEP: f64 = 0.47;

fn same(a: &Frame, b: &Frame) -> bool {
    let bits = |f: &Frame| {
        let color = f.color.iter().flatten().map(|v| v.to_bits());
        color.chain(f.depth.iter().map(|v| v.to_bits())).collect::<Vec<_>>()
    };
    bits(a) == bits(b)
}

/// Pixels of which a channel differs by more than a bound, and the largest difference.
fn differing(a: &Frame, b: &Frame, bound: f32) -> (usize, f32) {
    let each = a.color.iter().zip(&b.color);
    let differences = each.map(|(a, b)| (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max));
    differences.fold((0, 0.0), |(count, most), d| (count + usize::from(d > bound), f32::max(most, d)))
}

/// A picture of `reference`, and one of `cpu` that should be the same. Meshes of numbers are on no
/// lattice here: with them a fine one is compared with the certified integral.
fn pair(Scene { shapes, desc, .. }: &Scene) -> (Frame, Frame) {
    let cells = shapes.iter().any(|s| s.state().shader == "attribute");
    let (step, method) = if cells { (0.02, "exact") } else { (STEP, "rays") };
    let options = [("method", method.into()), ("sample_distance", step.into())];
    let found = draw(&mut *cpu(step, &[("termination", 0.0.into())]), shapes, desc);
    (found, draw(&mut *action("reference", &options), shapes, desc))
}

/// f32 interpolation of values of 200, on tables that rise by up to 1 in 300, over 80 segments;
/// fields of meshes are integrated by tables in f32. At the edge of a wall a ray may meet it here
/// and miss it there.
#[test]
fn every_scene_agrees_with_the_reference() {
    let mut wrong = Vec::new();
    for scene in all(30) {
        let (found, wanted) = pair(&scene);
        let (count, most) = differing(&found, &wanted, 2e-5);
        let depths = found.depth.iter().zip(&wanted.depth);
        let far = depths.filter(|(a, b)| a.is_finite() != b.is_finite() || a.is_finite() && (**a - **b).abs() > 1e-3);
        let far: Vec<_> = far.collect();
        println!("{}: {most:.1e}, {count} pixels beyond, {} depths", scene.name, far.len());
        let seen = wanted.color.iter().any(|c| c[3] > 0.05);
        if !seen || count > 2 || far.len() > 3 {
            wrong.push(format!(
                "{}: {count} pixels by up to {most:e}, depths {:?}",
                scene.name,
                far.iter().take(5).collect::<Vec<_>>()
            ));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Draws every scene as it is and in another way, and compares bits.
fn unchanged(what: &str, pixels: usize, plain: &[(&str, ParameterValue)], others: &[&[(&str, ParameterValue)]]) {
    for Scene { name, shapes, desc } in all(pixels) {
        let first = draw(&mut *cpu(STEP, plain), &shapes, &desc);
        for other in others {
            assert!(same(&first, &draw(&mut *cpu(STEP, other), &shapes, &desc)), "{name}: {what}: {other:?}");
        }
    }
}

#[test]
fn number_of_threads_leaves_every_bit() {
    let threads = |n: i64| [("threads", n.into())];
    unchanged("threads", 40, &threads(1), &[&threads(2), &threads(3), &threads(8)]);
}

#[test]
fn skipping_leaves_every_bit() {
    for termination in [0.0, 1.0 / 255_000.0, 0.2] {
        let skipping = |on: bool| [("skipping", on.into()), ("termination", termination.into())];
        unchanged("skipping", 24, &skipping(true), &[&skipping(false)]);
    }
}

#[test]
fn pre_integrated_pictures_keep_their_bits_too() {
    for Scene { name, shapes, desc } in all(20) {
        let options = |skipping: bool, threads: i64| {
            [("classification", "pre-integrated".into()), ("skipping", skipping.into()), ("threads", threads.into())]
        };
        let first = draw(&mut *cpu(STEP, &options(true, 1)), &shapes, &desc);
        assert!(same(&first, &draw(&mut *cpu(STEP, &options(false, 3)), &shapes, &desc)), "{name}");
    }
}

/// Any permutation for few shapes, rotations and the reverse for many. Shapes that are one picture
/// each lie over each other in the order of drawing and are left out.
#[test]
fn order_of_drawing_leaves_every_bit() {
    for Scene { name, shapes, desc } in
        all(24).into_iter().filter(|s| s.shapes.len() > 1 && !s.name.starts_with("flat"))
    {
        let first = draw(&mut *cpu(STEP, &[]), &shapes, &desc);
        let mut orders: Vec<Vec<Shape>> =
            (1..shapes.len().min(4)).map(|by| [&shapes[by..], &shapes[..by]].concat()).collect();
        orders.push(shapes.iter().rev().cloned().collect());
        for order in orders {
            assert!(same(&first, &draw(&mut *cpu(STEP, &[]), &order, &desc)), "{name}");
        }
    }
}

/// Units with fused multiply-add give the same bits; the plain one rounds more often.
#[test]
fn vector_units_agree() {
    for Scene { name, shapes, desc } in all(20) {
        let draw_on = |unit: &str| {
            let mut registry = volact_core::Registry::with_core();
            volact_cpu::register(&mut registry).unwrap();
            let options = [("unit", unit.into()), ("sample_distance", STEP.into()), ("classification", "post".into())];
            let options = options.into_iter().map(|(n, v): (&str, ParameterValue)| (n.to_owned(), v)).collect();
            registry.action("cpu", &options).ok().map(|mut action| draw(&mut *action, &shapes, &desc))
        };
        let plain = draw_on("plain").unwrap();
        let fused: Vec<Frame> = ["avx2", "avx512"].into_iter().filter_map(draw_on).collect();
        assert!(fused.windows(2).all(|pair| same(&pair[0], &pair[1])), "{name}: AVX2 and AVX-512");
        for frame in &fused {
            let (count, most) = differing(frame, &plain, 2e-5);
            assert!(count <= 2, "{name}: {count} pixels differ from plain by up to {most}");
        }
    }
}

/// Steps between shapes that are far apart are not counted one by one.
#[test]
fn gaps_between_shapes_cost_nothing() {
    let volume = super::scenes::ball(volact_core::ScalarType::U8);
    let shapes: Vec<Shape> = (0..4)
        .map(|i| {
            let shape = super::scenes::lut(&volume, super::scenes::warm());
            let far = volact_core::glam::DVec3::new(-14.0, 30.0, -17.0) * if i < 2 { 0.0 } else { 1e8 } + f64::from(i);
            shape.set_transform(volact_core::glam::DAffine3::from_translation(far));
            shape
        })
        .collect();
    let desc = all(8).swap_remove(0).desc;
    let near = draw(&mut *cpu(STEP, &[]), &shapes[..2], &desc);
    let both = draw(&mut *cpu(STEP, &[]), &shapes, &desc);
    assert!(near.color.iter().any(|c| c[3] > 0.0));
    assert!(near.color.iter().zip(&both.color).all(|(a, b)| b[3] >= a[3]));
}
