//! The choices on meshes by rule.

use super::*;
use volact_core::{Block, Geometry, StructuredMesh, Surface, table::ResolvedTable};

/// Name, number of components, and the number of a component at a place.
type Rule<'a> = (&'a str, usize, fn(DVec3, usize) -> f64);

/// A box of n³ cells that fills 0..size, with numbers by place (0 to 1 along each axis).
fn mesh(n: usize, size: DVec3, attributes: &[Rule]) -> MeshData {
    let places: Vec<DVec3> = (0..(n + 1).pow(3))
        .map(|i| {
            DVec3::new((i % (n + 1)) as f64, (i / (n + 1) % (n + 1)) as f64, (i / (n + 1).pow(2)) as f64) / n as f64
        })
        .collect();
    let points = places.iter().map(|p| *p * size).collect();
    let attributes = attributes.iter().map(|(name, components, number)| {
        let numbers = places.iter().flat_map(|p| (0..*components).map(|c| number(*p, c))).collect::<Vec<f64>>();
        Attribute::new(*name, ScalarType::F64, *components, numbers.into()).unwrap()
    });
    MeshData {
        name: "box".into(),
        geometry: Arc::new(StructuredMesh::new([n + 1; 3], points).unwrap()),
        attributes: attributes.collect(),
        warnings: Vec::new(),
    }
}

/// Nearly all is cold; one end is hot.
fn hot(p: DVec3, _: usize) -> f64 {
    300.0 + 400.0 * (5.0 * (p.x - 1.0)).exp()
}

fn look(data: &MeshData, name: Option<&str>) -> AutomaticMesh {
    automatic_mesh(data, name).unwrap()
}

fn resolve(automatic: &AutomaticMesh) -> ResolvedTable {
    automatic.table.as_ref().unwrap().resolve([0.0, 1.0])
}

#[test]
fn rare_numbers_are_the_more_opaque() {
    let table = resolve(&look(&mesh(16, DVec3::ONE, &[("t", 1, hot)]), None));
    let [cold, hot] = [305.0, 640.0].map(|v| table.classify(v)[3]);
    assert!(cold > 0.0 && hot > 4.0 * cold, "{cold} {hot}");
}

#[test]
fn the_whole_has_the_stated_depth() {
    // Along its thin axis a plate is as thick everywhere, so that the mean needs no shadow.
    let size = DVec3::new(4.0, 0.5, 3.0);
    let automatic = look(&mesh(20, size, &[("t", 1, hot)]), None);
    assert_eq!(automatic.view, View::Front);
    let table = resolve(&automatic);
    let n = 4000;
    let depth = |i: usize| {
        let opacity = table.classify(hot(DVec3::X * (i as f64 + 0.5) / n as f64, 0))[3];
        -(1.0 - opacity).ln() * size.y / automatic.unit_distance
    };
    let mean = (0..n).map(depth).sum::<f64>() / n as f64;
    assert!((mean / DEPTH - 1.0).abs() < 0.15, "{mean}");
}

#[test]
fn division_and_scale_of_the_world_change_little() {
    let table = |n: usize, size: f64| resolve(&look(&mesh(n, DVec3::splat(size), &[("t", 1, hot)]), None));
    let (coarse, fine, small) = (table(16, 1.0), table(32, 1.0), table(16, 1e-9));
    for v in [305.0, 320.0, 400.0, 600.0] {
        let [a, b, c] = [&coarse, &fine, &small].map(|t| (1.0 - t.classify(v)[3]).ln());
        assert!((b / a - 1.0).abs() < 0.35, "{v}: {a} {b}");
        assert!((c / a - 1.0).abs() < 0.02, "{v}: {a} {c}");
    }
}

#[test]
fn numbers_around_zero_part_there() {
    let data = mesh(8, DVec3::ONE, &[("charge", 1, |p, _| p.x - 0.4)]);
    let table = resolve(&look(&data, None));
    let [below, middle, above] = [-0.35, 0.0, 0.5].map(|v| table.classify(v));
    assert!(below[2] > below[0] && above[0] > above[2], "{below:?} {above:?}");
    assert!((middle[0] - middle[2]).abs() < 0.1, "{middle:?}");
}

