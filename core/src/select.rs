//! Chooses an action: the first preferred one that can draw a scene, with the reasons why those
//! before it were not taken.

use std::fmt;

use thiserror::Error;

use crate::{
    ActionError, Caps, Compositing, Options, Registry, RenderAction, Shape,
    config::Config,
    planner::{Actor, Goals, PlannedAction},
    resolve::ResolvedShape,
};

/// Actions that are not taken, with the reasons.
type Refused = Vec<(String, String)>;

/// An action that can draw a scene and manages its shapes.
pub struct Choice<A = Box<dyn RenderAction>> {
    /// Its registered name.
    pub name: String,
    /// The action, which manages all shapes.
    pub action: A,
    /// The actions that were preferred but not taken, with the reasons.
    pub refused: Refused,
}

impl<A> fmt::Debug for Choice<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Choice").field("name", &self.name).field("refused", &self.refused).finish_non_exhaustive()
    }
}

/// Why there is no action for a scene.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SelectError {
    /// The scene or its caller names an action, and that one cannot.
    #[error(transparent)]
    Action(#[from] ActionError),
    /// None of the preferred actions can.
    #[error("no preferred action can draw this scene: {}", reasons(refused))]
    None {
        /// Each action with its reason.
        refused: Vec<(String, String)>,
    },
}

fn reasons(refused: &[(String, String)]) -> String {
    refused.iter().map(|(name, why)| format!("{name}: {why}")).collect::<Vec<_>>().join("; ")
}

/// The reason for a preferred action that nobody registered.
pub const NOT_REGISTERED: &str = "not registered";

/// How the reason begins for a preferred action that has no device to run on.
pub const NO_DEVICE: &str = "no device";

/// Whether a reason says that an action is not to be had on this machine, whatever the scene.
pub fn is_absent(why: &str) -> bool {
    why == NOT_REGISTERED || why.starts_with(NO_DEVICE)
}

/// How the device of an action begins that stands for a GPU which is none: only where no other
/// preferred action can draw is such a one taken.
pub const SOFTWARE: &str = "software: ";

/// Makes the action `named` where there is one; else the first that `config` prefers and that can
/// draw all shapes, those on [software](SOFTWARE) devices last. `options` go above those of the config.
///
/// # Errors
/// If the named action cannot be made or refuses a shape, or no preferred action can draw.
pub fn select(
    registry: &Registry,
    config: &Config,
    named: Option<&str>,
    options: &Options,
    shapes: &[Shape],
) -> Result<Choice, SelectError> {
    if let Some(name) = named {
        let mut action = registry.action(name, &config.options_of(name, options))?;
        shapes.iter().try_for_each(|shape| action.manage(shape))?;
        return Ok(Choice { name: name.into(), action, refused: Vec::new() });
    }
    let (mut refused, mut last) = (Vec::new(), None);
    for name in &config.prefer {
        match attempt(registry, name, &config.options_of(name, options), shapes) {
            Ok(action) if action.caps().device.starts_with(SOFTWARE) => {
                let why = format!("{NO_DEVICE} that is a GPU ({}); name it to take it", action.caps().device);
                log::info!("action {name} is taken last: {why}");
                refused.push((name.clone(), why));
                last.get_or_insert((name.clone(), action));
            }
            Ok(action) => return Ok(Choice { name: name.clone(), action, refused }),
            Err(why) => {
                log::info!("action {name} is not taken: {why}");
                refused.push((name.clone(), why));
            }
        }
    }
    let taken = last.ok_or_else(|| SelectError::None { refused: std::mem::take(&mut refused) });
    taken.map(|(name, action)| {
        refused.retain(|(other, _)| *other != name);
        Choice { name, action, refused }
    })
}

/// As [`select`], for goals: what [`select_planned`] finds. Without goals it is [`select`].
///
/// # Errors
/// As [`select`].
pub fn select_for(
    registry: &Registry,
    config: &Config,
    named: Option<&str>,
    options: &Options,
    (goals, shapes): (&Goals, &[Shape]),
) -> Result<Choice, SelectError> {
    if *goals == Goals::default() {
        return select(registry, config, named, options, shapes);
    }
    let planned = select_planned(registry, config, named, options, (goals, shapes))?;
    Ok(Choice { name: planned.name, action: Box::new(planned.action), refused: planned.refused })
}

