//! Failures that are known: of one backend on one driver, with the words of the message.
//!
//! A case that is listed here and passes fails, so that the list shrinks with the faults.

use crate::outcome::Status;

/// A failure that is known.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// The action's name.
    pub backend: &'static str,
    /// A part of the device's description.
    pub driver: &'static str,
    /// The case: `topic::name`.
    pub case: &'static str,
    /// A part of the failure's message.
    pub message: &'static str,
    /// Why, and since when.
    pub why: &'static str,
}

/// All of them.
pub const KNOWN: &[Known] = &[Known {
    backend: "cpu",
    driver: "",
    case: "sampling::steps_in_tables_pre_integrated_are_of_second_order",
    message: "wanted 2 (1.7 to 2.3)",
    why: "pairs of values are tabulated, and a step is smeared over one node of the table, all to one side; below that \
          width the error no longer falls",
}];

/// What a case comes to, knowing these.
pub fn judge(known: &[Known], backend: &str, device: &str, case: &str, status: Status) -> Status {
    let Some(entry) = known.iter().find(|k| k.backend == backend && device.contains(k.driver) && k.case == case) else {
        return status;
    };
    match status {
        Status::Failed(why) if why.contains(entry.message) => Status::ExpectedFailure(format!("{} ({why})", entry.why)),
        Status::Passed => Status::Failed(format!(
            "passes, but is listed as a failure of {} on {:?}: {}",
            entry.backend, entry.driver, entry.why
        )),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: &[Known] =
        &[Known { backend: "gpu", driver: "llvmpipe", case: "a::b", message: "NaN", why: "driver 25.0 loses NaN" }];

    fn judged(backend: &str, device: &str, status: Status) -> Status {
        judge(LIST, backend, device, "a::b", status)
    }

    #[test]
    fn a_known_failure_is_expected_only_where_and_as_it_is_known() {
        let failed = |why: &str| Status::Failed(why.into());
        let found = judged("gpu", "llvmpipe 25", failed("NaN is black"));
        assert!(matches!(found, Status::ExpectedFailure(why) if why.contains("25.0")));
        assert_eq!(judged("gpu", "llvmpipe 25", failed("other")), failed("other"));
        assert_eq!(judged("gpu", "radv", failed("NaN is black")), failed("NaN is black"));
        assert_eq!(judged("cpu", "llvmpipe", failed("NaN is black")), failed("NaN is black"));
    }

    #[test]
    fn a_known_failure_that_passes_fails() {
        assert!(matches!(judged("gpu", "llvmpipe", Status::Passed), Status::Failed(why) if why.contains("passes")));
        let skipped = Status::Skipped("no".into());
        assert_eq!(judged("gpu", "llvmpipe", skipped.clone()), skipped);
    }
}
