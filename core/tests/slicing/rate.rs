//! How many planes there are.

use volact_core::{
    FrameDesc, Shape,
    glam::{DAffine3, DVec3},
    slicing::{Levels, Planner, Rate, Sampling, SamplingSpace, Slicing, Step},
};

use super::common::{along, cube, from_eye, solids};

fn step(shape: &Shape, frame: &FrameDesc, sampling: &Sampling) -> Step {
    let solids = solids(std::slice::from_ref(shape));
    *Slicing::new(solids.iter().collect(), frame, sampling).unwrap().step()
}

fn period(period: [f64; 3]) -> Sampling {
    Sampling { rate: Rate::Period(period), ..Sampling::default() }
}

/// The shape away from the lattice's origin by no round number.
fn placed(n: usize) -> Shape {
    let shape = cube(n);
    shape.set_transform(DAffine3::from_translation(DVec3::new(0.37, -0.41, 0.73)));
    shape
}

#[test]
fn a_period_of_one_gives_n_planes_head_on() {
    for n in [5, 16, 64] {
        for direction in [DVec3::X, DVec3::NEG_Y, DVec3::Z] {
            let made = step(&placed(n), &along(direction), &period([1.0; 3]));
            assert_eq!((made.distance, made.planes), (1.0, n));
            assert_eq!(step(&placed(n), &along(direction), &period([0.5; 3])).planes, 2 * n - 1);
        }
    }
}

#[test]
fn along_the_diagonal_there_are_root_three_times_as_many() {
    for n in [5, 16, 64] {
        let made = step(&placed(n), &along(DVec3::ONE), &period([1.0; 3]));
        assert!((made.distance - 1.0).abs() < 1e-12);
        let wanted = 3f64.sqrt() * n as f64;
        assert!((made.planes as f64 - wanted).abs() <= 1.8, "{n}: {} of {wanted}", made.planes);
    }
}

#[test]
fn each_axis_has_its_period() {
    for (direction, distance) in [(DVec3::X, 2.0), (DVec3::Y, 3.0), (DVec3::Z, 0.5)] {
        assert_eq!(step(&cube(9), &along(direction), &period([2.0, 3.0, 0.5])).distance, distance);
    }
    // Voxels count as they lie in the world.
    let wide = cube(9);
    wide.set_transform(DAffine3::from_scale(DVec3::new(4.0, 1.0, 1.0)));
    assert_eq!(step(&wide, &along(DVec3::X), &period([1.0; 3])).distance, 4.0);
    // The finest shape decides.
    let solids = solids(&[wide, cube(9)]);
    let slicing = Slicing::new(solids.iter().collect(), &along(DVec3::X), &period([1.0; 3])).unwrap();
    assert_eq!(slicing.step().distance, 1.0);
    // Where each has a lattice of its own it decides for itself.
    let alone = Sampling { space: SamplingSpace::Object, ..period([1.0; 3]) };
    let slicing = Slicing::new(solids.iter().collect(), &along(DVec3::X), &alone).unwrap();
    assert_eq!([slicing.slabs(0).step, slicing.slabs(1).step], [4.0, 1.0]);
}

#[test]
fn a_count_is_an_upper_bound_and_widens_the_step() {
    let views = [along(DVec3::new(0.3, 1.0, 0.2)), from_eye(DVec3::new(3.0, -30.0, 9.0), DVec3::splat(4.0))];
    for frame in views {
        for space in [SamplingSpace::ViewVolume, SamplingSpace::Object, SamplingSpace::Primitive] {
            for most in [2, 3, 7, 10, 31] {
                let sampling = Sampling { most_planes: Some(most), space, ..period([0.1; 3]) };
                let made = step(&placed(9), &frame, &sampling);
                assert!(made.planes <= most && made.planes * 2 >= most, "{most}: {made:?} {space:?}");
                assert!(made.is_widened() && made.wanted < 0.11);
            }
            let loose = Sampling { most_planes: Some(1000), space, ..period([0.5; 3]) };
            assert!(!step(&placed(9), &frame, &loose).is_widened());
        }
    }
}

#[test]
fn accuracy_is_left_to_a_planner() {
    let planner = Planner::new(|solids, levels| {
        assert!(solids.len() == 1 && matches!(levels, Levels::Planes { .. }));
        0.25
    });
    let sampling = Sampling { rate: Rate::Accuracy(planner), ..Sampling::default() };
    assert_eq!(step(&cube(5), &along(DVec3::Y), &sampling).distance, 0.25);
    let fixed = Sampling { rate: Rate::Distance(0.125), ..Sampling::default() };
    assert_eq!(step(&cube(5), &along(DVec3::Y), &fixed).distance, 0.125);
}
