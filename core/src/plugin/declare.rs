//! Declarations across the boundary.

use super::{
    abi::{self, DeclarationView, ParameterDeclView},
    arena::{Arena, NO_VALUE, flag, list_of, string_of},
    array::{Passing, is_none},
    status::{Code, Fault},
    value::{Identities, KINDS, decode, lend_value},
};
use crate::{Compositing, Declaration, ParameterDecl, parameter::Kind};

const COMPOSITINGS: [(Compositing, u32); 6] = [
    (Compositing::Over, abi::COMPOSITE_OVER),
    (Compositing::Maximum, abi::COMPOSITE_MAXIMUM),
    (Compositing::Minimum, abi::COMPOSITE_MINIMUM),
    (Compositing::Average, abi::COMPOSITE_AVERAGE),
    (Compositing::Add, abi::COMPOSITE_ADD),
    (Compositing::First, abi::COMPOSITE_FIRST),
];

/// The code of a way of compositing.
pub(super) fn compositing_code(compositing: Compositing) -> u32 {
    COMPOSITINGS.iter().find(|(c, _)| *c == compositing).map_or(0, |(_, code)| *code)
}

/// The way of compositing of a code.
pub(super) fn compositing_of(code: u32) -> Result<Compositing, Fault> {
    let known = COMPOSITINGS.iter().find(|(_, c)| *c == code).map(|(c, _)| *c);
    known.ok_or_else(|| Fault::new(Code::Unsupported, format!("way of compositing is code {code}, wanted 1 to 6")))
}

/// The ways of compositing of a set of bits.
pub(super) fn compositings_of(bits: u32) -> Vec<Compositing> {
    COMPOSITINGS.iter().filter(|(_, code)| bits >> code & 1 == 1).map(|(c, _)| *c).collect()
}

/// Ways of compositing as a set of bits.
pub(super) fn compositing_bits(all: &[Compositing]) -> u32 {
    all.iter().fold(0, |bits, c| bits | 1 << compositing_code(*c))
}

/// A declaration as a view that is valid as long as the arena.
pub(super) fn lend_declaration(declaration: &Declaration, arena: &mut Arena) -> DeclarationView {
    let mut all = Vec::new();
    for p in &declaration.parameters {
        let kinds = p.types.iter().flat_map(|t| KINDS.iter().find(|(known, _)| known == t));
        let choices = p.choices.iter().map(|c| arena.text(c)).collect();
        let (choices, choice_count) = arena.list(choices);
        all.push(ParameterDeclView {
            name: arena.text(&p.name),
            description: arena.text(&p.description),
            unit: arena.text(&p.unit),
            kinds: kinds.fold(0, |bits, (_, kind)| bits | 1 << kind),
            required: u32::from(p.required),
            bounded: u32::from(p.bounds.is_some()),
            bounds: p.bounds.unwrap_or_default(),
            default: p.default.as_ref().map_or(NO_VALUE, |value| lend_value(value, arena)),
            choices,
            choice_count,
        });
    }
    let (parameters, parameter_count) = arena.list(all);
    DeclarationView {
        name: arena.text(&declaration.name),
        version: arena.text(&declaration.version),
        description: arena.text(&declaration.description),
        parameters,
        parameter_count,
    }
}

/// A declaration of the other side.
///
/// # Safety
/// What the view says is true.
pub(super) unsafe fn decode_declaration(view: &DeclarationView, kind: Kind) -> Result<Declaration, Fault> {
    let what = |part: &str| format!("{part} of a registered {}", kind.name());
    // SAFETY: as promised by the caller.
    let name = unsafe { string_of(view.name, &what("name")) }?;
    if name.is_empty() {
        return Err(Fault::new(Code::BadName, format!("{} is empty", what("name"))));
    }
    // SAFETY: as promised by the caller.
    let version = unsafe { string_of(view.version, &what("version")) }?;
    // SAFETY: as promised by the caller.
    let description = unsafe { string_of(view.description, &what("description")) }?;
    let mut made = Declaration::new(kind, &name, &version, &description);
    // SAFETY: as promised by the caller.
    for parameter in unsafe { list_of(view.parameters, view.parameter_count, "declared parameters") }? {
        // SAFETY: as promised by the caller.
        let decl = unsafe { decode_parameter(parameter) };
        let decl = decl.map_err(|f| Fault::new(f.code, format!("{} {name:?}: {}", kind.name(), f.message)))?;
        if made.parameter(&decl.name).is_some() {
            let message = format!("{} {name:?}: declares parameter {:?} twice", kind.name(), decl.name);
            return Err(Fault::new(Code::BadName, message));
        }
        made.parameters.push(decl);
    }
    Ok(made)
}

