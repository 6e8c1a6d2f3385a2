//! The conformance suite: what holds every action to one picture, and the harness of the tests.
//!
//! - A [`case`](case::Case) is a plain function over a [`Rig`](rig::Rig); [`catalog`] lists all,
//!   a file a topic in [`cases`].
//! - The [`runner`] expands cases × actions, `[cpu/AVX-512] clipping::plane_keeps_its_front`, for any
//!   action that a registry makes: built in, or a stranger's plugin.
//! - Truth in order: closed form, then [`reference`](volact_cpu::reference) on the lattice that the
//!   frame [says](method) it was drawn on. [`truth`] makes it when asked and keeps it.
//! - A [`tolerance`] is derived: from the precision that the frame reports and from how much the
//!   true picture changes where the scene is moved a little. Nothing is tuned.
//! - What was found is [`outcome::CaseResult`], a JSON a case, from which [`report`] draws a page.
//!
//! The tests in `tests/contract/` use [`rig::Setup`], [`scene`], [`meshes`] and [`metrics`] directly.

pub mod atlas;
pub mod case;
pub mod cases;
pub mod catalog;
pub mod chart;
pub mod expected;
pub mod meshes;
pub mod method;
pub mod metrics;
pub mod outcome;
pub mod plot;
pub mod report;
pub mod reproduce;
pub mod rig;
pub mod rules;
pub mod runner;
pub mod scene;
pub mod study;
pub mod subject;
pub mod tables;
pub mod timed;
pub mod tolerance;
pub mod truth;
pub mod voxels;
