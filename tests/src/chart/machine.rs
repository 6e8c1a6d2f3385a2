//! What a machine is called, so that results of several can be told apart.

use std::{fs, thread};

/// Processor, threads and system: `AMD EPYC 9R14, 2 threads, linux`.
pub fn name() -> String {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let cpu = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| model(&text));
    let cpu = cpu.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    format!("{cpu}, {threads} threads, {}", std::env::consts::OS)
}

/// The processor's name in what Linux says of it.
fn model(text: &str) -> Option<String> {
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let name = line.split_once(':')?.1.split_whitespace().collect::<Vec<_>>().join(" ");
    (!name.is_empty()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn model_is_read_where_there_is_one() {
        assert_eq!(model("processor : 0\nmodel name\t: A   B @ 2\n").as_deref(), Some("A B @ 2"));
        assert_eq!(model("processor : 0\n"), None);
        assert!(name().contains("threads"));
    }
}
