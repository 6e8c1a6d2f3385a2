//! Config files: defaults and preferences, as one RON document.
//!
//! A config is never needed: every part has a default, and the library reads none on its own.
//!
//! ```
//! use volact_core::config::Config;
//!
//! let config = Config::parse(r#"Config(
//!     version: 1,
//!     prefer: ["wgpu", "vulkan", "cpu"],           // the first that can draw a scene is taken
//!     options: {"cpu": {"threads": 2}},            // for each action, below what a scene says
//!     image: (size: (640, 480), background: (0, 0, 0, 1)),
//!     view: "iso",                                 // of scenes that have no camera
//!     plugins: [(name: "ring")],                   // libraries to load, each with or without a sha256
//!     shader_folders: ["shaders"],                 // where shaders are, name.ron beside name.wgsl
//!     plugin_folders: ["plugins"],                 // where they are looked for, from the config's folder on
//!     names: {"torus": "ring"},                    // whose registration is taken where several claim it
//! )"#)?;
//! assert_eq!(config.prefer, ["wgpu", "vulkan", "cpu"]);
//! assert_eq!(Config::parse("Config(version: 1)")?, Config::default());
//! # Ok::<(), volact_core::scene::Problems>(())
//! ```

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::{
    Options, View,
    plugin::host::{Wanted, sha256_of},
    scene::{
        ParameterSpec, Problems, SceneError, background, parse_document, plain_parameters, read_text,
        reader::{At, Reader},
        size, view,
    },
};

/// The version of the config format that this build reads.
pub const CONFIG_VERSION: u32 = 1;

/// The actions that are tried where nobody says otherwise.
pub const PREFERRED: [&str; 3] = ["wgpu", "vulkan", "cpu"];

/// Defaults and preferences.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The names of actions, best first. One that is not registered is passed over.
    pub prefer: Vec<String>,
    /// Options by the action's name.
    pub options: BTreeMap<String, Options>,
    /// Columns and rows of a picture that does not say.
    pub size: [usize; 2],
    /// The background of a picture that does not say: straight RGBA.
    pub background: [f32; 4],
    /// The view of a scene that does not say.
    pub view: View,
    /// Folders of shaders, all of which are registered.
    pub shader_folders: Vec<PathBuf>,
    /// The plugins to load. No other document can name any.
    pub plugins: Vec<Wanted>,
    /// The folders in which they are looked for, first come first served.
    pub plugin_folders: Vec<PathBuf>,
    /// The plugin whose registration is taken, for names that several claim.
    pub names: BTreeMap<String, String>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            prefer: PREFERRED.map(str::to_owned).to_vec(),
            options: BTreeMap::new(),
            size: [512, 512],
            background: [0.0, 0.0, 0.0, 1.0],
            view: View::Front,
            shader_folders: Vec::new(),
            plugins: Vec::new(),
            plugin_folders: Vec::new(),
            names: BTreeMap::new(),
        }
    }
}

impl Config {
    /// Reads a config from a text.
    ///
    /// # Errors
    /// All problems, in the order of the text.
    pub fn parse(text: &str) -> Result<Self, Problems> {
        let root = parse_document(text).map_err(|problem| Problems::new(vec![problem]))?;
        let mut reader = Reader::default();
        let at = reader.root(&root);
        let config = read(&mut reader, &at);
        reader.done()?;
        Ok(config.unwrap_or_default())
    }

    /// Reads a config file; its folders are taken from the file's own folder on.
    ///
    /// # Errors
    /// If the file cannot be read, or all its problems.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let text = read_text(path)?;
        let mut config = Self::parse(&text).map_err(|problems| problems.of_file(path.display().to_string()))?;
        let base = path.parent().unwrap_or(Path::new(""));
        let folders = config.shader_folders.iter_mut().chain(&mut config.plugin_folders);
        folders.for_each(|folder| *folder = base.join(&*folder));
        Ok(config)
    }

    /// The options of an action: those given, and below them those of this config.
    pub fn options_of(&self, action: &str, given: &Options) -> Options {
        let mut options = self.options.get(action).cloned().unwrap_or_default();
        options.extend(given.clone());
        options
    }
}

