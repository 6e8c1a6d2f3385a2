//! volact-conformance
