//! An action that paints what a ray meets first: blocks by the middle of their first volume.

use std::sync::Arc;

use volact_plugin::{
    ActionError, Caps, Compositing, Context, Declaration, Frame, FrameDesc, Options, ParameterValue, Registry,
    RenderAction, Shape, Warning, WarningCode, lifecycle::Lifecycle, parameter::Kind, registry::RegisterError,
};

use crate::{mode, panic_at, word};

struct Painter {
    declaration: Declaration,
    lifecycle: Lifecycle,
    mode: String,
}

fn declaration() -> Declaration {
    Declaration::new(Kind::Action, "painter", env!("CARGO_PKG_VERSION"), "paints blocks").with(mode())
}

impl Drop for Painter {
    fn drop(&mut self) {
        panic_at(&self.mode, "drop");
    }
}

impl RenderAction for Painter {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        panic_at(&self.mode, "caps");
        let compositing = vec![Compositing::Over, Compositing::Maximum];
        Caps { compositing, depth: true, device: "paint".into(), ..Caps::default() }
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        panic_at(&self.mode, "manage");
        self.lifecycle.manage(shape, |_| Ok(())).map(|_| ())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        panic_at(&self.mode, "unmanage");
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        panic_at(&self.mode, "begin_draw");
        log::info!("a frame of {} × {}", frame.width, frame.height);
        self.lifecycle.begin(frame, |_| Ok(())).map(|_| ())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        panic_at(&self.mode, "draw");
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        panic_at(&self.mode, "end_draw");
        let mut frame = Frame::empty(&open.desc);
        let grid = open.desc.camera.rays(&open.desc.viewport()).map_err(volact_plugin::frame::FrameError::from)?;
        for shape in open.drawn_shapes() {
            let Some(block) = shape.block() else { continue };
            let grey = shape.volume("volume").map_or(1.0, |v| {
                let at = v.object_to_index().transform_point3(block.center());
                v.sample(at, 0) / 255.0
            });
            if let Some(v) = shape.volume("volume") {
                frame
                    .statistics
                    .details
                    .push(("voxels at".into(), format!("{:p}", v.volume().data().bytes().as_ptr())));
                frame.statistics.details.push(("volume id".into(), v.volume().id().to_string()));
            }
            for y in 0..frame.height {
                for x in 0..frame.width {
                    let ray = grid.ray(x as f64 + 0.5, y as f64 + 0.5);
                    let origin = shape.to_object.transform_point3(ray.origin);
                    let direction = shape.to_object.transform_vector3(ray.direction);
                    let Some([t, _]) = block.clip_line(origin, direction) else { continue };
                    let at = y * frame.width + x;
                    frame.color[at] = [grey as f32, grey as f32, grey as f32, 1.0];
                    frame.depth[at] = (t - ray.depth_zero) as f32;
                }
            }
        }
        frame.method.sampling = "first hit".into();
        frame.statistics.rays = 7;
        frame.warnings.push(Warning::note(WarningCode::SettingAdjusted, "painter", "painted"));
        frame.statistics.details.push(("colour at".into(), format!("{:p}", frame.color.as_ptr())));
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        panic_at(&self.mode, "set_option");
        if let ("mode", ParameterValue::Choice(mode)) = (name, value) {
            self.mode = mode;
        }
        Ok(())
    }
}

pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    let make = |context: &Context, options: &Options| {
        let mode = word(options, "mode");
        panic_at(&mode, "create");
        if mode == "refused" {
            let (shape, what, cure) = ("any".into(), "refused on request".into(), "ask for another mode".into());
            return Err(ActionError::Unsupported { action: "painter".into(), shape, what, cure });
        }
        let made = Painter { declaration: declaration(), lifecycle: Lifecycle::new(context.clone()), mode };
        Ok(Box::new(made) as Box<dyn RenderAction>)
    };
    registry.add_action(declaration(), Arc::new(make))
}
