//! One module from the texts of a stage and the shaders of shapes.

use naga::{
    Block, Expression, Function, FunctionArgument, FunctionResult, Handle, Literal, Module, Span, Statement,
    SwitchCase, SwitchValue, Type,
    valid::{Capabilities, ModuleInfo, ValidationFlags, Validator},
};
use volact_core::{Compositing, ParameterType};

use super::{
    ComposeError, Layout, Recipe,
    layout::{Slot, VolumeUse, is_deep},
    merge::{Import, Merger, named},
};
use crate::{
    Entry,
    eval::LOOP_BUDGET,
    program::Stub,
    signatures::{Derived, has_lengths, kind_of},
};

const LIBRARY: &str = include_str!("../../wgsl/gpu/library.wgsl");
const HOOKS: &str = include_str!("../../wgsl/gpu/hooks.wgsl");
const VOLUME: &str = include_str!("../../wgsl/gpu/volume.wgsl");
const EXACT: &str = include_str!("../../wgsl/gpu/exact.wgsl");
const HARDWARE: &str = include_str!("../../wgsl/gpu/hardware.wgsl");
const ABSENT: &str = include_str!("../../wgsl/gpu/absent.wgsl");
const TABLE: &str = include_str!("../../wgsl/gpu/table.wgsl");
const NUMBER: &str = include_str!("../../wgsl/gpu/number.wgsl");
const GIVEN: &str = include_str!("../../wgsl/gpu/given.wgsl");
pub(super) const RAY: &str = include_str!("../../wgsl/gpu/ray.wgsl");
const BLOCKS: &str = include_str!("../../wgsl/gpu/blocks.wgsl");
const MESHES: &str = include_str!("../../wgsl/gpu/meshes.wgsl");
const UNCARRIED: &str = include_str!("../../wgsl/gpu/uncarried.wgsl");
const SURFACES: &str = include_str!("../../wgsl/gpu/surfaces.wgsl");
const NO_SURFACES: &str = include_str!("../../wgsl/gpu/no_surfaces.wgsl");
const PRE: &str = include_str!("../../wgsl/gpu/pre.wgsl");
const CELLS: &str = include_str!("../../wgsl/gpu/cells.wgsl");
const VERTICES: &str = include_str!("../../wgsl/gpu/vertices.wgsl");
/// Stretches of a ray in a mesh that are kept at a time, besides one (`VOLACT_STRETCHES`).
const STRETCHES: u32 = 3;
const AHEAD: &str = include_str!("../../wgsl/gpu/ahead.wgsl");
const UNKNOWN: &str = include_str!("../../wgsl/gpu/unknown.wgsl");
/// The parts of the stage that casts rays.
const RAYS: [&str; 9] = [
    RAY,
    include_str!("../../wgsl/gpu/rays.wgsl"),
    include_str!("../../wgsl/gpu/lattice.wgsl"),
    AHEAD,
    include_str!("../../wgsl/gpu/light.wgsl"),
    include_str!("../../wgsl/gpu/over.wgsl"),
    include_str!("../../wgsl/gpu/sweep.wgsl"),
    include_str!("../../wgsl/gpu/flat.wgsl"),
    include_str!("../../wgsl/gpu/picture.wgsl"),
];

/// The parts of the stage that draws slabs.
const SLICES: [&str; 7] = [
    RAY,
    include_str!("../../wgsl/gpu/rays.wgsl"),
    include_str!("../../wgsl/gpu/light.wgsl"),
    include_str!("../../wgsl/gpu/over.wgsl"),
    include_str!("../../wgsl/gpu/sweep.wgsl"),
    include_str!("../../wgsl/gpu/flat.wgsl"),
    include_str!("../../wgsl/gpu/slices.wgsl"),
];

/// A module ready for a device.
#[derive(Debug)]
pub struct Composition {
    /// The module.
    pub module: Module,
    /// What naga's validator found of it.
    pub info: ModuleInfo,
    /// Where its numbers lie.
    pub layout: Layout,
}

/// Composes the ray-casting stage for shapes: first those that are composited in depth, then those
/// that are a picture each, in the order in which they are laid over. `spans` is the number of
/// stretches that clips may leave of a ray; `planes` and `surfaces` tell that a shape may have slice planes,
/// and that there are surfaces. That a device has cut loops short is in the flags; one that is known to is
/// `watched`: authors' loops have half of their budget there, so that the two are told apart.
///
/// # Errors
/// If something cannot be put together, which would be a fault of this crate.
pub fn compose(
    recipes: &[Recipe],
    spans: u32,
    (planes, surfaces): (bool, bool),
    watched: bool,
) -> Result<Composition, ComposeError> {
    stage(recipes, spans, (planes, surfaces, watched), "", &RAYS)
}

