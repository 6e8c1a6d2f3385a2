//! A shader's text, parsed and checked.

use std::{collections::HashMap, ops::Range, sync::Arc};

use naga::{
    Function, Handle, Module, Span, Type,
    front::wgsl::ParseError,
    valid::{Capabilities, ModuleInfo, ValidationError, ValidationFlags, Validator},
};
use volact_core::{Compositing, Declaration, ShaderEntry, ShaderFile, ShaderText, scene::Problems};

use crate::{
    error::{ShaderError, SourceError, SourceErrors},
    eval::check,
    refuse,
    signatures::{self, Derived, kind_of, prelude, signatures_of},
};

/// Stack of the parser, which recurses over what it reads; the refusals bound how deep.
const STACK: usize = 256 << 20;

/// A function that the framework calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Entry {
    /// `fn shade(s: Sample) -> Medium`.
    Shade,
    /// `fn shade_segment(front: Sample, back: Sample) -> Medium`.
    Segment,
    /// `fn value(s: Sample) -> f32`: what the ray's compositing takes.
    Value,
}

impl Entry {
    /// Its name in WGSL.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shade => "shade",
            Self::Segment => "shade_segment",
            Self::Value => "value",
        }
    }

    fn signature(self) -> &'static str {
        match self {
            Self::Shade => "fn shade(s: Sample) -> Medium",
            Self::Segment => "fn shade_segment(front: Sample, back: Sample) -> Medium",
            Self::Value => "fn value(s: Sample) -> f32",
        }
    }
}

/// What a function of the framework does in place of its body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stub {
    /// A parameter's function.
    Parameter { parameter: usize, derived: Derived },
    /// `medium(color, opacity)`.
    Medium,
}

/// A checked shader. Cheap to clone, and shared between threads.
#[derive(Clone, Debug)]
pub struct Program(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    declaration: Declaration,
    compositing: Compositing,
    module: Module,
    info: ModuleInfo,
    stubs: HashMap<Handle<Function>, Stub>,
    entries: Vec<(Entry, Handle<Function>)>,
}

impl Program {
    /// Parses and checks a shader's source.
    ///
    /// # Errors
    /// If it has none, or everything that is wrong with it as far as can be told at once.
    pub fn new(entry: &ShaderEntry) -> Result<Self, ShaderError> {
        let name = || entry.declaration.name.clone();
        let source = entry.source.as_ref().ok_or_else(|| ShaderError::Native { name: name() })?;
        Ok(check_source(&entry.declaration, entry.compositing, source).map_err(|errors| SourceErrors {
            file: source.file.clone(),
            text: source.text.clone(),
            errors,
        })?)
    }

    /// The shader's declaration.
    pub fn declaration(&self) -> &Declaration {
        &self.0.declaration
    }

    /// How its samples are put together.
    pub fn compositing(&self) -> Compositing {
        self.0.compositing
    }

    /// Whether the shader has this function.
    pub fn has(&self, entry: Entry) -> bool {
        self.entry(entry).is_some()
    }

    /// naga's module: the framework's prelude (types, and a stub for each function of a
    /// parameter), then the author's. What composes shaders for other backends starts from it.
    pub fn module(&self) -> &Module {
        &self.0.module
    }

    /// What naga's validator found of the module.
    pub fn info(&self) -> &ModuleInfo {
        &self.0.info
    }

    pub(crate) fn entry(&self, entry: Entry) -> Option<Handle<Function>> {
        self.0.entries.iter().find(|(e, _)| *e == entry).map(|(_, handle)| *handle)
    }

    pub(crate) fn stub(&self, function: Handle<Function>) -> Option<Stub> {
        self.0.stubs.get(&function).copied()
    }
}

/// Checks that every parameter can be a function of its name.
pub(crate) fn check_declaration(file: &ShaderFile) -> Result<(), Problems> {
    let (declaration, compositing) = (&file.entry.declaration, file.entry.compositing);
    let mut problems = Vec::new();
    for (i, parameter) in declaration.parameters.iter().enumerate() {
        problems.extend(name_of(&parameter.name).map(|wanted| file.name_problem(i, wanted)));
    }
    let names = signatures::names(declaration, compositing);
    for (k, (name, i)) in names.iter().enumerate() {
        let first = names[..k].iter().find(|(other, _)| other == name);
        if let Some((_, other)) = first {
            let other = &declaration.parameters[*other].name;
            let wanted = format!("another name: its function `{name}` is one of the parameter {other:?}, too");
            problems.push(file.name_problem(*i, wanted));
        } else if declaration.parameters[*i].name != *name {
            problems.extend(
                refuse::bad_name(name)
                    .map(|_| file.name_problem(*i, format!("another name: its function `{name}` is a name of WGSL"))),
            );
        }
    }
    if problems.is_empty() { Ok(()) } else { Err(Problems::new(problems)) }
}

