//! volact
