//! What people repeat.
fn main() {}
