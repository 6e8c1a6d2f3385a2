//! 4: cells: cycles of visibility, slivers, rays along faces.

use std::cmp::Ordering;

use volact_core::{
    Mesh, Shape,
    glam::{DAffine3, DVec3},
};

use super::{
    Answer, Does, Family, Ladder, Measured, Method,
    lab::{Lab, certified, ensure, refused_with},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::{absorbed, around, warm},
    meshes::{cube, field, look, scalars_of, tetrahedra, tube},
    metrics::max_error,
    rig::{Scene, Setup},
    scene::{colors, constant, greys, lut, one_ray, square},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 4,
        title: "Order of cells, slivers, rays along faces",
        about: "Whole cells or parts cannot be sorted where they overlap in a cycle: each lies before the next, and \
                the last before the first. A cell pressed flat has no volume to divide by. A ray that runs in the \
                face between two cells is in both or in none, if each tests for itself. Where a mesh has holes, or \
                cells lie in one another, a ray's first way in and last way out say little.",
        ladders: vec![cycle(), hollow(), pushed(), slivers(), faces(), vertices()],
        answers: answers(),
    }
}

/// Three tilted bars around the line of sight, each over the next where they are long enough.
fn bars(length: f64) -> Scene {
    let tints = [[1.0, 0.2, 0.1], [0.1, 1.0, 0.2], [0.2, 0.1, 1.0]];
    let bar = |i: usize| {
        let shape = lut(&constant(1.0, [2, 2, 2]), colors(&[(1.0, tints[i], 0.9)]), 0.5);
        let box_ = DAffine3::from_scale(DVec3::new(0.5 * length, 0.25, 0.25)) * DAffine3::from_translation(-DVec3::ONE);
        let tilted = DAffine3::from_translation(DVec3::Z) * DAffine3::from_rotation_z(0.45) * box_;
        shape.set_transform(DAffine3::from_rotation_y(std::f64::consts::TAU / 3.0 * i as f64) * tilted);
        shape
    };
    Scene::new((0..3).map(bar), square(DVec3::new(0.013, 0.0, 0.017), -20.0 * DVec3::Y, 6.0, 32))
}

fn cycle() -> Ladder {
    let of = |how: Setup| move |lab: &Lab, length: f64| lab.from_truth(&how, &bars(length));
    Ladder {
        name: "cycle",
        title: "Three bars, each before the next",
        knob: "length of the bars; they overlap from about 3 on",
        truth: "`reference`",
        rungs: vec![1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0],
        methods: vec![
            Method::holds("cpu", 1e-4, of(Setup::post(0.05))),
            Method::holds("wgpu, rays", 1e-3, of(Setup::new("wgpu").step(0.05))),
            Method::holds("wgpu, slices", 1e-3, of(Setup::new("wgpu").with("method", "slices").step(0.05))),
            Method::fails("model: bars sorted as wholes", (1e-4, [0.3, 1.0]), |_, length| {
                let scene = bars(length);
                Ok(max_error(&Naive { step: 0.05, mistake: Mistake::None }.draw(&scene)?, &certified(&scene)?))
            }),
        ],
    }
}

/// The unit cube as twelve tetrahedra around a point so high above its lower face.
fn pressed(height: f64) -> Mesh {
    let mut points: Vec<DVec3> =
        (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2 & 1))).collect();
    points.push(DVec3::new(0.43, 0.58, height));
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let cells: Vec<[u32; 4]> = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c, 8], [*a, *c, *d, 8]]).collect();
    tetrahedra(points, &cells)
}

fn of_mesh(mesh: Mesh) -> Scene {
    let mut scene = around([field(mesh, |p| 20.0 + 30.0 * p.x + 45.0 * p.z, warm(), 0.3)]);
    (scene.desc.width, scene.desc.height) = (16, 16);
    scene
}

fn slivers() -> Ladder {
    // A linear field is the same however its cube is cut.
    let of = |how: Setup| {
        move |lab: &Lab, height: f64| lab.error(&how, &of_mesh(pressed(height)), &certified(&of_mesh(cube(5)))?)
    };
    Ladder {
        name: "slivers",
        title: "A cube cut around a point that sinks into its lower face",
        knob: "height of the flattest cells; their width is 1",
        truth: "`reference` of the cube cut in five",
        rungs: vec![0.5, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12, 1e-16, 1e-24],
        methods: vec![
            Method::holds("reference", 1e-6, of(Setup::exact())),
            Method::holds("cpu", 1e-4, of(Setup::cpu())),
            Method::holds("wgpu", 1e-4, of(Setup::new("wgpu"))),
        ],
    }
}