/// The planner for goals: of the action named, or of all preferred ones that can draw and run on no
/// [software](SOFTWARE) device, from which the cheapest settings are chosen frame by frame. It manages all shapes.
///
/// # Errors
/// As [`select`].
pub fn select_planned(
    registry: &Registry,
    config: &Config,
    named: Option<&str>,
    options: &Options,
    (goals, shapes): (&Goals, &[Shape]),
) -> Result<Choice<PlannedAction>, SelectError> {
    let (name, mut action, refused) = if named == Some("planned") {
        let action = registry.planned(&goals.above(&config.options_of("planned", options)))?;
        ("planned".to_owned(), action, Vec::new())
    } else {
        let (actors, refused) = actors(registry, config, named, options, shapes)?;
        let names: Vec<_> = actors.iter().map(|a| a.name.clone()).collect();
        (format!("planned of {}", names.join(" ")), registry.plan_for(actors, goals)?, refused)
    };
    shapes.iter().try_for_each(|shape| action.manage(shape))?;
    Ok(Choice { name, action, refused })
}

/// The action that [`select`] takes and, where none is named, the others that could.
fn actors(
    registry: &Registry,
    config: &Config,
    named: Option<&str>,
    options: &Options,
    shapes: &[Shape],
) -> Result<(Vec<Actor>, Refused), SelectError> {
    let first = select(registry, config, named, options, shapes)?;
    let mut refused = first.refused;
    let given = config.options_of(&first.name, options);
    let mut actors = vec![Actor::new(&first.name, first.action, given)];
    for name in config.prefer.iter().filter(|_| named.is_none()) {
        if *name == first.name || refused.iter().any(|(other, _)| other == name) {
            continue;
        }
        let given = config.options_of(name, options);
        match attempt(registry, name, &given, shapes) {
            Ok(action) if !action.caps().device.starts_with(SOFTWARE) => actors.push(Actor::new(name, action, given)),
            Ok(action) => refused.push((name.clone(), format!("{NO_DEVICE} that is a GPU ({})", action.caps().device))),
            Err(why) => refused.push((name.clone(), why)),
        }
    }
    Ok((actors, refused))
}

fn attempt(
    registry: &Registry,
    name: &str,
    options: &Options,
    shapes: &[Shape],
) -> Result<Box<dyn RenderAction>, String> {
    if !registry.action_names().any(|known| known == name) {
        return Err(NOT_REGISTERED.into());
    }
    let mut action = registry.action(name, options).map_err(|e| match &e {
        ActionError::Backend { .. } => format!("{NO_DEVICE}: {}", chain(&e)),
        _ => chain(&e),
    })?;
    let resolved: Result<Vec<_>, _> = shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders())).collect();
    let resolved = resolved.map_err(|e| chain(&e))?;
    can_draw(&action.caps(), &resolved)?;
    shapes.iter().try_for_each(|shape| action.manage(shape)).map_err(|e| chain(&e))?;
    Ok(action)
}

/// Whether an action's capabilities cover all shapes; the reason where they do not.
///
/// # Errors
/// What is missing, in words.
pub fn can_draw(caps: &Caps, shapes: &[ResolvedShape]) -> Result<(), String> {
    for shape in shapes {
        let geometry = shape.state.geometry.name();
        let source = caps.sources && shape.shader.source.is_some();
        if !source && caps.shaders.as_ref().is_some_and(|known| !known.contains(&shape.state.shader)) {
            return Err(format!("does not draw shader {:?} (shape {:?})", shape.state.shader, shape.name));
        }
        if caps.geometries.as_ref().is_some_and(|known| !known.iter().any(|g| g == geometry)) {
            return Err(format!("does not draw geometry {geometry:?} (shape {:?})", shape.name));
        }
        if !caps.compositing.contains(&shape.compositing()) {
            return Err(format!("does not composite by {:?} (shape {:?})", shape.compositing().name(), shape.name));
        }
    }
    match overlapping(shapes) {
        Some((a, b)) if !caps.overlap => Err(format!("does not draw overlapping shapes ({a:?} and {b:?})")),
        _ => Ok(()),
    }
}

/// Two `over` shapes whose world boxes share more than a face.
fn overlapping(shapes: &[ResolvedShape]) -> Option<(&str, &str)> {
    let over: Vec<_> = shapes.iter().filter(|s| s.compositing() == Compositing::Over).collect();
    over.iter().enumerate().find_map(|(i, a)| {
        let overlaps = |b: &&&ResolvedShape| {
            let both = a.state.world_bounds().intersection(&b.state.world_bounds());
            both.min.cmplt(both.max).all()
        };
        over[i + 1..].iter().find(overlaps).map(|b| (a.name.as_str(), b.name.as_str()))
    })
}

