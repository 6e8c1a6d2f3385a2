//! Meshes: no cracks, nothing twice, sums that are right, attributes that go along.

use proptest::prelude::*;
use volact_core::{
    glam::{DVec2, DVec3},
    slicing::{Order, PixelMap, Polygons, Rate, Sampling, SamplingMode},
};

use super::common::{along, bent, carrying, covers, each, from_eye, mesh, split_block, unit_block};

fn at_distance(distance: f64) -> Sampling {
    Sampling { rate: Rate::Distance(distance), ..Sampling::default() }
}

/// How often the polygons of a slice cover a point of the picture.
fn count(polygons: &Polygons, map: &PixelMap, point: DVec2) -> usize {
    let seen = |face| {
        let corners: Vec<DVec2> = polygons.vertices(face).map(|v| map.pixel(v.position).unwrap()).collect();
        covers(&corners, point)
    };
    polygons.faces().iter().filter(|f| seen(f)).count()
}

fn direction() -> impl Strategy<Value = DVec3> {
    // Whole numbers put vertices, edges and faces on planes, and planes along faces.
    let rough = prop::array::uniform3(-2i8..=2).prop_map(|d| DVec3::from_array(d.map(f64::from)));
    let fine = prop::array::uniform3(-1.0..1.0f64).prop_map(DVec3::from);
    prop_oneof![rough, fine].prop_filter("a direction", |d| d.length() > 0.1)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A mesh of a block covers on each plane what the block does: once inside, not at all outside, and
    /// at the projections of vertices, too.
    #[test]
    fn cells_cover_their_block_once(
        towards in direction(), n in 1usize..4, moved in any::<bool>(), step in prop::sample::select(vec![0.25, 0.5, 0.17]),
        points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64), 20), eye in any::<bool>(),
    ) {
        let shift = |i: usize| if moved { DVec3::new((i % 3) as f64, (i % 5) as f64, (i % 7) as f64) * 0.02 } else { DVec3::ZERO };
        let cells = carrying(split_block(n, shift));
        let block = carrying(unit_block());
        let frame = if eye { from_eye(DVec3::splat(0.5) - 4.0 * towards.normalize(), DVec3::splat(0.5)) } else { along(towards) };
        let rays = frame.camera.rays(&frame.viewport()).unwrap();
        let map = PixelMap::new(&rays, &frame.viewport()).unwrap();
        let mut whole = Vec::new();
        each(&[block], &frame, &at_distance(step), Order::FrontToBack, |_, k, p| whole.push((k, p.clone()))).unwrap();
        each(&[cells], &frame, &at_distance(step), Order::FrontToBack, |_, k, p| {
            let area: f64 = p.faces().iter().map(|f| p.area(f)).sum();
            let Some((_, whole)) = whole.iter().find(|w| w.0 == k) else { panic!("{k}") };
            let wanted: f64 = whole.faces().iter().map(|f| whole.area(f)).sum();
            assert!((area - wanted).abs() < 1e-9, "{area} {wanted}");
            // Points anywhere, and those of vertices, to which all cells at a vertex have the same bits.
            let corners = p.faces().iter().flat_map(|f| p.vertices(f)).map(|v| map.pixel(v.position).unwrap());
            let corners: Vec<DVec2> = corners.collect();
            let bounds = corners.iter().fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[a, b], c| [a.min(*c), b.max(*c)]);
            let anywhere = points.iter().map(|(x, y)| bounds[0] + (bounds[1] - bounds[0]) * DVec2::new(*x, *y));
            for point in anywhere.chain(corners.iter().copied().step_by(3)) {
                let times = count(p, &map, point);
                assert!(times <= 1, "{times} times at {point}");
                let on_rim = |face| {
                    let ring: Vec<DVec2> = whole.vertices(face).map(|v| map.pixel(v.position).unwrap()).collect();
                    (0..ring.len()).any(|i| {
                        let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
                        (b - a).perp_dot(point - a).abs() < 1e-9 * (1.0 + (b - a).length())
                    })
                };
                if !whole.faces().iter().any(on_rim) {
                    assert_eq!(times, count(whole, &map, point), "at {point}");
                }
            }
        }).unwrap();
    }

    /// The polygons' areas times the planes' distance are the volume, and numbers of vertices that are
    /// linear in space are so on polygons.
    #[test]
    fn areas_add_up_and_attributes_go_along(towards in direction(), turned in any::<bool>(), mode in 0usize..3) {
        let shape = carrying(split_block(3, |i| DVec3::splat((i % 4) as f64 * 0.03)));
        if turned {
            shape.set_transform(bent());
        }
        let scale = if turned { bent().matrix3.determinant().abs() } else { 1.0 };
        let frame = from_eye(shape.state().transform.transform_point3(DVec3::splat(0.5)) - 5.0 * towards.normalize(), DVec3::splat(0.4));
        let mode = [SamplingMode::ViewportAligned, SamplingMode::AxisAligned, SamplingMode::SphericalShells][mode];
        let (sampling, mut sum) = (Sampling { mode, ..at_distance(0.004) }, 0.0);
        each(&[shape], &frame, &sampling, Order::BackToFront, |_, _, p| {
            for face in p.faces() {
                sum += p.area(face) * 0.004 / face.gradient.length();
                for v in p.vertices(face) {
                    let wanted = v.object.dot(DVec3::new(1.0, 2.0, 3.0));
                    assert!((v.attributes[0] - wanted).abs() < 1e-9);
                    assert!((v.texture - v.object).length() < 1e-9);
                }
            }
        }).unwrap();
        prop_assert!((sum / scale - 1.0).abs() < 0.02, "{sum} of {scale}, {mode:?}");
    }
}