fn name_of(name: &str) -> Option<String> {
    refuse::bad_name(name)
}

type Errors = Vec<SourceError>;

fn check_source(declaration: &Declaration, compositing: Compositing, source: &ShaderText) -> Result<Program, Errors> {
    check_parameters(declaration, compositing)?;
    let text = &source.text;
    let taken = signatures::names(declaration, compositing);
    let taken: Vec<_> = taken.into_iter().map(|(n, i)| (n, declaration.parameters[i].name.clone())).collect();
    let errors = refuse::refuse(text, &taken);
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut prelude = prelude(declaration, compositing);
    if compositing != Compositing::Over && !refuse::has_function_like(text, Entry::Value.name()) {
        prelude.push_str(&signatures::plain_value(declaration));
    }
    let whole = format!("{prelude}{text}");
    let start = prelude.len();
    let parsed = on_a_large_stack(|| naga::front::wgsl::parse_str(&whole))?;
    let module = parsed.map_err(|error| vec![parse_error(&error, start)])?;
    let entries = entries(&module, compositing, text)?;
    let stubs = stubs(&module, declaration, compositing);
    let errors = check::check(&module, |function| stubs.contains_key(&function), start);
    if !errors.is_empty() {
        return Err(errors);
    }
    let validated = on_a_large_stack(|| {
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        validator.validate(&module).map_err(|error| validation_error(&error, start))
    })?;
    let info = validated.map_err(|error| vec![error])?;
    let declaration = declaration.clone();
    let program = Program(Arc::new(Inner { declaration, compositing, module, info, stubs, entries }));
    // What is too large to be evaluated anywhere is said now, and not when a shape is drawn.
    for (entry, _) in &program.0.entries {
        crate::eval::lower::<f32>(&program, *entry, None, false).map_err(|error| vec![error.shifted(start)])?;
    }
    Ok(program)
}

/// A declaration made in code has met no document's checks.
fn check_parameters(declaration: &Declaration, compositing: Compositing) -> Result<(), Errors> {
    let wrong = |name: &str, what: String| SourceError::whole(format!("parameter {name:?}: wanted {what}"));
    let mut errors = Vec::new();
    for p in &declaration.parameters {
        errors.extend(refuse::bad_name(&p.name).map(|what| wrong(&p.name, what)));
        if kind_of(p).is_none() {
            errors.push(wrong(&p.name, "one type, or float and int".into()));
        }
    }
    let names = signatures::names(declaration, compositing);
    for (k, (name, i)) in names.iter().enumerate() {
        if names[..k].iter().any(|(other, _)| other == name) {
            let what = format!("another name: two parameters have a function `{name}`");
            errors.push(wrong(&declaration.parameters[*i].name, what));
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

/// Runs what recurses over a text. A panic in there is an error like any other.
fn on_a_large_stack<T: Send>(run: impl FnOnce() -> T + Send) -> Result<T, Errors> {
    let failed = |what: &str| vec![SourceError::whole(format!("the parser failed: {what}; please report this text"))];
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, run);
        let thread = thread.map_err(|error| failed(&error.to_string()))?;
        thread.join().map_err(|payload| {
            let said = payload.downcast_ref::<String>().map(String::as_str);
            failed(said.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("it panicked"))
        })
    })
}

/// A span of the whole text as bytes of the author's.
pub(crate) fn place(span: Span, start: usize) -> Option<Range<usize>> {
    let range = span.to_range()?;
    (range.end >= start && range.end > 0).then(|| range.start.saturating_sub(start)..range.end - start)
}

fn parse_error(error: &ParseError, start: usize) -> SourceError {
    let place = |(span, label): (Span, &str)| Some((place(span, start)?, label.to_owned()));
    let places = error.labels().filter_map(place).collect();
    SourceError { message: error.message().into(), places, notes: error.notes().map(str::to_owned).collect() }
}

fn validation_error(error: &naga::WithSpan<ValidationError>, start: usize) -> SourceError {
    let mut messages = Vec::new();
    let mut cause: Option<&dyn std::error::Error> = Some(error.as_inner());
    while let Some(error) = cause {
        messages.push(error.to_string());
        cause = error.source();
    }
    // naga's labels name types of its own, which tell an author nothing.
    // The narrowest place is where the trouble is; the others lie around it.
    let places = error.spans().filter_map(|(span, _)| place(*span, start));
    let places = places.min_by_key(Range::len).map(|range| (range, String::new())).into_iter().collect();
    let message = messages.pop().unwrap_or_default();
    SourceError { message, places, notes: messages }
}

