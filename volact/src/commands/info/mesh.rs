//! What a mesh or surface holds: cells, their faults, attributes.

use std::{fmt::Write as _, path::Path};

use serde_json::{Value, json};
use volact::{
    Attribute, MeshData, StructuredMesh,
    core::geometry::MeshReport,
    transfer::{self, AutomaticMesh},
};

use super::{
    Args, draw_chart, number,
    values::{PERCENTILES, Values},
    vector,
};

/// A mesh with all that is looked up about it.
pub struct Facts<'a> {
    file: &'a Path,
    loader: &'a str,
    data: &'a MeshData,
    report: Option<MeshReport>,
    shown: Option<(AutomaticMesh, Option<Values>)>,
}

impl<'a> Facts<'a> {
    /// Counts cells and faults, unless only the header is wanted, and looks at the numbers.
    pub fn new(file: &'a Path, loader: &'a str, data: &'a MeshData, args: &Args) -> anyhow::Result<Self> {
        let mut facts = Self { file, loader, data, report: None, shown: None };
        if args.header {
            return Ok(facts);
        }
        facts.report = MeshReport::new(data.geometry.as_ref());
        let automatic = transfer::automatic_mesh(data, args.attribute.as_deref())?;
        let values = automatic.attribute.as_ref().filter(|_| !data.attributes.is_empty());
        let values = values.map(|a| Values::of((0..a.len()).map(|v| a.value(v, 0))));
        facts.shown = Some((automatic, values));
        Ok(facts)
    }

    fn kind(&self) -> String {
        let geometry = &self.data.geometry;
        if let Some(mesh) = geometry.as_any().downcast_ref::<StructuredMesh>() {
            let [x, y, z] = mesh.dims();
            return format!("structured mesh of {x} × {y} × {z} vertices");
        }
        if geometry.as_surface().is_some() { "surface".into() } else { "unstructured mesh".into() }
    }

    fn rows(&self) -> Vec<(&'static str, String)> {
        let geometry = &self.data.geometry;
        let bounds = geometry.bounds();
        let mut rows = vec![
            ("file", self.file.display().to_string()),
            ("loader", self.loader.to_owned()),
            ("kind", self.kind()),
            ("vertices", geometry.vertex_count().unwrap_or(0).to_string()),
            ("bounds", format!("{} to {}", vector(bounds.min), vector(bounds.max))),
        ];
        if let Some(surface) = geometry.as_surface() {
            let normals = if surface.normals().is_some() { ", with normals" } else { "" };
            rows.push(("triangles", format!("{}{normals}", surface.triangles().len())));
        }
        rows.extend(self.report.iter().flat_map(report_rows));
        let (first, rest) = ("attributes", "");
        let lines = self.data.attributes.iter().map(attribute_line);
        rows.extend(lines.enumerate().map(|(i, line)| (if i == 0 { first } else { rest }, line)));
        rows
    }

    /// The facts for people.
    pub fn to_text(&self, args: &Args) -> String {
        let mut rows = self.rows();
        if let Some((automatic, values)) = &self.shown {
            rows.push(("shown as", automatic.notes.join("; ")));
            rows.extend(values.iter().flat_map(Values::rows));
        }
        rows.extend(self.data.warnings.iter().map(|w| ("warning", w.to_string())));
        let mut text = String::new();
        for (name, value) in rows {
            _ = writeln!(text, "{name:<12}{value}");
        }
        if let Some((_, Some(values))) = &self.shown {
            text.push_str(&draw_chart(values, args));
        }
        text
    }

    /// The facts for programs.
    pub fn to_json(&self, bins: usize) -> String {
        let bounds = self.data.geometry.bounds();
        let attribute = |a: &Attribute| {
            let ranges: Vec<_> = (0..a.components).map(|c| json!(a.range(c))).collect();
            json!({
                "name": a.name, "type": a.scalar.name(), "components": a.components, "bytes": a.data.len(),
                "ranges": ranges,
            })
        };
        let mut value = json!({
            "file": self.file.display().to_string(),
            "loader": self.loader,
            "kind": self.kind(),
            "vertices": self.data.geometry.vertex_count(),
            "triangles": self.data.geometry.as_surface().map(|s| s.triangles().len()),
            "bounds": [bounds.min.to_array(), bounds.max.to_array()],
            "attributes": self.data.attributes.iter().map(attribute).collect::<Vec<_>>(),
            "warnings": self.data.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        });
        let Value::Object(map) = &mut value else { return String::new() };
        if let Some(report) = &self.report {
            map.insert("mesh".into(), report_json(report));
        }
        if let Some((automatic, values)) = &self.shown {
            map.insert("notes".into(), json!(automatic.notes));
            if let Some(values) = values {
                let percentiles = PERCENTILES.iter().zip(&values.percentiles).map(|(p, v)| (p.to_string(), json!(v)));
                map.insert("range".into(), json!(values.range));
                map.insert("mean".into(), json!(values.mean));
                map.insert("percentiles".into(), Value::Object(percentiles.collect()));
                map.insert("not_finite".into(), json!(values.not_finite));
                map.insert("histogram".into(), json!(values.histogram(bins.clamp(1, 65536))));
            }
        }
        format!("{value:#}\n")
    }
}

