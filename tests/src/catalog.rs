//! All cases, in the order of their topics.

use crate::{case::Case, cases};

/// A topic and what lists its cases.
type Lister = fn() -> Vec<Case>;

/// The topics with what they are about.
pub const TOPICS: &[(&str, Lister)] = &[
    ("grids", cases::grids::cases),
    ("formats", cases::formats::cases),
    ("nan", cases::nan::cases),
    ("transforms", cases::transforms::cases),
    ("cameras", cases::cameras::cases),
    ("tables", cases::tables::cases),
    ("opacity", cases::opacity::cases),
    ("shaders", cases::shaders::cases),
    ("geometry", cases::geometry::cases),
    ("sampling", cases::sampling::cases),
    ("clipping", cases::clipping::cases),
    ("slices", cases::slices::cases),
    ("overlap", cases::overlap::cases),
    ("opaque", cases::opaque::cases),
    ("depth", cases::depth::cases),
    ("changes", cases::changes::cases),
    ("life", cases::life::cases),
    ("errors", cases::errors::cases),
    ("statistics", cases::statistics::cases),
    ("determinism", cases::determinism::cases),
];

/// Every case.
pub fn all() -> Vec<Case> {
    TOPICS.iter().flat_map(|(_, cases)| cases()).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_catalog_has_200_cases_of_different_names() {
        let all = all();
        let names: BTreeSet<_> = all.iter().map(Case::id).collect();
        assert_eq!(names.len(), all.len(), "names are keys");
        assert!(all.len() >= 200, "{} cases", all.len());
        assert!(
            all.iter().all(|c| !c.about.is_empty() && c.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'))
        );
    }

    #[test]
    fn cases_lie_in_the_topic_that_lists_them() {
        for (topic, cases) in TOPICS {
            let cases = cases();
            assert!(cases.len() >= 3, "{topic} has {} cases", cases.len());
            assert!(cases.iter().all(|c| c.topic == *topic), "{topic}");
        }
    }
}