/// Composes the stages that draw slabs of shapes, in the order of [`compose`]: a vertex stage
/// `volact_corner` and a fragment stage `volact_run`. `sweeps` tells that a run may have several shapes,
/// surfaces of values or slice planes, `skips` that what can be skipped is bound; the rest as for [`compose`].
///
/// # Errors
/// As [`compose`].
pub fn compose_slices(
    recipes: &[Recipe],
    spans: u32,
    has: (bool, bool),
    (sweeps, skips): (bool, bool),
    watched: bool,
) -> Result<Composition, ComposeError> {
    let texts = [&[if skips { AHEAD } else { UNKNOWN }], &SLICES[..]].concat();
    stage(recipes, spans, (has.0, has.1, watched), &format!("const ALONES: bool = {};\n", !sweeps), &texts)
}

/// The module of the entry point `volact_finish`, which makes pixels, depths and counts of the light that
/// slabs have gathered.
///
/// # Errors
/// Never: a test composes it.
pub fn finish() -> Result<(Module, ModuleInfo), ComposeError> {
    let module = parse("", &[include_str!("../../wgsl/gpu/light.wgsl"), include_str!("../../wgsl/gpu/finish.wgsl")])?;
    let info = validate(&module)?;
    Ok((module, info))
}

fn stage(
    recipes: &[Recipe],
    spans: u32,
    (planes, surfaces, watched): (bool, bool, bool),
    more: &str,
    texts: &[&str],
) -> Result<Composition, ComposeError> {
    let layout = Layout::new(recipes);
    let library = parse("", &[])?;
    let mut merger = Merger::default();
    merger.share(&library)?;
    let kinds: Vec<Compositing> = recipes.iter().map(|r| r.program.compositing()).collect();
    let deep = kinds.iter().take_while(|c| is_deep(**c)).count();
    let alone = deep == 1 && kinds[0] == Compositing::Over && !planes;
    let meshes = recipes.iter().any(|r| r.mesh);
    let crosses = kinds.contains(&Compositing::First);
    let constants = format!(
        "const SHAPES: u32 = {}u;\nconst DEEP: u32 = {deep}u;\nconst TRACKS: u32 = {}u;\nconst SPANS: u32 = {}u;\n\
         const MESHES: bool = {meshes};\nconst ALONE: bool = {alone};\nconst PLANES: bool = {planes};\n\
         const CROSSES: bool = {crosses};\n{more}",
        recipes.len(),
        deep.max(1),
        spans + if meshes { STRETCHES } else { 0 },
    );
    let inside: &[&str] = match (meshes || surfaces, recipes.iter().any(|r| r.carries)) {
        (false, _) => &[BLOCKS],
        (true, false) => &[MESHES, UNCARRIED],
        (true, true) => &[MESHES, CELLS],
    };
    let ends = if surfaces { SURFACES } else { NO_SURFACES };
    let stage = parse(&constants, &[&[HOOKS, ends], inside, texts].concat())?;
    let mut import = Import::new(&stage, "");
    let mut shapes = Vec::new();
    for (number, recipe) in recipes.iter().enumerate() {
        shapes.push(Shape::import(&mut merger, recipe, number, &layout.slots[number])?);
    }
    for (hook, entry, who) in HOOKED {
        let budget = if watched { LOOP_BUDGET / 2 } else { LOOP_BUDGET };
        let function = dispatch(
            &mut merger,
            &mut import,
            (&stage, hook),
            (entry, budget),
            (&shapes, &|i: usize| who(kinds[i], planes)),
        )?;
        let handle = named(&stage, hook).ok_or_else(|| ComposeError::inner(format!("no hook {hook}")))?;
        let made = merger.module.functions.append(function, Span::UNDEFINED);
        import.substitute(handle, made);
    }
    for entry in &stage.entry_points {
        let function = merger.body(&mut import, &entry.function)?;
        merger.module.entry_points.push(naga::EntryPoint { function, ..entry.clone() });
    }
    let module = merger.module;
    let info = validate(&module)?;
    Ok(Composition { module, info, layout })
}

/// What naga's validator finds of a module.
pub(super) fn validate(module: &Module) -> Result<ModuleInfo, ComposeError> {
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let wrong = |error: naga::WithSpan<naga::valid::ValidationError>| {
        ComposeError::inner(format!("the module is not valid: {}", error.emit_to_string("")))
    };
    validator.validate(module).map_err(wrong)
}