/// A ray so far beside the face x = z that many cells of the cube share.
fn beside(distance: f64) -> Scene {
    let mesh = cube(6);
    let ones = scalars_of(&mesh, |_| 1.0);
    let shape = Shape::new(mesh, look(ones, greys(&[(1.0, 1.0, 0.5)]), 1.0));
    let from = DVec3::new(0.4 + distance, -3.0, 0.4);
    Scene::new([shape], one_ray(from, from + DVec3::Y))
}

fn faces() -> Ladder {
    let of = |how: Setup| {
        move |lab: &Lab, distance: f64| -> Measured { lab.error(&how, &beside(distance), &[[absorbed(0.5, 1.0); 4]]) }
    };
    Ladder {
        name: "along-faces",
        title: "A ray nearer and nearer to the face between cells",
        knob: "distance from the face; cells are 1 wide",
        truth: "closed form, 0.5",
        rungs: vec![0.1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-17],
        methods: vec![
            Method::holds("reference", 1e-6, of(Setup::exact())),
            Method::holds("cpu", 1e-5, of(Setup::cpu())),
            Method::holds("wgpu", 1e-5, of(Setup::new("wgpu"))),
            Method::fails("model: cells that each test for themselves", (1e-9, [0.499, 0.501]), |_, distance| {
                let found = stretches(&cube(6), DVec3::new(0.4 + distance, -3.0, 0.4));
                Ok((absorbed(0.5, found.iter().map(|[a, b]| b - a).sum()) - 0.5).abs())
            }),
        ],
    }
}

/// Where a ray along y is strictly inside each cell of a mesh, which knows nothing of its neighbours.
fn stretches(mesh: &Mesh, from: DVec3) -> Vec<[f64; 2]> {
    let inside = |cell: [DVec3; 4]| {
        let mut ends = [f64::NEG_INFINITY, f64::INFINITY];
        for [a, b, c, opposite] in [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]].map(|f| f.map(|i| cell[i]))
        {
            let normal = (b - a).cross(c - a);
            let normal = normal * normal.dot(opposite - a).signum();
            let (height, slope) = (normal.dot(from - a), normal.y);
            match slope.total_cmp(&0.0) {
                _ if slope == 0.0 && height <= 0.0 => return None,
                _ if slope == 0.0 => {}
                Ordering::Greater => ends[0] = ends[0].max(-height / slope),
                _ => ends[1] = ends[1].min(-height / slope),
            }
        }
        (ends[0] < ends[1]).then_some(ends)
    };
    let corners = |cell: [u32; 8]| std::array::from_fn(|i| mesh.points().at(cell[i] as usize));
    mesh.cells().filter_map(|(_, _, cell)| inside(corners(cell))).collect()
}

/// Two cubes in one mesh, one so far behind the other.
fn pair(apart: f64) -> Mesh {
    let one = cube(6);
    let mut points: Vec<DVec3> = one.points().iter().collect();
    let count = points.len() as u32;
    let cells: Vec<[u32; 4]> = one.cells().map(|(_, _, c)| [c[0], c[1], c[2], c[3]]).collect();
    let behind: Vec<[u32; 4]> = cells.iter().map(|c| c.map(|i| i + count)).collect();
    points.extend(one.points().iter().map(|p| p + apart * DVec3::Y));
    tetrahedra(points, &[cells, behind].concat())
}

fn pushed() -> Ladder {
    let from = DVec3::new(0.31, -3.0, 0.43);
    let of = move |how: Setup| {
        move |lab: &Lab, apart: f64| {
            let mesh = pair(apart);
            let ones = scalars_of(&mesh, |_| 1.0);
            let shape = Shape::new(mesh, look(ones, greys(&[(1.0, 1.0, 0.5)]), 1.0));
            lab.error(&how, &Scene::new([shape], one_ray(from, from + DVec3::Y)), &[[absorbed(0.5, 2.0); 4]])
        }
    };
    Ladder {
        name: "overlapping-cells",
        title: "Two cubes of one mesh: together, apart, one in the other",
        knob: "from the one to the other; at 1 they touch, below they overlap",
        truth: "closed form, 0.75: each counts",
        rungs: vec![1.0, 1.2, 3.0, 0.9, 0.5, 0.1, 1e-3],
        methods: vec![
            Method::holds("reference", 1e-6, of(Setup::exact())),
            Method::holds("cpu", 1e-5, of(Setup::cpu())),
            Method::refuses("wgpu", ("carry numbers and overlap", 1e-5), of(Setup::new("wgpu"))),
            Method::fails("model: from the first way in to the last way out", (1e-9, [0.15, 0.26]), move |_, apart| {
                let found = stretches(&pair(apart), from);
                let first = found.iter().fold(f64::INFINITY, |m, [a, _]| m.min(*a));
                let last = found.iter().fold(f64::NEG_INFINITY, |m, [_, b]| m.max(*b));
                Ok((absorbed(0.5, last - first) - 0.75).abs())
            }),
        ],
    }
}