/// The functions that the framework calls, with the right types.
fn entries(module: &Module, compositing: Compositing, text: &str) -> Result<Vec<(Entry, Handle<Function>)>, Errors> {
    let mut entries = Vec::new();
    let mut errors = Vec::new();
    let over = compositing == Compositing::Over;
    for (entry, wanted) in [(Entry::Shade, true), (Entry::Value, !over), (Entry::Segment, false)] {
        let found = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(entry.name()));
        let at = || refuse::functions(text).into_iter().find(|(name, _)| *name == entry.name()).map(|(_, r)| r);
        match found {
            None if wanted => {
                let mut error = refuse::missing(text, entry.name(), entry.signature());
                if entry == Entry::Value {
                    error = error.note(format!("compositing `{}` is of this value along the ray", compositing.name()));
                }
                errors.push(error);
            }
            None => {}
            Some(_) if entry == Entry::Value && over => {}
            Some(_) if entry == Entry::Segment && !over => {
                let message = format!("`shade_segment` has no meaning with the compositing `{}`", compositing.name());
                errors.push(SourceError::at(at().unwrap_or_default(), message));
            }
            Some((handle, function)) if has_signature(module, function, entry) => entries.push((entry, handle)),
            Some((_, function)) => {
                let found = signature(module, function);
                let message = format!("`{}` is `{found}`, wanted `{}`", entry.name(), entry.signature());
                errors.push(SourceError::at(at().unwrap_or_default(), message));
            }
        }
    }
    if errors.is_empty() { Ok(entries) } else { Err(errors) }
}

fn has_signature(module: &Module, function: &Function, entry: Entry) -> bool {
    let arguments: Vec<_> = function.arguments.iter().map(|a| type_name(module, a.ty)).collect();
    let result = function.result.as_ref().map(|r| type_name(module, r.ty));
    let (samples, wanted) = match entry {
        Entry::Shade => (1, "Medium"),
        Entry::Segment => (2, "Medium"),
        Entry::Value => (1, "f32"),
    };
    arguments == vec!["Sample"; samples] && result.as_deref() == Some(wanted)
}

fn signature(module: &Module, function: &Function) -> String {
    let argument =
        |a: &naga::FunctionArgument| format!("{}: {}", a.name.as_deref().unwrap_or("_"), type_name(module, a.ty));
    let arguments: Vec<_> = function.arguments.iter().map(argument).collect();
    let result = function.result.as_ref().map_or(String::new(), |r| format!(" -> {}", type_name(module, r.ty)));
    format!("fn {}({}){result}", function.name.as_deref().unwrap_or("_"), arguments.join(", "))
}

fn type_name(module: &Module, handle: Handle<Type>) -> String {
    use naga::TypeInner as T;
    let scalar = |s: &naga::Scalar| match s.kind {
        naga::ScalarKind::Sint => "i32",
        naga::ScalarKind::Uint => "u32",
        naga::ScalarKind::Float => "f32",
        _ => "bool",
    };
    let ty = &module.types[handle];
    match (&ty.name, &ty.inner) {
        (Some(name), _) => name.clone(),
        (_, T::Scalar(s)) => scalar(s).into(),
        (_, T::Vector { size, scalar: s }) => format!("vec{}<{}>", *size as u8, scalar(s)),
        (_, T::Matrix { columns, rows, scalar: s }) => {
            format!("mat{}x{}<{}>", *columns as u8, *rows as u8, scalar(s))
        }
        (_, T::Array { base, .. }) => format!("array<{}, …>", type_name(module, *base)),
        (_, T::Pointer { base, .. }) => format!("ptr<function, {}>", type_name(module, *base)),
        _ => "another type".into(),
    }
}

fn stubs(module: &Module, declaration: &Declaration, compositing: Compositing) -> HashMap<Handle<Function>, Stub> {
    let by_name: HashMap<&str, Handle<Function>> =
        module.functions.iter().filter_map(|(handle, f)| Some((f.name.as_deref()?, handle))).collect();
    let mut stubs = HashMap::new();
    stubs.extend(
        by_name
            .get("medium")
            .filter(|_| signatures::has_lengths(declaration, compositing))
            .map(|handle| (*handle, Stub::Medium)),
    );
    for (parameter, p) in declaration.parameters.iter().enumerate() {
        for s in signatures_of(p, declaration, compositing) {
            let stub = Stub::Parameter { parameter, derived: s.derived };
            let plain = matches!(s.derived, Derived::Attribute | Derived::AttributeComponents);
            let handle = by_name.get(format!("{}{}", p.name, s.ending).as_str()).filter(|_| !plain);
            stubs.extend(handle.map(|handle| (*handle, stub)));
        }
    }
    stubs
}