fn read(reader: &mut Reader, at: &At) -> Option<Config> {
    let known =
        ["version", "prefer", "options", "image", "view", "shader_folders", "plugins", "plugin_folders", "names"];
    let fields = reader.fields(at, &["Config"], &known)?;
    reader.version(&fields, CONFIG_VERSION);
    let mut config = Config::default();
    if let Some(at) = fields.optional("prefer") {
        let names = reader.list(&at, "a list of actions' names").unwrap_or_default();
        config.prefer = names.iter().filter_map(|at| reader.name(at)).collect();
        if names.is_empty() {
            reader.refuse::<()>(&at, "at least one action's name");
        }
    }
    if let Some(at) = fields.optional("options") {
        for (action, at) in reader.map(&at, "a map of options by action, {\"cpu\": {…}}") {
            config.options.insert(action.to_owned(), options(reader, &at));
        }
    }
    if let Some(at) = fields.optional("image")
        && let Some(image) = reader.fields(&at, &["Image"], &["size", "background"])
    {
        config.size = image.optional("size").and_then(|at| size(reader, &at)).unwrap_or(config.size);
        let color = image.optional("background").and_then(|at| background(reader, &at));
        config.background = color.unwrap_or(config.background);
    }
    if let Some(at) = fields.optional("plugins") {
        let listed = reader.list(&at, "a list of plugins, [(name: \"…\")]").unwrap_or_default();
        config.plugins = listed.iter().filter_map(|at| plugin(reader, at)).collect();
    }
    for (name, folders) in
        [("shader_folders", &mut config.shader_folders), ("plugin_folders", &mut config.plugin_folders)]
    {
        if let Some(at) = fields.optional(name) {
            let listed = reader.list(&at, "a list of folders").unwrap_or_default();
            *folders = listed.iter().filter_map(|at| reader.text(at)).map(PathBuf::from).collect();
        }
    }
    if let Some(at) = fields.optional("names") {
        for (name, at) in reader.map(&at, "a map of plugins by registered name, {\"torus\": \"ring\"}") {
            if let Some(plugin) = reader.name(&at) {
                config.names.insert(name.to_owned(), plugin);
            }
        }
    }
    config.view = fields.optional("view").and_then(|at| view(reader, &at)).unwrap_or_default();
    Some(config)
}

fn plugin(reader: &mut Reader, at: &At) -> Option<Wanted> {
    let fields = reader.fields(at, &["Plugin"], &["name", "sha256"])?;
    let name = reader.required(&fields, "name", "the plugin's name").and_then(|at| reader.name(&at));
    let mut sha256 = None;
    if let Some(at) = fields.optional("sha256") {
        // A pin that cannot be read must not be taken for none.
        sha256 = Some(reader.text(&at).and_then(sha256_of).or_else(|| reader.refuse(&at, "64 hexadecimal digits"))?);
    }
    Some(Wanted { name: name?, sha256 })
}

fn options(reader: &mut Reader, at: &At) -> Options {
    let value = |(name, spec)| match spec {
        ParameterSpec::Value(value) => Some((name, value)),
        _ => None,
    };
    plain_parameters(reader, at).into_iter().filter_map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ParameterValue;

    #[test]
    fn defaults_stated_equal_defaults_left_out() {
        let stated = r#"(version: 1, prefer: ["wgpu", "vulkan", "cpu"], options: {}, view: "front",
            image: (size: (512, 512), background: (0, 0, 0, 1)))"#;
        assert_eq!(Config::parse(stated).unwrap(), Config::default());
    }

    #[test]
    fn all_problems_come_at_once() {
        let text = "Config(\n  version: 2,\n  prefered: [],\n  options: {\"cpu\": {\"threads\": (1,)}},\n  view: \"frnt\",\n  image: (size: (0, 1)),\n)";
        let expected = "\
2:12: version: found 2, wanted 1, the version of the format that this build reads
3:3: found field `prefered`, wanted version, prefer, options, image, view, shader_folders, plugins, plugin_folders, names; did you mean \"prefer\"?
4:32: options.cpu.threads: found a tuple of 1 value, wanted 2, 3 or 4 numbers
5:9: view: found \"frnt\", wanted one of front, back, left, right, top, bottom, iso; did you mean \"front\"?
6:18: image.size[0]: found 0, wanted a whole number from 1 on";
        assert_eq!(Config::parse(text).unwrap_err().to_string(), expected);
    }

    #[test]
    fn plugins_are_read_and_bad_pins_refused() {
        let pin = "ab".repeat(32);
        let text = format!(
            "(version: 1, plugins: [(name: \"ring\"), (name: \"kit\", sha256: \"{pin}\")], \
             shader_folders: [\"looks\"], plugin_folders: [\"here\", \"/there\"], names: {{\"torus\": \"ring\"}})"
        );
        let config = Config::parse(&text).unwrap();
        let pins: Vec<_> = config.plugins.iter().map(|p| (p.name.as_str(), p.sha256)).collect();
        assert_eq!(pins, [("ring", None), ("kit", Some([0xab; 32]))]);
        assert_eq!(config.names["torus"], "ring");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.ron");
        std::fs::write(&path, &text).unwrap();
        let config = Config::open(&path).unwrap();
        assert_eq!(config.plugin_folders, [folder.path().join("here"), PathBuf::from("/there")]);
        assert_eq!(config.shader_folders, [folder.path().join("looks")]);

        let text = "(version: 1, plugins: [(name: \"kit\", sha256: \"abc\"), (sha256: 7), (nme: \"x\")])";
        let words = Config::parse(text).unwrap_err().to_string();
        for wanted in [
            "plugins[0].sha256: found \"abc\", wanted 64 hexadecimal digits",
            "plugins[1].name: found nothing",
            "`nme`",
        ] {
            assert!(words.contains(wanted), "{words}");
        }
    }

    #[test]
    fn given_options_win() {
        let config = Config::parse(r#"(version: 1, options: {"cpu": {"threads": 2, "jitter": true}})"#).unwrap();
        let given = Options::from([("threads".to_owned(), ParameterValue::Int(7))]);
        let options = config.options_of("cpu", &given);
        assert_eq!(options["threads"], ParameterValue::Int(7));
        assert_eq!(options["jitter"], ParameterValue::Bool(true));
        assert!(config.options_of("wgpu", &Options::new()).is_empty());
    }
}
