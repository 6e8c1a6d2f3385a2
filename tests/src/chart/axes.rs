//! From the options that an action declares to the settings that are measured.
//!
//! What an option means is read from its name by one small table ([`role`]); its values are those that it
//! declares. The step and the ways of sampling and classifying are combined in full; every other axis is
//! varied by itself, at every step.

use std::collections::BTreeMap;

use volact_core::{
    Declaration, Options, ParameterDecl, ParameterType, ParameterValue,
    planner::knobs::{Role, role, word},
};

/// Values of a number that has no choices of its own.
fn numbers(name: &str) -> &'static [f64] {
    match name {
        "table_width" => &[64.0, 256.0, 1024.0, 4096.0],
        "termination" => &[0.0, 0.05],
        _ => &[],
    }
}

/// One setting of an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// The action.
    pub action: String,
    /// Its options, the user's included.
    pub options: Options,
    /// The step, in world units.
    pub step: Option<f64>,
    /// Action and options that are varied, without the step: `wgpu format=r8`.
    pub series: String,
}

impl Setting {
    /// Series and step.
    pub fn label(&self) -> String {
        label(&self.series, self.step)
    }

    /// All options in words.
    pub fn words(&self) -> BTreeMap<String, String> {
        self.options.iter().map(|(name, value)| (name.clone(), word(value))).collect()
    }
}

/// Series and step in words.
pub fn label(series: &str, step: Option<f64>) -> String {
    step.map_or(series.to_owned(), |h| format!("{series} at {}", rounded(h)))
}

/// Four digits of a step, whatever its size.
fn rounded(step: f64) -> f64 {
    let unit = 10f64.powi(3 - step.log10().floor() as i32);
    (step * unit).round() / unit
}

/// All settings of an action: `given` options are not varied. Those with everything else as it is by
/// default come first, and coarse steps before fine ones, so that a short run shows the most.
pub fn settings(declaration: &Declaration, given: &Options, steps: &[f64]) -> Vec<Setting> {
    let free: Vec<_> = declaration.parameters.iter().filter(|p| !given.contains_key(&p.name)).collect();
    let of = |wanted: Role| free.iter().copied().filter(move |p| role(&p.name) == Some(wanted));
    let mut variants = vec![Options::new()];
    for option in of(Role::Method) {
        let more: Vec<_> =
            variants.iter().flat_map(|v| values(option).into_iter().map(|x| with(v, option, x))).collect();
        variants.extend(more);
    }
    for option in of(Role::Precision) {
        variants.extend(values(option).into_iter().map(|value| with(&Options::new(), option, value)));
    }
    let steps: Vec<Option<f64>> = match of(Role::Step).next() {
        Some(_) => steps.iter().copied().map(Some).collect(),
        None => vec![None],
    };
    let step_option = of(Role::Step).next().map(|p| p.name.clone());
    let setting = |variant: &Options, step: Option<f64>| {
        let series: String = variant.iter().map(|(name, value)| format!(" {name}={}", word(value))).collect();
        let mut options = given.clone();
        options.extend(variant.clone());
        if let (Some(step), Some(name)) = (step, &step_option) {
            options.insert(name.clone(), step.into());
        }
        Setting { action: declaration.name.clone(), options, step, series: format!("{}{series}", declaration.name) }
    };
    variants.iter().flat_map(|v| steps.iter().map(move |s| (v, *s))).map(|(v, s)| setting(v, s)).collect()
}

/// The values of an option other than its default.
fn values(option: &ParameterDecl) -> Vec<ParameterValue> {
    let number = |v: f64| {
        let integral = option.types.contains(&ParameterType::Int) && !option.types.contains(&ParameterType::Float);
        if integral { ParameterValue::Int(v as i64) } else { ParameterValue::Float(v) }
    };
    let all: Vec<_> = if option.types.contains(&ParameterType::Bool) {
        [false, true].map(ParameterValue::Bool).to_vec()
    } else if option.choices.is_empty() {
        numbers(&option.name).iter().map(|v| number(*v)).collect()
    } else {
        option.choices.iter().cloned().map(ParameterValue::Choice).collect()
    };
    all.into_iter().filter(|v| option.default.as_ref() != Some(v) && option.accept(v).is_ok()).collect()
}

fn with(variant: &Options, option: &ParameterDecl, value: ParameterValue) -> Options {
    let mut variant = variant.clone();
    variant.insert(option.name.clone(), value);
    variant
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::parameter::Kind;

    fn declaration() -> Declaration {
        let choice = |name: &str, words: &[&str]| {
            ParameterDecl::new(name, ParameterType::Choice, "").choices(words).default(words[0])
        };
        Declaration::new(Kind::Action, "a", "1", "")
            .with(ParameterDecl::new("sample_distance", ParameterType::Float, "").bounds(1e-300, 1e300))
            .with(choice("method", &["auto", "rays", "slices"]))
            .with(choice("classification", &["post", "pre-integrated"]))
            .with(choice("filter", &["exact", "hardware"]))
            .with(ParameterDecl::new("table_width", ParameterType::Int, "").bounds(2.0, 300.0))
            .with(ParameterDecl::new("termination", ParameterType::Float, "").bounds(0.0, 1.0).default(0.0))
            .with(ParameterDecl::new("threads", ParameterType::Int, "").default(0i64))
    }

    fn series(settings: &[Setting]) -> Vec<&str> {
        let mut all: Vec<_> = settings.iter().map(|s| s.series.as_str()).collect();
        all.dedup();
        all
    }

    #[test]
    fn methods_are_combined_and_the_rest_is_varied_one_at_a_time() {
        let all = settings(&declaration(), &Options::new(), &[2.0, 1.0]);
        let wanted = [
            "a",
            "a method=rays",
            "a method=slices",
            "a classification=pre-integrated",
            "a classification=pre-integrated method=rays",
            "a classification=pre-integrated method=slices",
            "a filter=hardware",
            "a table_width=64",
            "a table_width=256",
            "a termination=0.05",
        ];
        assert_eq!(series(&all), wanted);
        assert_eq!(all.len(), 2 * wanted.len());
        assert_eq!((all[0].step, all[1].step), (Some(2.0), Some(1.0)));
        assert_eq!(all[0].options, Options::from([("sample_distance".to_owned(), 2.0.into())]));
    }

    #[test]
    fn what_the_user_sets_is_not_varied() {
        let given = Options::from([("method".to_owned(), "rays".into()), ("sample_distance".to_owned(), 3.0.into())]);
        let all = settings(&declaration(), &given, &[2.0, 1.0]);
        assert!(all.iter().all(|s| s.options["method"] == "rays".into() && s.step.is_none()));
        assert!(all.iter().all(|s| s.options["sample_distance"] == 3.0.into()));
        assert_eq!(all.len(), 1 + 1 + 1 + 2 + 1);
    }

    #[test]
    fn an_action_without_options_has_one_setting() {
        let all = settings(&Declaration::new(Kind::Action, "plain", "1", ""), &Options::new(), &[1.0, 0.5]);
        assert_eq!((all.len(), all[0].series.as_str(), all[0].step), (1, "plain", None));
    }
}
