//! Every geometry: with numbers of its own, with a volume in it, and as what breaks others.

use volact_core::{
    Block, Buffer, CellType, CellTypes, Cylinder, Geometry, Mesh, ParameterValue, Shape, Sphere, Surface,
    VolumeTexture, glam::DVec3,
};

use super::stock::{absorbed, around, rule, through, usual, warm};
use crate::{
    case::{Case, Need, Topic},
    meshes::{bent, corner, cube, field, tetrahedra, tube},
    rig::{How, Scene},
    scene::{along_y, colors, constant, greys, look, lut},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("geometry", &[]);
    chords(&mut topic);
    fields(&mut topic);
    holding(&mut topic);
    deformed(&mut topic);
    surfaces(&mut topic);
    topic.done()
}

const ATTRIBUTE: &[Need] = &[Need::Shader("attribute")];
const LUT: &[Need] = &[Need::Shader("lut")];

/// A cell of one type, four long along y where a ray at (1, 1) crosses it.
fn cell(kind: CellType) -> Mesh {
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let points = match kind {
        CellType::Tetrahedron => vec![p(0.0, 0.0, 0.0), p(6.0, 0.0, 0.0), p(0.0, 6.0, 0.0), p(0.0, 0.0, 6.0)],
        CellType::Hexahedron => [0.0, 4.0]
            .into_iter()
            .flat_map(|z| [p(0.0, 0.0, z), p(4.0, 0.0, z), p(4.0, 4.0, z), p(0.0, 4.0, z)])
            .collect(),
        CellType::Wedge => {
            vec![
                p(0.0, 0.0, 0.0),
                p(5.0, 0.0, 0.0),
                p(0.0, 0.0, 5.0),
                p(0.0, 4.0, 0.0),
                p(5.0, 4.0, 0.0),
                p(0.0, 4.0, 5.0),
            ]
        }
        CellType::Pyramid => {
            vec![p(-2.0, 0.0, -2.0), p(4.0, 0.0, -2.0), p(4.0, 0.0, 4.0), p(-2.0, 0.0, 4.0), p(1.0, 4.0, 1.0)]
        }
    };
    let count = points.len() as u32;
    Mesh::new(points.into(), CellTypes::All(kind), Buffer::from_vec((0..count).collect::<Vec<_>>())).expect("a cell")
}

/// A constant number absorbs by the length of the chord.
fn chords(topic: &mut Topic) {
    for kind in CellType::ALL {
        let about = "a constant number in a cell absorbs by the chord of the ray";
        topic.needing(ATTRIBUTE, format!("chord_of_a_{}", kind.name()), about, move |rig| {
            let shape = field(cell(kind), |_| 1.0, greys(&[(1.0, 0.7, 0.3)]), 1.0);
            let alpha = absorbed(0.3, 4.0);
            let scene = Scene::new([shape], along_y(1.0, 1.0));
            rig.pixel("middle", &scene, &How::step(0.25), [0.7 * alpha, 0.7 * alpha, 0.7 * alpha, alpha]).map(|_| ())
        });
    }
    topic.needing(
        ATTRIBUTE,
        "every_interval_of_a_gap",
        "every interval of a non-convex mesh, not first-in to last-out",
        |rig| {
            // Two corners apart along y in one mesh: 3, a gap of 4, 3 again.
            let at = |y: f64| [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|a| a * 4.0 + DVec3::Y * y);
            let mesh = tetrahedra([at(0.0), at(7.0)].concat(), &[[0, 1, 2, 3], [4, 5, 6, 7]]);
            let shape = field(mesh, |_| 1.0, greys(&[(1.0, 1.0, 0.3)]), 1.0);
            let alpha = absorbed(0.3, 6.0);
            rig.pixel("both", &Scene::new([shape], along_y(0.5, 0.5)), &How::step(0.25), [alpha; 4]).map(|_| ())
        },
    );
    topic.needing(
        ATTRIBUTE,
        "order_within_a_mesh",
        "colours in the order of the ray, whatever the order of cells",
        |rig| {
            let at = |y: f64| [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|a| a * 4.0 + DVec3::Y * y);
            for (label, cells) in
                [("near first", [[0u32, 1, 2, 3], [4, 5, 6, 7]]), ("far first", [[4, 5, 6, 7], [0, 1, 2, 3]])]
            {
                let mesh = tetrahedra([at(0.0), at(7.0)].concat(), &cells);
                let table = colors(&[(0.0, [1.0, 0.0, 0.0], 0.3), (1.0, [0.0, 0.0, 1.0], 0.3)]);
                let shape = field(mesh, |p| f64::from(u8::from(p.y > 6.5)), table, 1.0);
                let alpha = absorbed(0.3, 3.0);
                let wanted = [alpha, 0.0, (1.0 - alpha) * alpha, 1.0 - (1.0 - alpha).powi(2)];
                rig.pixel(label, &Scene::new([shape], along_y(0.5, 0.5)), &How::step(0.25), wanted)?;
            }
            Ok(())
        },
    );
    topic.needing(
        ATTRIBUTE,
        "rays_along_grid_lines",
        "vertices, edges and faces on a ray neither crack nor count twice",
        |rig| {
            let shape = field(bent([4, 4, 4], DVec3::ONE, 0.0), |_| 0.0, greys(&[(0.0, 1.0, 0.4)]), 1.0);
            for x in [0.25, 0.5, 0.3] {
                for z in [0.25, 0.5, 0.625] {
                    let scene = Scene::new([shape.clone()], along_y(x, z));
                    rig.pixel(&format!("{x}, {z}"), &scene, &How::step(0.05), [0.4; 4])?;
                }
            }
            Ok(())
        },
    );
    topic.needing(ATTRIBUTE, "ring_of_hexahedra", "a hole in a mesh is a hole", |rig| {
        let shape = field(tube(0.4, [12, 2, 2]), |p| 100.0 * p.z, warm(), 0.3);
        rig.lattice("picture", &around([shape]), &How::default()).map(|_| ())
    });
}