#[test]
fn the_first_scalar_that_varies_is_taken_unless_told() {
    let data = mesh(
        4,
        DVec3::ONE,
        &[("flow", 3, |p, c| p[c]), ("flat", 1, |_, _| 7.0), ("t", 1, |p, _| p.z), ("u", 1, |p, _| p.y)],
    );
    let name = |asked: Option<&str>| look(&data, asked).attribute.unwrap().name;
    assert_eq!((name(None), name(Some("u")), name(Some("flow"))), ("t".into(), "u".into(), "flow".into()));
    let value = |asked: &str| look(&data, Some(asked)).attribute.unwrap().value(124, 0);
    assert_eq!((value("flow"), value("flow[1]")), (3f64.sqrt(), 1.0));
    let notes = look(&data, Some("flow")).notes;
    assert!(notes[0].starts_with("magnitude of attribute \"flow\" of 3 components, "), "{notes:?}");
    for (asked, hint) in [("flwo", "did you mean \"flow\"?"), ("flow[3]", "known: flow, flat, t, u")] {
        let error = automatic_mesh(&data, Some(asked)).unwrap_err().to_string();
        assert!(error.contains(hint), "{error}");
    }
}

#[test]
fn without_scalars_vectors_are_taken_and_without_any_the_inside() {
    let vectors = mesh(4, DVec3::ONE, &[("flow", 3, |p, c| p[c])]);
    assert_eq!(look(&vectors, None).attribute.unwrap().components, 1);
    let flat = look(&mesh(4, DVec3::ONE, &[("flat", 1, |_, _| 7.0)]), None);
    assert!(flat.notes[0].contains("7 everywhere") && resolve(&flat).classify(7.0)[3] > 0.0);
    let bare = look(&mesh(4, DVec3::ONE, &[]), None);
    assert_eq!(bare.attribute.as_ref().unwrap().len(), 125);
    assert!(resolve(&bare).classify(0.0)[3] > 0.0);
}

#[test]
fn numbers_that_are_none_do_not_count() {
    let data = mesh(8, DVec3::ONE, &[("t", 1, |p, _| if p.x > 0.6 { f64::NAN } else { p.y })]);
    let automatic = look(&data, None);
    assert!(automatic.subject.max.x < 0.63, "{:?}", automatic.subject);
    let none = mesh(2, DVec3::ONE, &[("t", 1, |_, _| f64::NAN)]);
    assert_eq!(look(&none, Some("t")).subject, Aabb::new(DVec3::ZERO, DVec3::ONE));
}

#[test]
fn surfaces_need_no_numbers() {
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y].into_iter().collect();
    let surface = Surface::new(points, vec![0u32, 1, 2].into()).unwrap();
    let data = MeshData { name: "s".into(), geometry: Arc::new(surface), attributes: vec![], warnings: vec![] };
    let automatic = look(&data, None);
    assert_eq!((automatic.view, automatic.appearance().shader.as_str()), (View::Top, "surface"));
    assert!(automatic_mesh(&data, Some("t")).is_err());
}

#[test]
fn very_many_points_are_thinned_without_losing_the_outermost() {
    let n = 130_000;
    let at = |i: usize| {
        let (z, turn) = (1.0 - 2.0 * (i as f64 + 0.5) / n as f64, i as f64 * 2.4);
        DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z)
    };
    let kept = thinned((0..n).map(at).collect());
    assert!(kept.len() < MOST_POINTS);
    for direction in [DVec3::X, DVec3::ONE.normalize(), DVec3::new(-0.3, 0.8, -0.5).normalize()] {
        let reach = kept.iter().map(|p| p.dot(direction)).fold(0.0, f64::max);
        assert!(reach > 0.999, "{direction}: {reach}");
    }
}

#[test]
fn shadows_are_the_area_of_the_outline() {
    let corners = Block::new(DVec3::new(5.0, 6.0, 7.0), DVec3::new(2.0, 3.0, 4.0)).unwrap().bounds().corners();
    assert!((shadow(&corners, View::Front) - 8.0).abs() < 1e-9);
    assert!((shadow(&corners, View::Top) - 6.0).abs() < 1e-9);
    assert_eq!(shadow(&[], View::Front), 0.0);
}
