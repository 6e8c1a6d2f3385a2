//! Cases: a name, what is promised, what an action must have for it, and the function that looks.

use volact_core::{Caps, Compositing, Declaration, Registry};

use crate::{rig::Rig, study::Expected};

/// Why a case ends early.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The action says that it cannot do what the case is about.
    Skip(String),
    /// Something that must not fail did.
    Fail(String),
}

/// What a case comes to; its findings are in the rig.
pub type Verdict = Result<(), Stop>;

/// What an action must have for a case to mean anything.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Need {
    /// A shader by name, drawn natively or by its source.
    Shader(&'static str),
    /// Shaders by their source.
    Sources,
    /// A geometry by name.
    Geometry(&'static str),
    /// A way of compositing.
    Composites(Compositing),
    /// Shapes in one place.
    Overlap,
    /// Frames with depth.
    Depth,
    /// An option of the action.
    Option(&'static str),
}

impl Need {
    /// What is missing, in words, of an action with these capabilities.
    pub fn missing(&self, caps: &Caps, declaration: &Declaration, registry: &Registry) -> Option<String> {
        let known =
            |names: &Option<Vec<String>>, name: &str| names.as_ref().is_none_or(|n| n.iter().any(|n| n == name));
        let (met, reason) = match self {
            Self::Shader(name) => {
                let Some(entry) = registry.shaders().get(name) else {
                    return Some(format!("no shader is called {name:?} here"));
                };
                let by_source = caps.sources && entry.source.is_some();
                let drawn = by_source || known(&caps.shaders, name);
                (drawn && caps.compositing.contains(&entry.compositing), format!("it does not draw shader {name:?}"))
            }
            Self::Sources => (caps.sources, "it draws no shader by its source".into()),
            Self::Geometry(name) => (known(&caps.geometries, name), format!("it does not draw geometry {name:?}")),
            Self::Composites(c) => (caps.compositing.contains(c), format!("it does not composite by {:?}", c.name())),
            Self::Overlap => (caps.overlap, "it draws no overlapping shapes".into()),
            Self::Depth => (caps.depth, "its frames have no depth".into()),
            Self::Option(name) => (declaration.parameter(name).is_some(), format!("it has no option {name:?}")),
        };
        (!met).then_some(reason)
    }

    /// In words.
    pub fn name(&self) -> String {
        match self {
            Self::Shader(name) => format!("shader {name}"),
            Self::Sources => "shaders by source".into(),
            Self::Geometry(name) => format!("geometry {name}"),
            Self::Composites(c) => format!("compositing {}", c.name()),
            Self::Overlap => "overlap".into(),
            Self::Depth => "depth".into(),
            Self::Option(name) => format!("option {name}"),
        }
    }
}

type Run = Box<dyn Fn(&mut Rig<'_>) -> Verdict + Send + Sync>;

/// One promise and how it is looked at.
pub struct Case {
    /// Its topic.
    pub topic: &'static str,
    /// Its name within the topic.
    pub name: String,
    /// What is promised.
    pub about: String,
    /// What an action must have.
    pub needs: Vec<Need>,
    /// What is expected of an error, where the case is one of those that `volact verify` prints.
    pub expects: Option<Expected>,
    run: Run,
}

impl Case {
    /// Topic and name: `clipping::plane_keeps_its_front`.
    pub fn id(&self) -> String {
        format!("{}::{}", self.topic, self.name)
    }

    /// Looks.
    ///
    /// # Errors
    /// If the case ends early.
    pub fn run(&self, rig: &mut Rig<'_>) -> Verdict {
        (self.run)(rig)
    }
}

/// The cases of a topic as they are listed.
pub struct Topic {
    name: &'static str,
    needs: Vec<Need>,
    cases: Vec<Case>,
}

impl Topic {
    /// A topic without cases, all of which will need this.
    pub fn new(name: &'static str, needs: &[Need]) -> Self {
        Self { name, needs: needs.to_vec(), cases: Vec::new() }
    }

    /// Lists a case that needs nothing but what its topic does.
    pub fn case(
        &mut self,
        name: impl Into<String>,
        about: impl Into<String>,
        run: impl Fn(&mut Rig<'_>) -> Verdict + Send + Sync + 'static,
    ) {
        self.needing(&[], name, about, run);
    }

    /// Lists a case with needs of its own.
    pub fn needing(
        &mut self,
        needs: &[Need],
        name: impl Into<String>,
        about: impl Into<String>,
        run: impl Fn(&mut Rig<'_>) -> Verdict + Send + Sync + 'static,
    ) {
        let needs = self.needs.iter().chain(needs).cloned().collect();
        self.cases.push(Case {
            topic: self.name,
            name: name.into(),
            about: about.into(),
            needs,
            expects: None,
            run: Box::new(run),
        });
    }

    /// Says of the case listed last what it expects of an error.
    pub fn expects(&mut self, expected: Expected) {
        if let Some(case) = self.cases.last_mut() {
            case.expects = Some(expected);
        }
    }

    /// All listed.
    pub fn done(self) -> Vec<Case> {
        self.cases
    }
}