/// Parses texts behind the library and constants.
pub(super) fn parse(constants: &str, texts: &[&str]) -> Result<Module, ComposeError> {
    let text = [constants, LIBRARY].into_iter().chain(texts.iter().copied()).collect::<Vec<_>>().join("\n");
    #[cfg(feature = "mutations")]
    let text = super::faults::made(text);
    naga::front::wgsl::parse_str(&text)
        .map_err(|error| ComposeError::inner(format!("a text of the framework: {}", error.emit_to_string(&text))))
}

/// A shape's functions in the module, with the type of sample that they take.
struct Shape {
    entries: Vec<(Entry, Handle<Function>)>,
    sample: Option<Handle<Type>>,
    /// What gives the members of its samples behind those that all have.
    numbers: Vec<Handle<Function>>,
}

impl Shape {
    fn import(merger: &mut Merger, recipe: &Recipe, number: usize, slots: &[Slot]) -> Result<Self, ComposeError> {
        let program = &recipe.program;
        let mut import = Import::new(program.module(), format!("s{number}_"));
        import.guard(merger.shared("volact_round")?);
        let parameters = &program.declaration().parameters;
        let unit = parameters.iter().position(|p| p.name == "unit_distance").map_or(0, |i| slots[i].row);
        let lengths =
            has_lengths(program.declaration(), program.compositing()) && program.compositing() == Compositing::Over;
        let medium = |row: u32| {
            format!("const ROW: u32 = {row}u;\nconst UNIT: u32 = {unit}u;\nconst LENGTHS: bool = {lengths};\n")
        };
        let mut accessors = Vec::new();
        for (parameter, (slot, volume)) in parameters.iter().zip(slots.iter().zip(&recipe.volumes)) {
            let (constants, texts) = match kind_of(parameter) {
                Some(ParameterType::Volume) => match volume {
                    Some(volume) if volume.hardware => (reading(slot, volume), vec![VOLUME, HARDWARE]),
                    Some(volume) => (reading(slot, volume), vec![VOLUME, EXACT]),
                    None => (String::new(), vec![ABSENT]),
                },
                Some(ParameterType::Table) => (medium(slot.row), vec![TABLE]),
                Some(ParameterType::Attribute) => (format!("const ROW: u32 = {}u;\n", slot.row), vec![VERTICES]),
                _ => (format!("const ROW: u32 = {}u;\n", slot.row), vec![NUMBER]),
            };
            accessors.push(parse(&constants, &texts)?);
            accessors.push(parse(&medium(slot.given), &[GIVEN])?);
        }
        accessors.push(parse(&medium(0), &[GIVEN])?);
        let prefix = |place: usize| match parameters.get(place / 2) {
            Some(parameter) => format!("s{number}_{}_", parameter.name),
            None => format!("s{number}_"),
        };
        let mut imports: Vec<_> = accessors.iter().enumerate().map(|(i, a)| Import::new(a, prefix(i))).collect();
        for (handle, _) in program.module().functions.iter() {
            let Some(stub) = program.stub(handle) else { continue };
            let (place, name) = match stub {
                // They read a member of the sample.
                Stub::Parameter { derived: Derived::Attribute | Derived::AttributeComponents, .. } => continue,
                Stub::Medium => (2 * parameters.len(), "medium"),
                Stub::Parameter { parameter, derived: Derived::Given } => (2 * parameter + 1, "volact_given"),
                Stub::Parameter { parameter, derived } => (2 * parameter, accessor(derived, program.module(), handle)),
            };
            let wanted = named(&accessors[place], name);
            let wanted = wanted.ok_or_else(|| ComposeError::inner(format!("no function {name}")))?;
            let made = merger.function(&mut imports[place], wanted)?;
            import.substitute(handle, made);
        }
        if let Some([volume, table]) = recipe.pre {
            let Some(read) = &recipe.volumes[volume] else { return Err(ComposeError::inner("no volume")) };
            let constants = format!("{}const UNIT: u32 = {unit}u;\n", reading(&slots[volume], read));
            let source = parse(&constants, &[VOLUME, EXACT, PRE])?;
            let shade = classified(merger, &source, (&accessors[2 * table], &mut imports[2 * table]), number)?;
            return Ok(Self { entries: vec![(Entry::Shade, shade)], sample: None, numbers: Vec::new() });
        }
        let mut entries = Vec::new();
        for entry in [Entry::Shade, Entry::Value] {
            if let Some(handle) = program.entry(entry) {
                entries.push((entry, merger.function(&mut import, handle)?));
            }
        }
        let sample = program.module().types.iter().find(|(_, ty)| ty.name.as_deref() == Some("Sample"));
        let sample = sample.map(|(handle, _)| merger.ty(&mut import, handle)).transpose()?;
        let mut numbers = Vec::new();
        for (place, parameter) in parameters.iter().enumerate() {
            if kind_of(parameter) != Some(ParameterType::Attribute) {
                continue;
            }
            for name in ["volact_number", "volact_number_components"] {
                let wanted = named(&accessors[2 * place], name);
                let wanted = wanted.ok_or_else(|| ComposeError::inner(format!("no function {name}")))?;
                numbers.push(merger.function(&mut imports[2 * place], wanted)?);
            }
        }
        Ok(Self { entries, sample, numbers })
    }
}

