//! Checks a description against itself and against what is registered.

use std::collections::BTreeMap;

use super::{GeometrySpec, ParameterSpec, Problem, SceneFile, ShapeSpec, TransformStep};
use crate::{
    Declaration, ParameterDecl, ParameterType, ParameterValue, Registry,
    parameter::{Kind, ProblemKind},
};

/// Names inside the scene that lead nowhere.
pub(super) fn references(scene: &SceneFile) -> Vec<Problem> {
    let mut problems = Vec::new();
    for (i, shape) in scene.shapes.iter().enumerate() {
        let path = format!("shapes[{i}]");
        values_exist(scene, &format!("{path}.parameters"), &shape.parameters, &mut problems);
        match &shape.geometry {
            GeometrySpec::Named { parameters, .. } => {
                values_exist(scene, &format!("{path}.geometry.parameters"), parameters, &mut problems);
            }
            GeometrySpec::Data { data, .. } => {
                data_exists(scene, &format!("{path}.geometry.data"), data, &mut problems);
            }
            _ => {}
        }
        let unread = scene.place(&format!("{path}.parameters.volume")).is_some() || shape.shader.is_empty();
        if shape.volume().is_none() && !unread {
            needs_volume(scene, &path, shape, &mut problems);
        }
    }
    problems
}

fn values_exist(
    scene: &SceneFile,
    path: &str,
    parameters: &BTreeMap<String, ParameterSpec>,
    problems: &mut Vec<Problem>,
) {
    for (name, value) in parameters {
        if let Some(data) = value.data().filter(|data| !data.is_empty()) {
            data_exists(scene, &format!("{path}.{name}.data"), data, problems);
        }
    }
}

fn data_exists(scene: &SceneFile, path: &str, name: &str, problems: &mut Vec<Problem>) {
    if scene.data.contains_key(name) {
        return;
    }
    let known: Vec<_> = scene.data.keys().map(String::as_str).collect();
    let wanted = match known.is_empty() {
        true => "an entry under `data`, which has none".to_owned(),
        false => format!("a name under `data`: {}", known.join(", ")),
    };
    problems.push(scene.problem(path, format!("{name:?}"), wanted).near(name, known));
}

/// A shape without a volume has nothing to be around, and no place of a volume's.
fn needs_volume(scene: &SceneFile, path: &str, shape: &ShapeSpec, problems: &mut Vec<Problem>) {
    let at = |field: &str| {
        let inner = format!("{path}.{field}");
        if scene.place(&inner).is_some() { inner } else { path.to_owned() }
    };
    let of_mesh = shape.attribute_data().is_some() || scene.place(&format!("{path}.parameters.scalars")).is_some();
    if shape.geometry == GeometrySpec::Around && !of_mesh {
        let wanted = "a parameter with a volume, or a `geometry`";
        problems.push(scene.problem(&at("geometry"), "a shape without a volume", wanted));
    }
    if shape.transform.iter().flatten().any(|step| *step == TransformStep::Placement) {
        problems.push(scene.problem(&at("transform"), "`Placement` in a shape without a volume", "other steps"));
    }
}

/// Names and parameters that nobody registered.
pub(super) fn check(scene: &SceneFile, registry: &Registry) -> Vec<Problem> {
    let mut check = Check { scene, registry, problems: Vec::new() };
    for (name, data) in &scene.data {
        if let Some(loader) = &data.loader {
            let path = format!("data.{name}");
            let declaration = check.known(Kind::Loader, loader, &format!("{path}.loader"));
            check.given(declaration, &format!("{path}.options"), &data.options, |_| false);
        }
    }
    for (i, shape) in scene.shapes.iter().enumerate() {
        check.shape(&format!("shapes[{i}]"), shape);
    }
    check.action();
    check.problems
}

struct Check<'a> {
    scene: &'a SceneFile,
    registry: &'a Registry,
    problems: Vec<Problem>,
}