/// Numbers at vertices, linear in each tetrahedron.
fn fields(topic: &mut Topic) {
    let wave = |p: DVec3| rule(7.0 * p);
    for (name, parts) in [("five", 5), ("six", 6), ("twenty_four", 24)] {
        topic.needing(ATTRIBUTE, format!("cube_of_{name}"), "the number is linear in each tetrahedron", move |rig| {
            let shape = field(cube(parts), wave, warm(), 0.3);
            rig.lattice("picture", &through([shape]), &How::default()).map(|_| ())
        });
    }
    for (name, n, strength) in [("straight", [3, 2, 4], 0.0), ("bent", [4, 3, 3], 0.14)] {
        topic.needing(
            ATTRIBUTE,
            format!("structured_{name}"),
            "hexahedra are split from their lowest vertex",
            move |rig| {
                let shape = field(bent(n, DVec3::ONE, strength), wave, warm(), 0.3);
                rig.lattice("picture", &around([shape]), &How::default()).map(|_| ())
            },
        );
    }
    for kind in CellType::ALL {
        topic.needing(ATTRIBUTE, format!("field_in_a_{}", kind.name()), "cells mean their tessellation", move |rig| {
            let shape = field(cell(kind), rule, warm(), 1.0);
            rig.lattice("picture", &around([shape]), &How::default()).map(|_| ())
        });
    }
    topic.needing(
        ATTRIBUTE,
        "inverted_and_collapsed",
        "inverted and collapsed cells neither crack nor draw twice",
        move |rig| {
            let made = cube(24).tessellate().expect("a mesh");
            let mut cells = made.tetrahedra.clone();
            cells.iter_mut().step_by(3).for_each(|c| c.swap(0, 1));
            cells.push([0, 1, 1, 2]);
            let mesh = tetrahedra(made.vertices.iter().collect(), &cells);
            let (odd, plain) =
                (through([field(mesh, wave, warm(), 0.3)]), through([field(cube(24), wave, warm(), 0.3)]));
            let (a, b) = (rig.draw(&odd, &How::default())?, rig.draw(&plain, &How::default())?);
            rig.alike("variant", &odd, &a, &b)
        },
    );
}