/// A cell that is flat, one turned inside out and a sliver neither crack nor count twice.
#[test]
fn slivers_inverted_and_collapsed_cells_leave_no_trace() {
    let p = [
        DVec3::ZERO,
        DVec3::X,
        DVec3::Y,
        DVec3::new(0.0, 0.0, 1.0),
        DVec3::new(0.25, 0.25, 1e-13),
        DVec3::new(1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0),
    ];
    let plain = mesh(&p, &[[0, 1, 2, 3]]);
    // The same in four about a point that all but lies on a face, one of them inverted, and with a flat one.
    let split = mesh(&p, &[[0, 1, 2, 4], [1, 0, 4, 3], [4, 1, 2, 3], [0, 4, 2, 3], [1, 2, 3, 5]]);
    for towards in [DVec3::Z, DVec3::X, DVec3::new(1.0, 2.0, -0.5), DVec3::ONE] {
        let (frame, mut areas) = (along(towards), [Vec::new(), Vec::new()]);
        for (areas, mesh) in areas.iter_mut().zip([&plain, &split]) {
            let shape = carrying(mesh.clone());
            each(&[shape], &frame, &at_distance(0.01), Order::FrontToBack, |_, k, p| {
                areas.push((k, p.faces().iter().map(|f| p.area(f)).sum::<f64>()));
            })
            .unwrap();
        }
        let [plain, split] = areas;
        assert_eq!(plain.len(), split.len());
        for ((k, a), (l, b)) in plain.into_iter().zip(split) {
            assert!(k == l && (a - b).abs() < 1e-9, "{towards}: {a} {b}");
        }
    }
}

/// A ring has a hole, a plane through it two pieces, and both are there.
#[test]
fn a_plane_through_a_ring_has_all_of_its_pieces() {
    let n = 24;
    let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
    let rim = [[1.0, 0.0], [2.0, 0.0], [1.0, 0.5], [2.0, 0.5]];
    let points: Vec<DVec3> =
        (0..4 * n).map(|i| (DVec2::from_angle(angle(i / 4)) * rim[i % 4][0]).extend(rim[i % 4][1])).collect();
    let cells: Vec<[u32; 8]> = (0..n)
        .map(|i| {
            let (a, b) = (4 * i as u32, 4 * ((i + 1) % n) as u32);
            [a, a + 1, b + 1, b, a + 2, a + 3, b + 3, b + 2]
        })
        .collect();
    let types = volact_core::geometry::CellTypes::All(volact_core::geometry::CellType::Hexahedron);
    let indices = volact_core::Buffer::from_vec(cells.concat());
    let ring = volact_core::Mesh::new(points.into(), types, indices).unwrap();
    let shape = carrying(ring);
    let (mut touched, mut cut) = (0, 0);
    each(&[shape], &along(DVec3::X), &at_distance(0.02), Order::FrontToBack, |_, k, p| {
        let x = (k as f64 + 0.5) * 0.02;
        // Chords of a regular polygon of 24 sides instead of a circle: 1 % less, but at the rims.
        let chord = |r: f64| if r > x.abs() { (r * r - x * x).sqrt() } else { 0.0 };
        let wanted = 2.0 * 0.5 * (chord(2.0) - chord(1.0));
        let area: f64 = p.faces().iter().map(|f| p.area(f)).sum();
        let at_rim = (x.abs() - 1.0).abs() < 0.1 || x.abs() > 1.9;
        assert!(at_rim || (area - wanted).abs() < 0.06, "{x}: {area} {wanted}");
        touched += 1;
        cut += p.faces().len();
    })
    .unwrap();
    // Of 144 cells a plane touches only those that it cuts.
    assert!(touched >= 198 && cut < touched * 48, "{cut} in {touched}");
}
