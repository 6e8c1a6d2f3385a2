//! A volume in a window: on the application's own device, into its own surface, in front of, behind
//! and around what it has drawn there itself.
//!
//! `cargo run --release -p volact-window` turns the head of `examples/head` inside a ring. `--frames`
//! ends by itself, and `--picture` keeps the last frame.

mod graphics;
mod ring;

use std::{path::PathBuf, process::ExitCode, sync::Arc};

use anyhow::Context as _;
use clap::Parser;
use volact::{Aabb, core::loader::NoProgress, prelude::*, scene::Scene};
use winit::{
    application::ApplicationHandler,
    dpi::PhysicalSize,
    event::WindowEvent,
    event_loop::{ActiveEventLoop, EventLoop},
    window::{Window, WindowId},
};

use graphics::Graphics;

/// Shows a scene in a window and turns it.
#[derive(Parser)]
struct Args {
    /// A scene file, whose camera is left aside
    #[arg(default_value = "examples/head/scene.ron")]
    scene: PathBuf,
    /// Width and height in pixels
    #[arg(long, num_args = 2, default_values = ["640", "480"], value_parser = clap::value_parser!(u32).range(16..=8192))]
    size: Vec<u32>,
    /// End after this many frames
    #[arg(long)]
    frames: Option<u32>,
    /// Keep the last frame as a picture; needs --frames
    #[arg(long, requires = "frames")]
    picture: Option<PathBuf>,
}

/// The program, with what it shows once there is a window.
struct Program {
    args: Args,
    scene: Shown,
    drawn: u32,
    graphics: Option<Graphics>,
    failed: Option<anyhow::Error>,
}

/// What is shown, whoever draws it.
struct Shown {
    registry: Registry,
    shapes: Vec<Shape>,
    bounds: Aabb,
}

fn main() -> ExitCode {
    match run(Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(args: Args) -> anyhow::Result<()> {
    let registry = Registry::with_builtins();
    let scene = Scene::open(&args.scene, &registry, &NoProgress)?;
    let bounds = scene.shapes.iter().fold(Aabb::EMPTY, |all, s| all.union(&s.state().world_bounds()));
    let shown = Shown { registry, shapes: scene.shapes, bounds };
    let events = EventLoop::new().context("no display was found")?;
    let mut program = Program { args, scene: shown, drawn: 0, graphics: None, failed: None };
    events.run_app(&mut program)?;
    program.failed.map_or(Ok(()), Err)
}

impl Program {
    fn open(&mut self, events: &ActiveEventLoop) -> anyhow::Result<Graphics> {
        let size = PhysicalSize::new(self.args.size[0], self.args.size[1]);
        let window = events.create_window(Window::default_attributes().with_title("Volact").with_inner_size(size))?;
        let mut graphics = Graphics::new(Arc::new(window), &self.scene.registry, self.args.picture.is_some())?;
        graphics.manage(&self.scene.shapes)?;
        Ok(graphics)
    }

    /// Draws the next frame; whether it was the last.
    fn draw(&mut self) -> anyhow::Result<bool> {
        let Some(graphics) = &mut self.graphics else { return Ok(false) };
        let last = self.args.frames.is_some_and(|frames| self.drawn + 1 >= frames);
        let picture = self.args.picture.as_deref().filter(|_| last);
        // A turn in some ten seconds at sixty frames a second.
        let angle = 0.5 + 0.01 * f64::from(self.drawn);
        if graphics.draw(&self.scene.shapes, &self.scene.bounds, angle, picture)? {
            self.drawn += 1;
            return Ok(last);
        }
        Ok(false)
    }

    fn end(&mut self, events: &ActiveEventLoop, failed: Option<anyhow::Error>) {
        self.failed = failed;
        events.exit();
    }
}

impl ApplicationHandler for Program {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.graphics.is_none() {
            match self.open(events) {
                Ok(graphics) => self.graphics = Some(graphics),
                Err(error) => self.end(events, Some(error)),
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => self.end(events, None),
            WindowEvent::Resized(size) => {
                if let Some(graphics) = &mut self.graphics {
                    graphics.resize(size);
                }
            }
            WindowEvent::RedrawRequested => match self.draw() {
                Ok(false) => {
                    if let Some(graphics) = &self.graphics {
                        graphics.again();
                    }
                }
                Ok(true) => self.end(events, None),
                Err(error) => self.end(events, Some(error)),
            },
            _ => {}
        }
    }
}
