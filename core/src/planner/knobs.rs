//! What there is to choose of an action, found from the options that it declares.

use crate::{Declaration, Options, ParameterDecl, ParameterType, ParameterValue};

/// What varying an option changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The distance of samples.
    Step,
    /// How the picture is sampled or classified: combined with each other.
    Method,
    /// Formats, filters, precision, widths, bounds: varied one at a time.
    Precision,
}

/// The option that holds the distance of samples.
pub const STEP: &str = "sample_distance";

/// What an option is for, by its name; `None` where it is no axis, as threads and adapters are none.
pub fn role(name: &str) -> Option<Role> {
    match name {
        STEP => Some(Role::Step),
        "method" | "sampling" | "classification" | "pre_integration" => Some(Role::Method),
        "format" | "texture_format" | "filter" | "blend" | "blend_precision" | "accumulation" | "target"
        | "table_width" | "termination" => Some(Role::Precision),
        _ => None,
    }
}

/// Whether an option's choices change the time at the same bytes, so that a planner varies them.
fn is_varied(option: &ParameterDecl) -> bool {
    role(&option.name) == Some(Role::Method) || option.name == "filter"
}

/// Combinations of choices of an action that a planner chooses from, without the distance of samples. What is
/// `given` is kept as it is. `auto` stands for one of the others and is left out where there are others.
pub fn candidates(declaration: &Declaration, given: &Options) -> Vec<Options> {
    let mut all = vec![Options::new()];
    for option in declaration.parameters.iter().filter(|p| is_varied(p) && !given.contains_key(&p.name)) {
        let values = values(option);
        if !values.is_empty() {
            let with = |base: &Options, value: &ParameterValue| {
                let mut options = base.clone();
                options.insert(option.name.clone(), value.clone());
                options
            };
            all =
                all.iter().flat_map(|base| values.iter().map(|value| with(base, value)).collect::<Vec<_>>()).collect();
        }
    }
    all
}

fn values(option: &ParameterDecl) -> Vec<ParameterValue> {
    if option.types.contains(&ParameterType::Bool) {
        return [false, true].map(ParameterValue::Bool).to_vec();
    }
    let single = option.choices.len() == 1;
    let named = option.choices.iter().filter(|word| single || *word != "auto");
    named.cloned().map(ParameterValue::Choice).collect()
}

/// Whether an action has a distance of samples to choose.
pub fn has_step(declaration: &Declaration, given: &Options) -> bool {
    declaration.parameter(STEP).is_some() && !given.contains_key(STEP)
}

/// Choices in words: `cpu classification=post`.
pub fn words(action: &str, options: &Options) -> String {
    options.iter().fold(action.to_owned(), |text, (name, value)| format!("{text} {name}={}", word(value)))
}

/// A value as a user writes it.
pub fn word(value: &ParameterValue) -> String {
    match value {
        ParameterValue::Choice(word) => word.clone(),
        ParameterValue::Bool(b) => b.to_string(),
        ParameterValue::Int(i) => i.to_string(),
        ParameterValue::Float(f) => f.to_string(),
        other => format!("{other:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::Kind;

    #[test]
    fn choices_of_methods_and_filters_are_combined_and_what_is_given_is_kept() {
        let choice = |name: &str, words: &[&str]| {
            ParameterDecl::new(name, ParameterType::Choice, "").choices(words).default(words[0])
        };
        let declaration = Declaration::new(Kind::Action, "a", "1", "")
            .with(ParameterDecl::new(STEP, ParameterType::Float, ""))
            .with(choice("method", &["auto", "rays", "slices"]))
            .with(choice("filter", &["exact", "hardware"]))
            .with(choice("format", &["auto", "r8"]))
            .with(choice("adapter", &["one", "two"]));
        let all: Vec<_> = candidates(&declaration, &Options::new()).iter().map(|o| words("a", o)).collect();
        let wanted = [
            "a filter=exact method=rays",
            "a filter=hardware method=rays",
            "a filter=exact method=slices",
            "a filter=hardware method=slices",
        ];
        assert_eq!(all, wanted);
        let given = Options::from([("method".to_owned(), ParameterValue::from("rays"))]);
        assert_eq!(candidates(&declaration, &given).len(), 2);
        assert!(has_step(&declaration, &given));
        assert!(!has_step(&declaration, &Options::from([(STEP.to_owned(), 1.0.into())])));
    }
}
