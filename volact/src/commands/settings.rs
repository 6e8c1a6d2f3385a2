//! Settings from the command line and the config file.

use std::{env, path::PathBuf, str::FromStr};

use anyhow::{Context as _, anyhow, bail};
use volact::{
    Options, View,
    config::Config,
    core::{glam::DVec3, names, scene::ParameterSpec},
};

/// Columns and rows of a picture: `640x480`, or `512` for a square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size(pub [usize; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |t: &str| t.parse().ok().filter(|n| *n > 0).ok_or_else(|| wanted(text, "640x480 or 512"));
        match text.split_once(['x', 'X', '×']) {
            Some((w, h)) => Ok(Self([side(w)?, side(h)?])),
            None => Ok(Self([side(text)?; 2])),
        }
    }
}

fn wanted(found: &str, wanted: &str) -> String {
    format!("found {found:?}, wanted {wanted}")
}

/// A positive, finite number.
pub fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite());
    number.ok_or_else(|| wanted(text, "a positive, finite number"))
}

/// A view by its name.
pub fn view(name: &str) -> Result<View, String> {
    let known = View::ALL.map(|(name, _)| name);
    View::from_name(name).ok_or_else(|| format!("wanted one of {}{}", known.join(", "), names::hint(name, known)))
}

/// What is up: an axis, or against it.
pub fn up(text: &str) -> Result<DVec3, String> {
    let (sign, axis) = text.strip_prefix('-').map_or((1.0, text), |axis| (-1.0, axis));
    let place = ["x", "y", "z"].iter().position(|name| *name == axis);
    place.map(|axis| sign * DVec3::AXES[axis]).ok_or_else(|| wanted(text, "x, y, z, -x, -y or -z"))
}

/// A background: `r,g,b` or `r,g,b,a`, each 0 to 1, or `#rrggbb`; opaque unless told.
pub fn background(text: &str) -> Result<[f32; 4], String> {
    let wrong = || wanted(text, "red,green,blue[,opacity] from 0 to 1, or #rrggbb");
    if let Some(hex) = text.strip_prefix('#') {
        let value = u32::from_str_radix(hex, 16).ok().filter(|_| hex.len() == 6).ok_or_else(wrong)?;
        let channel = |shift: u32| (value >> shift & 255) as f32 / 255.0;
        return Ok([channel(16), channel(8), channel(0), 1.0]);
    }
    let parts: Result<Vec<f32>, _> = text.split(',').map(|t| t.trim().parse()).collect();
    let parts = parts.map_err(|_| wrong())?;
    match parts.as_slice() {
        [r, g, b] => Ok([*r, *g, *b, 1.0]),
        [r, g, b, a] => Ok([*r, *g, *b, *a]),
        _ => Err(wrong()),
    }
}

/// A name and a value: `unit_distance=2`, `shift=(1, 0, 0)`, `lookup_table=WindowLevel(…)`.
#[derive(Clone, Debug)]
pub struct Setting {
    /// The name, as typed.
    pub name: String,
    /// The value.
    pub value: ParameterSpec,
}

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((name, value)) = text.split_once('=').filter(|(name, _)| !name.is_empty()) else {
            return Err(wanted(text, "NAME=VALUE"));
        };
        let value = value.trim();
        // A bare word is a choice; a shell would eat its quotation marks.
        let word = value.starts_with(|c: char| c.is_ascii_alphabetic())
            && value.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
            && !["true", "false", "inf"].contains(&value);
        let read = if word { format!("{value:?}") } else { value.to_owned() };
        let value = ParameterSpec::parse(&read).map_err(|problems| problems.to_string())?;
        Ok(Self { name: name.trim().to_owned(), value })
    }
}

/// Options of an action out of settings, which can be no volume.
pub fn options(settings: &[Setting]) -> anyhow::Result<Options> {
    let mut options = Options::new();
    for setting in settings {
        match &setting.value {
            ParameterSpec::Value(value) => _ = options.insert(setting.name.clone(), value.clone()),
            _ => bail!("option {:?} is a volume, table or attribute, wanted a plain value", setting.name),
        }
    }
    Ok(options)
}

/// The config in force: the file named, else `VOLACT_CONFIG`, else `volact/config.ron` in the
/// user's config folder if it is there, else the defaults. An empty `VOLACT_CONFIG` means the
/// defaults.
pub fn config(named: Option<PathBuf>) -> anyhow::Result<Config> {
    let path = config_file(named.clone()).filter(|path| named.is_some() || from_env().is_some() || path.is_file());
    let Some(path) = path else { return Ok(Config::default()) };
    log::info!("config {}", path.display());
    Config::open(&path).context("the config cannot be used")
}

/// The config file that is, or would be, in force.
pub fn config_file(named: Option<PathBuf>) -> Option<PathBuf> {
    match (named, from_env()) {
        (Some(named), _) => Some(named),
        (None, Some(path)) => Some(path).filter(|path| !path.as_os_str().is_empty()),
        (None, None) => user_config(),
    }
}

fn from_env() -> Option<PathBuf> {
    env::var_os("VOLACT_CONFIG").map(PathBuf::from)
}

fn user_config() -> Option<PathBuf> {
    Some(user_folder("XDG_CONFIG_HOME", "APPDATA", ".config")?.join("volact").join("config.ron"))
}

/// The user's folder for what can be made again, if there is one.
pub fn cache() -> Option<PathBuf> {
    Some(user_folder("XDG_CACHE_HOME", "LOCALAPPDATA", ".cache")?.join("volact"))
}

/// A folder of the user's by its variable here, its variable on Windows, or its name in the home folder.
fn user_folder(here: &str, windows: &str, name: &str) -> Option<PathBuf> {
    let folder = |name: &str| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    folder(here).or_else(|| folder(windows)).or_else(|| Some(folder("HOME")?.join(name)))
}

/// Splits `shape.parameter` into both, where there is a shape of that name.
pub fn shape_of<'a>(name: &'a str, shapes: &[String]) -> anyhow::Result<(Option<&'a str>, &'a str)> {
    let Some((shape, parameter)) = name.rsplit_once('.') else { return Ok((None, name)) };
    if shapes.iter().any(|known| known == shape) {
        return Ok((Some(shape), parameter));
    }
    let hint = names::hint(shape, shapes.iter().map(String::as_str));
    Err(anyhow!("no shape is called {shape:?}{hint}; known: {}", shapes.join(", ")))
}