/// The cube's ones, moved so that planes across the view lie this far from its vertices.
fn on_planes(distance: f64) -> Scene {
    let mesh = cube(24);
    let ones = scalars_of(&mesh, |_| 1.0);
    let shape = Shape::new(mesh, look(ones, greys(&[(1.0, 1.0, 0.5)]), 1.0));
    shape.set_transform(DAffine3::from_translation(DVec3::Y * distance));
    Scene::new([shape], square(DVec3::new(0.5, 0.0, 0.5), -20.0 * DVec3::Y, 0.93, 9))
}

fn vertices() -> Ladder {
    let wanted = [[absorbed(0.5, 1.0); 4]; 81];
    let of = |how: Setup| move |lab: &Lab, distance: f64| lab.error(&how, &on_planes(distance), &wanted);
    Ladder {
        name: "planes-through-vertices",
        title: "Planes nearer and nearer to the vertices of cells",
        knob: "distance of planes from vertices; cells are 1 wide",
        truth: "closed form, 0.5",
        rungs: vec![0.1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-17],
        methods: vec![
            Method::holds("wgpu, slices", 1e-4, of(Setup::new("wgpu").with("method", "slices").step(0.25))),
            Method::holds("vulkan", 1e-4, of(Setup::new("vulkan").step(0.25))),
        ],
    }
}

/// A ring of fewer and fewer, longer and longer cells around a hole.
fn hollow() -> Ladder {
    let scene = |sectors: f64| {
        let mesh = tube(0.6, [sectors as usize, 1, 1]);
        let mut scene = around([field(mesh, |p| 50.0 + 40.0 * p.x, warm(), 0.3)]);
        (scene.desc.width, scene.desc.height) = (16, 16);
        scene
    };
    let of = move |how: Setup| move |lab: &Lab, sectors: f64| lab.from_truth(&how, &scene(sectors));
    Ladder {
        name: "hollow",
        title: "A ring around a hole, of fewer and fewer cells",
        knob: "cells around; rays leave the ring and enter it again",
        truth: "`reference`",
        rungs: vec![48.0, 24.0, 12.0, 6.0, 4.0, 3.0],
        methods: vec![
            Method::holds("cpu", 1e-4, of(Setup::cpu())),
            Method::holds("wgpu", 1e-4, of(Setup::new("wgpu"))),
        ],
    }
}

fn answers() -> Vec<Answer> {
    vec![
        Answer::new(
            Does::Avoids,
            "Rays pass from cell to cell through shared faces, and slices go plane by plane: nothing is sorted, so \
             there is no cycle to fall into, and the order of the bars changes no bit.",
            |lab| {
                let draw = |s: &Scene| lab.frame(&Setup::cpu(), s).map_err(|e| format!("{e:?}"));
                let same = crate::metrics::identical(&draw(&bars(5.0))?, &draw(&bars(5.0).reversed())?);
                ensure(same, "the pictures differ")
            },
        ),
        Answer::new(
            Does::Refuses,
            "Where cells that carry numbers lie in one another, each counts; `wgpu`, which cannot do that, refuses \
             the mesh by name once it meets such a place.",
            |lab| {
                let shape = field(pair(0.5), |p| 20.0 + 30.0 * p.x, warm(), 0.3).named("twice");
                let found = lab.frame(&Setup::new("wgpu"), &around([shape]));
                refused_with(found, &["twice", "overlap", "cpu"])
            },
        ),
        Answer::new(
            Does::Avoids,
            "Cells that are collapsed to a plane or a point draw nothing, and harm nothing.",
            |lab| {
                let mut points = cube(5).points().iter().collect::<Vec<_>>();
                points.extend([DVec3::splat(0.5); 4]);
                let five = [[0, 1, 2, 4], [3, 1, 2, 7], [5, 1, 4, 7], [6, 2, 4, 7], [1, 2, 4, 7]];
                let flat = [[0, 1, 2, 3], [8, 9, 10, 11], [0, 1, 8, 8]];
                let mesh = tetrahedra(points, &[five.as_slice(), flat.as_slice()].concat());
                let truth = certified(&of_mesh(cube(5))).map_err(|e| format!("{e:?}"))?;
                let error = lab.error(&Setup::cpu(), &of_mesh(mesh), &truth).map_err(|e| format!("{e:?}"))?;
                ensure(error < 1e-4, format!("off by {error}"))
            },
        ),
    ]
}