fn chain(error: &dyn std::error::Error) -> String {
    match error.source() {
        Some(cause) => format!("{error}: {}", chain(cause)),
        None => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Appearance, Block, ScalarType, Volume, VolumeDesc};
    use glam::DVec3;

    fn shapes(n: usize) -> Vec<Shape> {
        let volume = Volume::new(VolumeDesc::new([2, 2, 2], ScalarType::U8, 1), vec![0u8; 8]).unwrap();
        (0..n).map(|_| Shape::around(&volume, Appearance::new("simple").with("unit_distance", 1.0))).collect()
    }

    fn resolved(shapes: &[Shape]) -> Vec<ResolvedShape> {
        let registry = Registry::with_core();
        shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders()).unwrap()).collect()
    }

    #[test]
    fn reasons_are_reported_for_each_action() {
        let config = Config { prefer: vec!["wgpu".into(), "null".into()], ..Config::default() };
        let error = select(&Registry::with_core(), &config, None, &Options::new(), &shapes(1)).unwrap_err();
        let expected = "no preferred action can draw this scene: wgpu: not registered; \
            null: does not composite by \"over\" (shape \"volume\")";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn named_action_is_taken_as_it_is() {
        let (registry, config) = (Registry::with_core(), Config::default());
        let choice = select(&registry, &config, Some("null"), &Options::new(), &shapes(1)).unwrap();
        assert_eq!((choice.name.as_str(), choice.refused.len()), ("null", 0));
        let error = select(&registry, &config, Some("nul"), &Options::new(), &[]).unwrap_err();
        assert!(error.to_string().contains("did you mean \"null\"?"));
    }

    /// Draws nothing, on a device that is none.
    struct Software(crate::null::NullAction);

    impl RenderAction for Software {
        fn declaration(&self) -> &crate::Declaration {
            self.0.declaration()
        }
        fn caps(&self) -> Caps {
            let compositing = vec![Compositing::Over];
            Caps { compositing, device: format!("{SOFTWARE}pipe"), overlap: true, ..Caps::default() }
        }
        fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
            self.0.manage(shape)
        }
        fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
            self.0.unmanage(shape)
        }
        fn begin_draw(&mut self, frame: &crate::FrameDesc) -> Result<(), ActionError> {
            self.0.begin_draw(frame)
        }
        fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
            self.0.draw(shape)
        }
        fn end_draw(&mut self) -> Result<crate::Frame, ActionError> {
            self.0.end_draw()
        }
        fn set_option(&mut self, name: &str, value: crate::ParameterValue) -> Result<(), ActionError> {
            self.0.set_option(name, value)
        }
    }

    #[test]
    fn software_devices_are_taken_last() {
        let mut registry = Registry::with_core();
        let declaration = |name| crate::Declaration { name: String::from(name), ..crate::null::declaration() };
        for name in ["soft", "softer"] {
            let made = |context: &crate::Context, _: &Options| -> Result<Box<dyn RenderAction>, ActionError> {
                Ok(Box::new(Software(crate::null::NullAction::new(context))))
            };
            registry.add_action(declaration(name), std::sync::Arc::new(made)).unwrap();
        }
        let prefer = ["soft", "null", "softer"].map(String::from).to_vec();
        let config = Config { prefer, ..Config::default() };
        // `null` composites nothing, so that only software is left: the first of it.
        let choice = select(&registry, &config, None, &Options::new(), &shapes(1)).unwrap();
        let refused: Vec<_> = choice.refused.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!((choice.name.as_str(), refused), ("soft", vec!["null", "softer"]));
        let choice = select(&registry, &config, None, &Options::new(), &[]).unwrap();
        assert_eq!(
            (choice.name.as_str(), choice.refused[0].1.as_str()),
            ("null", "no device that is a GPU (software: pipe); name it to take it")
        );
        let choice = select(&registry, &config, Some("softer"), &Options::new(), &shapes(1)).unwrap();
        assert_eq!(choice.name, "softer");
    }

    #[test]
    fn overlap_is_asked_for_only_where_shapes_overlap() {
        let caps = Caps { compositing: vec![Compositing::Over], ..Caps::default() };
        let two = shapes(2);
        assert!(can_draw(&caps, &resolved(&two)).unwrap_err().contains("overlapping"));
        two[1].set_geometry(Block::new(DVec3::X, DVec3::ONE).unwrap());
        assert_eq!(can_draw(&caps, &resolved(&two)), Ok(()));
        let none = Caps { shaders: Some(vec!["lut".into()]), ..caps };
        assert!(can_draw(&none, &resolved(&two)).unwrap_err().contains("shader \"simple\""));
    }
}