/// A volume in something that is no block.
fn holding(topic: &mut Topic) {
    let inside = || look("lut", warm(), 1.0).with("volume", VolumeTexture::new(&usual()));
    let center = DVec3::new(3.0, 2.5, 3.5);
    type Make = Box<dyn Fn() -> Shape + Send + Sync>;
    let makers: Vec<(&str, Make)> = vec![
        ("sphere", Box::new(move || Shape::new(Sphere::new(center, 2.9, 12).expect("a ball"), inside()))),
        (
            "cylinder",
            Box::new(move || {
                let ends = [center - DVec3::new(2.0, 1.0, 2.5), center + DVec3::new(2.0, 1.0, 2.5)];
                Shape::new(Cylinder::new(ends, 2.0, 12).expect("a cylinder"), inside())
            }),
        ),
        ("bent_grid", Box::new(move || Shape::new(bent([2, 3, 2], DVec3::new(6.0, 5.0, 7.0), 0.12), inside()))),
        ("tetrahedron", Box::new(move || Shape::new(corner(7.0), inside()))),
        (
            "ring",
            Box::new(move || {
                let made = tube(0.4, [9, 1, 1]).tessellate().expect("a tube");
                let points = made.vertices.iter().map(|p| p * 2.6 + center).collect();
                Shape::new(tetrahedra(points, &made.tetrahedra), inside())
            }),
        ),
    ];
    for (name, make) in makers {
        let about = "a mesh is a region of interest: the volume is drawn inside it";
        topic.needing(LUT, format!("volume_in_a_{name}"), about, move |rig| {
            rig.lattice("picture", &around([make()]), &How::step(0.3)).map(|_| ())
        });
    }
    topic.needing(LUT, "mesh_of_a_box_is_the_block", "a box of tetrahedra is a block", move |rig| {
        let block = Block::new(DVec3::ZERO, DVec3::new(6.0, 5.0, 7.0)).expect("a block");
        let made = block.tessellate().expect("a block");
        let mesh = tetrahedra(made.vertices.iter().collect(), &made.tetrahedra);
        let (meshed, plain) = (around([Shape::new(mesh, inside())]), around([lut(&usual(), warm(), 1.0)]));
        let (a, b) = (rig.draw(&meshed, &How::step(0.3))?, rig.draw(&plain, &How::step(0.3))?);
        rig.alike("variant", &meshed, &a, &b)
    });
}

/// Texture coordinates carry the volume along.
fn deformed(topic: &mut Topic) {
    topic.needing(LUT, "texture_coordinates_deform", "texture coordinates run 0 to 1 over the data ROI", |rig| {
        let straight = bent([3, 2, 3], DVec3::ONE, 0.0);
        let mesh = bent([3, 2, 3], DVec3::new(6.0, 5.0, 7.0), 0.12);
        let mesh = mesh.with_texture_coordinates(straight.points().clone()).expect("as many");
        let shape = Shape::new(mesh, look("lut", warm(), 1.0).with("volume", VolumeTexture::new(&usual())));
        rig.lattice("picture", &around([shape]), &How::step(0.3)).map(|_| ())
    });
    topic.needing(LUT, "texture_coordinates_outside", "texture coordinates outside 0 to 1 show nothing there", |rig| {
        let mesh = cube(6);
        let wide = mesh.points().iter().map(|u| u * 2.0 - 0.5).collect();
        let mesh = mesh.with_texture_coordinates(wide).expect("as many");
        let look =
            look("lut", greys(&[(1.0, 1.0, 0.6)]), 1.0).with("volume", VolumeTexture::new(&constant(1.0, [2, 2, 2])));
        let shape = Shape::new(mesh, look);
        for (x, length) in [(0.5, 0.5), (0.3, 0.5), (0.2, 0.0)] {
            let scene = Scene::new([shape.clone()], along_y(x, 0.4));
            rig.pixel(&format!("at {x}"), &scene, &How::step(0.05), [absorbed(0.6, length); 4])?;
        }
        Ok(())
    });
}

fn surfaces(topic: &mut Topic) {
    let needs = [Need::Shader("surface")];
    topic.needing(&needs, "triangle_alone", "a surface is opaque, lit from both sides", |rig| {
        let points = vec![DVec3::new(-4.0, 1.0, -3.0), DVec3::new(5.0, -1.0, -2.0), DVec3::new(0.5, 2.0, 4.0)];
        let surface = Surface::new(points.into(), Buffer::from_vec(vec![0u32, 1, 2])).expect("a triangle");
        let color = ParameterValue::Color([0.8, 0.5, 0.2, 1.0]);
        let look = volact_core::Appearance::new("surface").with("color", color);
        let shape = Shape::new(surface, look);
        rig.lattice("picture", &around([shape.clone()]), &How::default())?;
        rig.lattice("from behind", &super::stock::from([shape], DVec3::new(-0.4, 1.0, 0.3)), &How::default())?;
        Ok(())
    });
}