fn attribute_line(attribute: &Attribute) -> String {
    let range = |component: usize| match attribute.range(component) {
        Some([lo, hi]) => format!("{} to {}", number(lo), number(hi)),
        None => "no finite number".into(),
    };
    let n = attribute.components;
    let ranges: Vec<_> = (0..n.min(9)).map(range).collect();
    format!("{}: {n} × {}, {}", attribute.name, attribute.scalar, ranges.join("; "))
}

fn report_rows(report: &MeshReport) -> Vec<(&'static str, String)> {
    let cells = report.cells.iter().map(|c| format!("{} {}", c.count, plural(c.cell_type.name(), c.count)));
    let volumes = report.volumes.map_or("none".into(), |[lo, hi]| format!("{} to {}", number(lo), number(hi)));
    vec![
        ("cells", cells.collect::<Vec<_>>().join(", ")),
        ("tetrahedra", report.tetrahedra.to_string()),
        ("volume", format!("{}, of a cell {volumes}", number(report.volume))),
        ("inverted", report.inverted.to_string()),
        ("collapsed", report.collapsed.to_string()),
        ("folded", report.folded.to_string()),
        ("boundary", format!("{} triangles", report.boundary_faces)),
        ("overlapping", format!("{} triangles", report.overlapping_faces)),
        ("edges", format!("{} of the boundary are not manifold", report.non_manifold_edges)),
    ]
}

fn plural(name: &str, count: usize) -> String {
    match name {
        _ if count == 1 => name.to_owned(),
        "tetrahedron" => "tetrahedra".into(),
        "hexahedron" => "hexahedra".into(),
        other => format!("{other}s"),
    }
}

fn report_json(report: &MeshReport) -> Value {
    let cells = report.cells.iter().map(|c| (c.cell_type.name().to_owned(), json!(c.count)));
    json!({
        "cells": Value::Object(cells.collect()),
        "tetrahedra": report.tetrahedra,
        "inverted": report.inverted,
        "collapsed": report.collapsed,
        "folded": report.folded,
        "boundary_faces": report.boundary_faces,
        "overlapping_faces": report.overlapping_faces,
        "non_manifold_edges": report.non_manifold_edges,
        "volume": report.volume,
        "cell_volumes": report.volumes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use volact::{CellType, CellTypes, Mesh, ScalarType, core::glam::DVec3};

    fn data() -> MeshData {
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
        // One positive tetrahedron, one inverted, one flat.
        let cells = vec![0u32, 1, 2, 3, 1, 2, 4, 3, 0, 1, 1, 2];
        let mesh =
            Mesh::new(points.into_iter().collect(), CellTypes::All(CellType::Tetrahedron), cells.into()).unwrap();
        let attribute = |name: &str, n: usize| {
            let values: Vec<f32> = (0..5 * n).map(|i| i as f32).collect();
            Attribute::new(name, ScalarType::F32, n, values.into()).unwrap()
        };
        let attributes = vec![attribute("v", 3), attribute("t", 1)];
        MeshData { name: "m".into(), geometry: Arc::new(mesh), attributes, warnings: vec![] }
    }

    #[test]
    fn faults_and_attributes_are_told() {
        let (data, args) = (data(), Args::for_tests());
        let facts = Facts::new(Path::new("m.vtu"), "vtu", &data, &args).unwrap();
        let text = facts.to_text(&args);
        for fact in [
            "cells       3 tetrahedra\n",
            "tetrahedra  2\n",
            "inverted    1\n",
            "collapsed   1\n",
            "boundary    6 triangles\n",
            "attributes  v: 3 × f32, 0 to 12; 1 to 13; 2 to 14\n",
            "            t: 1 × f32, 0 to 4\n",
            "shown as    attribute \"t\", ",
        ] {
            assert!(text.contains(fact), "{fact:?} in {text}");
        }
        let value: Value = serde_json::from_str(&facts.to_json(5)).unwrap();
        assert_eq!(value["mesh"]["cells"], json!({"tetrahedron": 3}));
        assert_eq!((&value["mesh"]["inverted"], &value["attributes"][1]["ranges"]), (&json!(1), &json!([[0.0, 4.0]])));
        assert_eq!(value["histogram"], json!([1, 1, 1, 1, 1]));
    }

    #[test]
    fn the_header_alone_counts_nothing() {
        let (data, args) = (data(), Args { header: true, ..Args::for_tests() });
        let facts = Facts::new(Path::new("m.vtu"), "vtu", &data, &args).unwrap();
        assert!(!facts.to_text(&args).contains("inverted"));
        let wrong = Args { attribute: Some("tt".into()), ..Args::for_tests() };
        assert!(Facts::new(Path::new("m.vtu"), "vtu", &data, &wrong).is_err());
    }
}