/// The function that classifies voxels and interpolates, with a table's in it.
fn classified(
    merger: &mut Merger,
    source: &Module,
    (table, table_import): (&Module, &mut Import<'_>),
    number: usize,
) -> Result<Handle<Function>, ComposeError> {
    let of = |module, name: &str| named(module, name).ok_or_else(|| ComposeError::inner(format!("no function {name}")));
    let color = merger.function(table_import, of(table, "volact_table_color")?)?;
    let mut import = Import::new(source, format!("s{number}_pre_"));
    import.substitute(of(source, "volact_classified")?, color);
    merger.function(&mut import, of(source, "volact_pre")?)
}

/// The constants of a volume's text.
fn reading(slot: &Slot, volume: &VolumeUse) -> String {
    let VolumeUse { channels, nearest, .. } = volume;
    let texture = slot.texture.unwrap_or(1);
    format!(
        "const ROW: u32 = {}u;\nconst TEXTURE: u32 = {texture}u;\nconst CHANNELS: u32 = {channels}u;\n\
         const NEAREST: bool = {nearest};\n",
        slot.row
    )
}

/// The function of the framework that does what a stub only names.
fn accessor(derived: Derived, module: &Module, stub: Handle<Function>) -> &'static str {
    use naga::{ScalarKind as K, TypeInner as T, VectorSize as V};
    match derived {
        Derived::Value => "volact_value",
        Derived::Components => "volact_components",
        Derived::Normalized => "volact_normalized",
        Derived::Color => "volact_color",
        Derived::Gradient => "volact_gradient",
        Derived::Nearest => "volact_nearest",
        Derived::Inside => "volact_inside",
        Derived::Coordinates => "volact_coordinates",
        Derived::Spacing => "volact_spacing",
        Derived::Medium => "volact_medium",
        Derived::TableColor => "volact_table_color",
        Derived::Entry => "volact_entry",
        Derived::Segment => "volact_segment",
        Derived::Local => "volact_local",
        Derived::Given => "volact_given",
        Derived::Attribute => "volact_number",
        Derived::AttributeComponents => "volact_number_components",
        Derived::Plain => {
            let result = module.functions[stub].result.as_ref().map(|r| &module.types[r.ty].inner);
            match result {
                Some(T::Scalar(s)) if s.kind == K::Sint => "volact_i32",
                Some(T::Scalar(s)) if s.kind == K::Uint => "volact_u32",
                Some(T::Scalar(s)) if s.kind == K::Bool => "volact_bool",
                Some(T::Vector { size: V::Bi, .. }) => "volact_vec2",
                Some(T::Vector { size: V::Tri, .. }) => "volact_vec3",
                Some(T::Vector { size: V::Quad, .. }) => "volact_vec4",
                Some(T::Matrix { .. }) => "volact_matrix",
                _ => "volact_f32",
            }
        }
    }
}

/// Whose functions a hook calls, by compositing and by whether there are slice planes.
type Who = fn(Compositing, bool) -> bool;

/// The stage's hooks.
const HOOKED: [(&str, Entry, Who); 5] = [
    ("volact_shade", Entry::Shade, |kind, _| kind == Compositing::Over),
    ("volact_shade_hit", Entry::Shade, |kind, planes| kind == Compositing::First || planes && is_deep(kind)),
    ("volact_shade_flat", Entry::Shade, |kind, _| !is_deep(kind)),
    ("volact_value_hit", Entry::Value, |kind, _| kind == Compositing::First),
    ("volact_value_flat", Entry::Value, |kind, _| !is_deep(kind)),
];

