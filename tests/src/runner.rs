//! Expands cases × action, runs them, and judges.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::Instant,
};

use volact_core::{ActionError, Options, Registry, registry::RegisterError};

use crate::{
    case::{Case, Stop, Verdict},
    catalog,
    expected::{KNOWN, judge},
    outcome::{CaseResult, Check, Run, Status},
    rig::Rig,
    subject::Subject,
    truth::Truths,
};

/// The cases and the truths that runs share.
pub struct Suite {
    registry: Registry,
    cases: Vec<Case>,
    truths: Truths,
}

/// Which cases.
#[derive(Clone, Debug, Default)]
pub struct Filter {
    /// Topics by name; all where empty.
    pub topics: Vec<String>,
    /// Parts of `topic::name`; all where empty.
    pub cases: Vec<String>,
    /// Only cases that expect an order of an error, or that nothing changes.
    pub studies: bool,
}

impl Filter {
    /// Whether a case is meant.
    pub fn takes(&self, case: &Case) -> bool {
        let id = case.id();
        (case.expects.is_some() || !self.studies)
            && (self.topics.is_empty() || self.topics.iter().any(|t| t == case.topic))
            && (self.cases.is_empty() || self.cases.iter().any(|c| id.contains(c.as_str())))
    }
}

impl Suite {
    /// All cases, for actions of this registry. Shaders that come with Volact are added by their
    /// sources where the registry has none of the name.
    ///
    /// # Errors
    /// If the names of shaders cannot be used, which would be a fault of the crates.
    pub fn new(registry: &Registry) -> Result<Self, RegisterError> {
        let mut registry = registry.clone();
        for entry in volact_shaders::builtin().unwrap_or_default() {
            if registry.shaders().get(&entry.declaration.name).is_none() {
                registry.add_shader(entry)?;
            }
        }
        Ok(Self { registry, cases: catalog::all(), truths: Truths::default() })
    }

    /// The registry with all shaders.
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// All cases.
    pub fn cases(&self) -> &[Case] {
        &self.cases
    }

    /// An action to test.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn subject(&self, action: &str, options: &Options) -> Result<Subject, ActionError> {
        Subject::new(&self.registry, action, options)
    }

    /// Runs the cases that a filter takes, and tells of each as it ends.
    pub fn run(&self, subject: &Subject, filter: &Filter, mut told: impl FnMut(&CaseResult)) -> Run {
        let mut run = Run { subject: subject.label(), device: subject.caps.device.clone(), cases: Vec::new() };
        for case in self.cases.iter().filter(|c| filter.takes(c)) {
            let result = self.case(subject, case);
            told(&result);
            run.cases.push(result);
        }
        run
    }

    /// Runs one case.
    pub fn case(&self, subject: &Subject, case: &Case) -> CaseResult {
        let started = Instant::now();
        let missing = case.needs.iter().find_map(|n| n.missing(&subject.caps, &subject.declaration, &self.registry));
        let (status, checks) = match missing {
            Some(reason) => (Status::Skipped(reason), Vec::new()),
            None => self.execute(subject, case),
        };
        CaseResult {
            subject: subject.label(),
            topic: case.topic.into(),
            name: case.name.clone(),
            about: case.about.clone(),
            needs: case.needs.iter().map(|n| n.name()).collect(),
            expects: case.expects,
            status: judge(KNOWN, &subject.action, &subject.caps.device, &case.id(), status),
            checks,
            seconds: started.elapsed().as_secs_f64(),
        }
    }

    fn execute(&self, subject: &Subject, case: &Case) -> (Status, Vec<Check>) {
        let mut rig = Rig::new(&self.registry, subject, &self.truths, &case.id());
        let ended = catch_unwind(AssertUnwindSafe(|| case.run(&mut rig)));
        let verdict = ended.unwrap_or_else(|payload| Err(Stop::Fail(format!("panicked: {}", text(&*payload)))));
        let checks = rig.into_checks();
        (conclude(verdict, &checks), checks)
    }
}

/// What checks and the end of a case come to. What failed before a skip has failed.
fn conclude(verdict: Verdict, checks: &[Check]) -> Status {
    let failed: Vec<_> = checks.iter().filter(|c| !c.passed).map(|c| format!("{}: {}", c.label, c.message)).collect();
    match verdict {
        Err(Stop::Fail(why)) => Status::Failed([failed, vec![why]].concat().join("; ")),
        _ if !failed.is_empty() => Status::Failed(failed.join("; ")),
        Err(Stop::Skip(why)) => Status::Skipped(why),
        Ok(()) if checks.is_empty() => Status::Failed("the case looked at nothing".into()),
        Ok(()) => Status::Passed,
    }
}

fn text(payload: &(dyn std::any::Any + Send)) -> &str {
    let word = payload.downcast_ref::<&str>().copied();
    word.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("without words")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig;

    fn check(passed: bool) -> Check {
        Check {
            label: "a".into(),
            truth: String::new(),
            passed,
            message: "b".into(),
            figures: None,
            sheet: None,
            study: None,
            method: None,
            scene: None,
            files: Vec::new(),
        }
    }

    #[test]
    fn a_failure_before_a_skip_is_a_failure() {
        let skip = || Err(Stop::Skip("cannot".into()));
        assert_eq!(conclude(skip(), &[check(true)]), Status::Skipped("cannot".into()));
        assert_eq!(conclude(skip(), &[check(false)]), Status::Failed("a: b".into()));
        assert_eq!(conclude(Ok(()), &[check(true)]), Status::Passed);
        assert!(matches!(conclude(Ok(()), &[]), Status::Failed(_)));
        assert_eq!(conclude(Err(Stop::Fail("c".into())), &[check(false)]), Status::Failed("a: b; c".into()));
    }

    /// `null` draws nothing: each case says why it is skipped, and the run fails.
    #[test]
    fn a_run_that_executes_nothing_fails() {
        let suite = Suite::new(&rig::registry()).unwrap();
        let subject = suite.subject("null", &Options::default()).unwrap();
        let filter = Filter { topics: vec!["tables".into(), "clipping".into()], ..Filter::default() };
        let run = suite.run(&subject, &filter, |_| ());
        assert!(run.cases.iter().all(|c| matches!(&c.status, Status::Skipped(why) if !why.is_empty())));
        assert!(!run.passed() && run.summary().contains("no case was executed"));
    }

    #[test]
    fn panics_are_failures() {
        let mut topic = crate::case::Topic::new("odd", &[]);
        topic.case("panics", "nothing", |_| panic!("on purpose"));
        let suite = Suite { registry: rig::registry(), cases: topic.done(), truths: Truths::default() };
        let subject = suite.subject("null", &Options::default()).unwrap();
        let run = suite.run(&subject, &Filter::default(), |_| ());
        assert!(run.cases[0].status.why().contains("on purpose"));
    }
}
