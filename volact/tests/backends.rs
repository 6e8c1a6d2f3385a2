//! The example that leaves its backend to a config.

#[path = "../../examples/backend/main.rs"]
#[expect(dead_code, reason = "the program's own main")]
mod backend;

use std::path::Path;

use volact::{
    Options, Registry, RegistryExt as _,
    metrics::{self, Image},
};

/// Each config gets its action, and all give one picture.
#[test]
fn configs_choose_backends_and_no_other_picture() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let scene = examples.join("head/scene.ron");
    let registry = Registry::with_builtins();
    let draw = |name: &str| backend::draw(&examples.join(format!("backend/{name}.ron")), &scene);
    let wanted = draw("cpu").unwrap();
    for name in ["cpu", "wgpu", "vulkan"] {
        let action = match registry.action(name, &Options::new()) {
            Ok(action) => action,
            Err(error) => {
                println!("skipped {name}: {error}");
                assert!(draw(name).unwrap_err().to_string().contains(name));
                continue;
            }
        };
        let found = draw(name).unwrap();
        assert_eq!(found.method.device, action.caps().device, "{name}");
        let [a, b] = [&wanted, &found].map(|f| Image { width: f.width, height: f.height, rgba: &f.color });
        let off = metrics::compare(&a, &b).unwrap();
        // Half a voxel's step against another: what both may be off from the truth.
        assert!(off.rmse < 0.01 && off.max < 0.2, "{name}: {} {}", off.rmse, off.max);
    }
}