impl<'a> Check<'a> {
    /// The declaration of that kind and name, or a problem.
    fn known(&mut self, kind: Kind, name: &str, path: &str) -> Option<&'a Declaration> {
        if let Some(refused) = self.registry.shaders().refused(name).filter(|_| kind == Kind::Shader) {
            let wanted = format!("one that can be used:\n{}", refused.why);
            self.problems.push(self.scene.problem(path, format!("{name:?}, which is refused"), wanted));
            return None;
        }
        let all: Vec<_> = self.registry.declarations().into_iter().filter(|d| d.kind == kind).collect();
        let found = all.iter().find(|d| d.name == name).copied();
        if found.is_none() && !name.is_empty() {
            let known: Vec<_> = all.iter().map(|d| d.name.as_str()).collect();
            let list = if known.is_empty() { "none is".to_owned() } else { known.join(", ") };
            let wanted = format!("a registered {}: {list}", kind.name());
            self.problems.push(self.scene.problem(path, format!("{name:?}"), wanted).near(name, known));
        }
        found
    }

    fn shape(&mut self, path: &str, shape: &ShapeSpec) {
        let shaders = self.registry.shaders();
        let declaration = self.known(Kind::Shader, &shape.shader, &format!("{path}.shader"));
        self.given(declaration, &format!("{path}.parameters"), &shape.parameters, |name| shaders.declares(name));
        if let Some(declaration) = declaration {
            self.missing(declaration, path, &shape.parameters);
        }
        if let GeometrySpec::Named { name, parameters } = &shape.geometry {
            let path = format!("{path}.geometry");
            let declaration = self.known(Kind::Geometry, name, &format!("{path}.name"));
            self.given(declaration, &format!("{path}.parameters"), parameters, |_| false);
            if let Some(declaration) = declaration {
                self.missing(declaration, &path, parameters);
            }
        }
    }

    fn action(&mut self) {
        let Some(action) = &self.scene.action else { return };
        let mut declaration = self.known(Kind::Action, &action.name, "action.name");
        let mut options = action.options.clone();
        if action.name == "checked" {
            // What it does not take itself is for the action that it wraps.
            let of = match options.remove("of") {
                Some(ParameterSpec::Value(ParameterValue::Choice(of))) => of,
                _ => "cpu".into(),
            };
            declaration = self.known(Kind::Action, &of, "action.options.of");
        }
        if let Some(planned) = declaration.filter(|_| action.name == "planned") {
            // What it does not take itself is for the actions that it plans for.
            let of = match options.get("of") {
                Some(ParameterSpec::Value(ParameterValue::Choice(of))) => of.clone(),
                _ => "cpu".into(),
            };
            let mut own = options.clone();
            own.retain(|name, _| planned.parameter(name).is_some());
            self.given(declaration, "action.options", &own, |_| false);
            options.retain(|name, _| !own.contains_key(name));
            let all: Vec<_> =
                of.split_whitespace().map(|name| self.known(Kind::Action, name, "action.options.of")).collect();
            for (name, value) in &options {
                let declares = |d: &&Declaration| d.parameter(name).is_some();
                let theirs = all.iter().flatten().copied().find(declares).or(all.first().copied().flatten());
                self.given(theirs, "action.options", &BTreeMap::from([(name.clone(), value.clone())]), |_| false);
            }
            return;
        }
        self.given(declaration, "action.options", &options, |_| false);
    }

    /// Values that are given but not what is declared.
    fn given(
        &mut self,
        declaration: Option<&Declaration>,
        path: &str,
        given: &BTreeMap<String, ParameterSpec>,
        elsewhere: impl Fn(&str) -> bool,
    ) {
        let Some(declaration) = declaration else { return };
        for (name, value) in given {
            let at = format!("{path}.{name}");
            match declaration.parameter(name) {
                Some(decl) => {
                    if let Err((found, wanted)) = fits(value, decl) {
                        self.problems.push(self.scene.problem(&at, found, wanted));
                    }
                }
                None if elsewhere(name) => {}
                None => {
                    let known: Vec<_> = declaration.parameters.iter().map(|p| p.name.as_str()).collect();
                    let (kind, of) = (declaration.kind.name(), &declaration.name);
                    let wanted = match known.is_empty() {
                        true => format!("no parameters, for {kind} {of:?} has none"),
                        false => format!("a parameter of {kind} {of:?}: {}", known.join(", ")),
                    };
                    let mut problem = self.scene.problem(&at, "a parameter that nobody declares", wanted);
                    problem = problem.near(name, known);
                    if problem.nearest.is_none() && declaration.kind == Kind::Shader {
                        let all = self.registry.shaders().iter().flat_map(|s| &s.declaration.parameters);
                        problem = problem.near(name, all.map(|p| p.name.as_str()));
                    }
                    self.problems.push(problem);
                }
            }
        }
    }

    /// Values that are declared as required but not given. A shape's unit distance is found when
    /// it is built, and what was given but could not be read is a problem already.
    fn missing(&mut self, declaration: &Declaration, path: &str, given: &BTreeMap<String, ParameterSpec>) {
        for decl in declaration.parameters.iter().filter(|p| p.required && p.name != "unit_distance") {
            let at = format!("{path}.parameters.{}", decl.name);
            if given.contains_key(&decl.name) || self.scene.place(&at).is_some() {
                continue;
            }
            let wanted = format!("{}: {}", types(decl), decl.description);
            self.problems.push(self.scene.problem(&at, "nothing", wanted));
        }
    }
}

fn types(decl: &ParameterDecl) -> String {
    decl.types.iter().map(|t| t.name()).collect::<Vec<_>>().join(" or ")
}

/// Whether a value is what is declared; what was found and wanted where it is not.
fn fits(value: &ParameterSpec, decl: &ParameterDecl) -> Result<(), (String, String)> {
    let kind = match value {
        ParameterSpec::Value(value) => {
            return match decl.accept(&coerce(value, decl)).map_err(|p| p.kind) {
                Err(ProblemKind::Mistyped { found, wanted }) => Err((found, wanted)),
                _ => Ok(()),
            };
        }
        ParameterSpec::Volume(_) => ParameterType::Volume,
        ParameterSpec::Table(_) => ParameterType::Table,
        ParameterSpec::Attribute(_) | ParameterSpec::DataAttribute(_) => ParameterType::Attribute,
    };
    if decl.types.contains(&kind) { Ok(()) } else { Err((format!("a {kind}"), types(decl))) }
}

/// Three or four numbers are a colour where a colour is wanted.
pub(crate) fn coerce(value: &ParameterValue, decl: &ParameterDecl) -> ParameterValue {
    let takes = |kind| decl.types.contains(&kind);
    match value {
        ParameterValue::Vec3(v) if takes(ParameterType::Color) && !takes(ParameterType::Vec3) => {
            ParameterValue::Color([v.x, v.y, v.z, 1.0])
        }
        ParameterValue::Vec4(v) if takes(ParameterType::Color) && !takes(ParameterType::Vec4) => {
            ParameterValue::Color(v.to_array())
        }
        other => other.clone(),
    }
}

impl ShapeSpec {
    /// The first volume among the parameters, `volume` before others, with its parameter's name.
    pub(super) fn volume(&self) -> Option<(&str, &super::VolumeSpec)> {
        let volumes = || {
            self.parameters.iter().filter_map(|(name, value)| match value {
                ParameterSpec::Volume(volume) => Some((name.as_str(), volume)),
                _ => None,
            })
        };
        volumes().find(|(name, _)| *name == "volume").or_else(|| volumes().next())
    }
}