/// A function that calls that of a shape that is there, by its number.
fn dispatch(
    merger: &mut Merger,
    import: &mut Import<'_>,
    (stage, hook): (&Module, &str),
    (entry, budget): (Entry, u32),
    (shapes, there): (&[Shape], &dyn Fn(usize) -> bool),
) -> Result<Function, ComposeError> {
    let handle = named(stage, hook).ok_or_else(|| ComposeError::inner(format!("no hook {hook}")))?;
    let model = &stage.functions[handle];
    let mut types = Vec::new();
    for argument in &model.arguments {
        types.push(merger.ty(import, argument.ty)?);
    }
    let result = model.result.as_ref().ok_or_else(|| ComposeError::inner("a hook without a result"))?.ty;
    let result = merger.ty(import, result)?;
    let argument = |(ty, model): (&Handle<Type>, &FunctionArgument)| FunctionArgument { ty: *ty, ..model.clone() };
    let mut made = Function {
        name: Some(hook.into()),
        arguments: types.iter().zip(&model.arguments).map(argument).collect(),
        result: Some(FunctionResult { ty: result, binding: None }),
        ..Function::default()
    };
    let shape = made.expressions.append(Expression::FunctionArgument(0), Span::UNDEFINED);
    let sample = made.expressions.append(Expression::FunctionArgument(1), Span::UNDEFINED);
    let mut cases = Vec::new();
    for (number, other) in shapes.iter().enumerate().filter(|(i, _)| there(*i)) {
        let Some((_, function)) = other.entries.iter().find(|(e, _)| *e == entry) else { continue };
        let mut body = Block::new();
        let given = match other.sample {
            Some(ty) if ty != types[1] => converted(&mut made, &mut body, sample, ty, &other.numbers),
            _ => sample,
        };
        let called = made.expressions.append(Expression::CallResult(*function), Span::UNDEFINED);
        let call = Statement::Call { function: *function, arguments: vec![given], result: Some(called) };
        body.push(call, Span::UNDEFINED);
        body.push(Statement::Return { value: Some(called) }, Span::UNDEFINED);
        cases.push(SwitchCase { value: SwitchValue::U32(number as u32), body, fall_through: false });
    }
    cases.push(SwitchCase { value: SwitchValue::Default, body: Block::new(), fall_through: false });
    begin(merger, &mut made, shape, budget)?;
    made.body.push(Statement::Switch { selector: shape, cases }, Span::UNDEFINED);
    let zero = made.expressions.append(Expression::ZeroValue(result), Span::UNDEFINED);
    made.body.push(Statement::Return { value: Some(zero) }, Span::UNDEFINED);
    Ok(made)
}

/// A sample as a shader's own type of it, whose further members are numbers of vertices.
fn converted(
    made: &mut Function,
    body: &mut Block,
    sample: Handle<Expression>,
    ty: Handle<Type>,
    numbers: &[Handle<Function>],
) -> Handle<Expression> {
    let mut read = Vec::new();
    for function in numbers {
        let result = made.expressions.append(Expression::CallResult(*function), Span::UNDEFINED);
        let call = Statement::Call { function: *function, arguments: Vec::new(), result: Some(result) };
        body.push(call, Span::UNDEFINED);
        read.push(result);
    }
    let start = made.expressions.len();
    let member = |index: usize| Expression::AccessIndex { base: sample, index: index as u32 };
    let mut components: Vec<_> =
        (0..PLAIN_MEMBERS).map(|index| made.expressions.append(member(index), Span::UNDEFINED)).collect();
    components.extend(read);
    let whole = made.expressions.append(Expression::Compose { ty, components }, Span::UNDEFINED);
    body.push(Statement::Emit(made.expressions.range_from(start)), Span::UNDEFINED);
    whole
}

/// Members that every shader's samples have.
const PLAIN_MEMBERS: usize = 6;

/// Fills the budget of loops, and says whose it is.
fn begin(merger: &Merger, made: &mut Function, shape: Handle<Expression>, budget: u32) -> Result<(), ComposeError> {
    let variable = |name: &str| {
        let mut all = merger.module.global_variables.iter();
        let found = all.find(|(_, v)| v.name.as_deref() == Some(name)).map(|(handle, _)| handle);
        found.ok_or_else(|| ComposeError::inner(format!("no variable {name}")))
    };
    let (rounds, current) = (variable("volact_rounds")?, variable("volact_shape")?);
    let budget = made.expressions.append(Expression::Literal(Literal::U32(budget)), Span::UNDEFINED);
    for (variable, value) in [(rounds, budget), (current, shape)] {
        let pointer = made.expressions.append(Expression::GlobalVariable(variable), Span::UNDEFINED);
        made.body.push(Statement::Store { pointer, value }, Span::UNDEFINED);
    }
    Ok(())
}