/// # Safety
/// What the view says is true.
unsafe fn decode_parameter(view: &ParameterDeclView) -> Result<ParameterDecl, Fault> {
    // SAFETY: as promised by the caller.
    let name = unsafe { string_of(view.name, "name of a parameter") }?;
    let types: Vec<_> = KINDS.iter().filter(|(_, kind)| view.kinds >> kind & 1 == 1).map(|(t, _)| *t).collect();
    let known = KINDS.iter().fold(0, |bits, (_, kind)| bits | 1u64 << kind);
    if types.is_empty() || view.kinds & !known != 0 {
        let message = format!("kinds of parameter {name:?} are {:#x}, wanted bits of {known:#x}", view.kinds);
        return Err(Fault::new(Code::Unsupported, message));
    }
    let mut words = Vec::new();
    // SAFETY: as promised by the caller.
    for choice in unsafe { list_of(view.choices, view.choice_count, "choices") }? {
        // SAFETY: as promised by the caller.
        words.push(unsafe { string_of(*choice, "a choice") }?);
    }
    let bounded = flag(view.bounded, &format!("whether parameter {name:?} is bounded"))?;
    let rise = view.bounds[0] <= view.bounds[1];
    if bounded && !rise {
        let found = format!("{:?}", view.bounds);
        return Err(Fault::bad(format!("bounds of parameter {name:?}"), found, "two numbers that rise"));
    }
    let mut decl = ParameterDecl {
        required: flag(view.required, &format!("whether parameter {name:?} is required"))?,
        types,
        default: None,
        bounds: bounded.then_some(view.bounds),
        choices: words,
        // SAFETY: as promised by the caller.
        unit: unsafe { string_of(view.unit, "unit") }?,
        // SAFETY: as promised by the caller.
        description: unsafe { string_of(view.description, "description") }?,
        name,
    };
    if !is_none(&view.default) {
        // SAFETY: as promised by the caller.
        let value = unsafe { decode(&view.default, &mut Identities::default(), &decl.name, Passing::Lent) }?;
        let value = decl.accept(&value).map_err(|p| Fault::new(Code::BadValue, format!("default: {p}")))?;
        decl.default = Some(value);
    }
    Ok(decl)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shader;

    #[test]
    fn declarations_come_through_as_they_are() {
        for entry in shader::builtin() {
            let mut arena = Arena::default();
            let view = lend_declaration(&entry.declaration, &mut arena);
            // SAFETY: the view is one of this module.
            let back = unsafe { decode_declaration(&view, Kind::Shader) }.unwrap();
            assert_eq!(back, entry.declaration);
            assert_eq!(compositing_of(compositing_code(entry.compositing)), Ok(entry.compositing));
        }
    }

    #[test]
    fn damaged_declarations_are_refused() {
        type Damage = fn(&mut ParameterDeclView);
        let declaration = Declaration::new(Kind::Geometry, "ball", "1", "round")
            .with(ParameterDecl::new("radius", crate::ParameterType::Float, "its radius").default(1.0));
        let damages: [(Damage, &str); 5] = [
            (|p| p.kinds = 0, "kinds of parameter \"radius\""),
            (|p| p.kinds |= 1 << 40, "kinds of parameter \"radius\""),
            (|p| p.required = 7, "wanted 0 or 1"),
            (|p| p.default.kind = abi::KIND_BOOL, "wanted one byte"),
            (|p| p.choice_count = 3, "choices is a null pointer"),
        ];
        for (damage, wanted) in damages {
            let mut arena = Arena::default();
            let mut view = lend_declaration(&declaration, &mut arena);
            // SAFETY: the list has one entry, and is copied.
            let mut parameter = unsafe { *view.parameters };
            damage(&mut parameter);
            view.parameters = &raw const parameter;
            // SAFETY: what is damaged is refused before it is used.
            let error = unsafe { decode_declaration(&view, Kind::Geometry) }.unwrap_err().to_string();
            assert!(error.contains("geometry \"ball\"") && error.contains(wanted), "{error}");
        }
    }
}
