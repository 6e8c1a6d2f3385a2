//! The action `wgpu`.
