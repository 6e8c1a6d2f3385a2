//! A shape, ready to be drawn: where it is, what is seen of it, and the planes on which it is cut.

use std::ops::ControlFlow;

use volact_core::{
    Aabb, ActionError, Attribute, Clip, Compositing, LookupTable, Plane, SliceStyle, camera::LinearRays, glam::DVec3,
    lattice::Lattice, mutated, resolve::ResolvedShape, table::ResolvedTable,
};

use super::{
    bent::{Bend, Bent},
    carve::Carver,
    dispatch,
    medium::Medium,
    mesh::{build::Linked, integrate, numbers::Numbers, shot::Shot, trace::Crossing},
    options::Settings,
    over,
    packet::{Bundle, Packet, Place, Span, Vectors},
    resources::{Prepared, Resources, voxels},
    shaded::{
        self, Crossings, Dense,
        batch::Rays,
        trail::{Cells, Trail},
    },
    simd::{LANES, Unit},
    stretches::Stretches,
    sweep::piece::{Hit, Piece, Run, cut},
    walk::Counts,
};

/// Where a shape is.
#[derive(Clone, Copy, Debug)]
pub struct Region<'a> {
    /// Maps, and the box around it.
    pub place: Place,
    clip: &'a Clip,
    scene: &'a Clip,
    /// The mesh that it is, unless it is a box.
    mesh: Option<&'a Linked>,
    /// How the mesh carries the volume along.
    bend: Option<Bend<'a>>,
    /// The cells that programs ask about.
    cells: Option<Cells<'a>>,
}

/// Sixteen rays where they are in a region.
#[derive(Debug)]
pub struct Aimed<'a> {
    /// In sample space, from the first entry to the last exit.
    pub packet: Packet,
    /// Where they are inside.
    pub stretches: Stretches,
    /// The way through sample space, where it is not straight.
    pub bent: Option<Box<Bent>>,
    /// The cells that they pass, where programs ask about them.
    trail: Option<Box<Trail<'a>>>,
}

impl Aimed<'_> {
    /// The rays as programs see them.
    pub fn rays<'r>(&'r self, bundle: &'r Bundle) -> Rays<'r> {
        Rays { bundle, trail: self.trail.as_deref() }
    }

    /// The first, second, … stretches of rays in sample space.
    pub fn packets(&self) -> Vec<Packet> {
        self.stretches.spans().iter().map(|span| self.packet.within(span)).collect()
    }
}

impl<'a> Region<'a> {
    /// The region of a resolved shape; `None` where there is nothing of it.
    pub fn new(shape: &'a ResolvedShape, scene: &'a Clip, resources: &'a Resources) -> Option<Self> {
        let texture = shape.first_volume();
        let mesh = match resources.prepared(shape) {
            Some(Prepared::Solid(solid)) => Some(solid),
            _ => None,
        };
        let bend = mesh.and_then(|m| m.texture.as_ref()).zip(texture).map(|(points, texture)| {
            let roi = texture.data_roi();
            let vector = |v: [usize; 3]| DVec3::from_array(v.map(|v| v as f64));
            Bend { texture: points, first: vector(roi.min), size: vector(roi.max) - vector(roi.min) }
        });
        let bounds = shape.state.geometry.bounds();
        let block = match (shape.state.geometry.as_block(), texture) {
            (Some(block), Some(_)) if mesh.is_none() && mutated!("forgotten_roi") => block,
            (Some(block), Some(texture)) if mesh.is_none() => block.intersection(&texture.geometry_roi()),
            (Some(block), None) if mesh.is_none() => block,
            (_, Some(texture)) if bend.is_none() => grown(&bounds).intersection(&texture.geometry_roi()),
            _ => grown(&bounds),
        };
        if block.is_empty() {
            return None;
        }
        let to_index = texture.map(|t| t.object_to_index()).unwrap_or_default();
        let place = Place { to_object: shape.to_object, to_index, block }.mutated();
        let asked = shaded::by_cells(shape) || shaded::wanted(shape) && bend.is_some();
        let cells = mesh.filter(|_| asked).map(|m| Cells {
            mesh: &m.linked,
            texture: m.texture.as_ref().filter(|_| bend.is_some()),
            to_object: shape.to_object,
        });
        Some(Self { place, clip: &shape.state.clip, scene, mesh: mesh.map(|m| &m.linked), bend, cells })
    }

    /// Whether rays are straight in sample space and stay inside from one end to the other.
    pub fn is_bent(&self) -> bool {
        self.bend.is_some()
    }

    /// The rays of a bundle where `span` and this region hold them; `None` where they miss it.
    pub fn aim(&self, unit: Unit, bundle: &Bundle, span: &Span) -> Option<Aimed<'a>> {
        let packet = dispatch::aim(unit, bundle, span, &self.place);
        if packet.active == 0 {
            return None;
        }
        let mut bent = self.bend.map(|_| Box::<Bent>::default());
        let mut stretches = match self.mesh {
            Some(mesh) => self.inside(mesh, bundle, &packet, bent.as_deref_mut()),
            None => Stretches::one(packet.span()),
        };
        self.clip(bundle, &mut stretches);
        if stretches.active() == 0 {
            return None;
        }
        let trail = |cells| Box::new(Trail::new(cells, &bundle.through(&self.place.to_object), &stretches));
        let trail = self.cells.map(trail);
        Some(Aimed { packet, stretches, bent, trail })
    }

    /// Takes away what is clipped.
    pub fn clip(&self, bundle: &Bundle, stretches: &mut Stretches) {
        if !self.clip.is_none() && !mutated!("forgotten_clip") {
            stretches.clip(self.clip, &bundle.through(&self.place.to_object));
        }
        if !self.scene.is_none() && !mutated!("forgotten_frame_clip") {
            stretches.clip(self.scene, &[bundle.origin, bundle.direction]);
        }
    }

    fn inside(&self, mesh: &Linked, bundle: &Bundle, packet: &Packet, bent: Option<&mut Bent>) -> Stretches {
        let rays = bundle.through(&self.place.to_object);
        let lanes = (0..LANES).filter(|l| packet.active >> l & 1 == 1);
        let ray = |l: usize| (lane(&rays, l), [packet.start[l], packet.end[l]]);
        let mut stretches = Stretches::default();
        if let (Some(bent), Some(bend)) = (bent, &self.bend) {
            for l in lanes {
                let (ray, span) = ray(l);
                stretches.set(l, bent.follow(l, mesh, bend, ray, span).as_slice());
            }
        } else {
            let mut carver = Carver::default();
            for l in lanes {
                let ([origin, direction], span) = ray(l);
                stretches.set(l, carver.stretches(mesh, origin, direction, span));
            }
        }
        stretches
    }
}

/// A box that certainly holds what lies on its faces.
fn grown(bounds: &Aabb) -> Aabb {
    let reach = bounds.min.abs().max(bounds.max.abs());
    let margin = bounds.size() * 1e-9 + reach * 1e-12 + DVec3::splat(f64::MIN_POSITIVE);
    Aabb::new(bounds.min - margin, bounds.max + margin)
}

/// A lane's point at `t = 0` and direction.
pub fn lane([origin, direction]: &[Vectors; 2], l: usize) -> [DVec3; 2] {
    [origin, direction].map(|v| DVec3::new(v[0][l], v[1][l], v[2][l]))
}

/// Numbers at a mesh's vertices and how they are classified.
#[derive(Debug)]
pub struct Field<'a> {
    mesh: &'a Linked,
    color: Classified<'a>,
    opacity: Option<Classified<'a>>,
    unit: f64,
    /// For the vector kernels, where they can draw it.
    pub seen: Option<Seen<'a>>,
}

/// A field from a picture's camera.
#[derive(Debug)]
pub struct Seen<'a> {
    /// Its cells.
    pub shot: Shot<'a>,
    /// What they add.
    pub job: integrate::Job<'a>,
}

/// One number a vertex, and a table for it.
#[derive(Debug)]
struct Classified<'a> {
    attribute: &'a Attribute,
    component: usize,
    table: ResolvedTable,
}

impl<'a> Classified<'a> {
    fn new(attribute: &'a Attribute, component: usize, table: &LookupTable) -> Self {
        let range = attribute.range(component).unwrap_or([0.0, 1.0]);
        Self { attribute, component, table: table.resolve(range) }
    }

    fn value(&self, vertex: usize) -> f64 {
        self.attribute.value(vertex, self.component)
    }
}

impl<'a> Field<'a> {
    /// The field of a shape with the shader `attribute`.
    pub fn new(shape: &'a ResolvedShape, mesh: &'a Linked) -> Option<Self> {
        let component = shape.int("component").unwrap_or(0) as usize;
        let (scalars, table) = (shape.attribute("scalars")?, shape.table("lookup_table")?);
        let (other, other_table) = (shape.attribute("opacity_scalars"), shape.table("opacity_table"));
        let opacity = (other.is_some() || other_table.is_some()).then(|| {
            let (attribute, component) = other.map_or((scalars, component), |a| (a, 0));
            Classified::new(attribute, component, other_table.unwrap_or(table))
        });
        let color = Classified::new(scalars, component, table);
        Some(Self { mesh, color, opacity, unit: shape.float("unit_distance")?, seen: None })
    }

    /// Makes the field ready for the vector kernels.
    fn see(&mut self, shape: &ResolvedShape, numbers: &'a Numbers, eyes: &Eyes<'_>) {
        let (settings, bounds) = (eyes.settings, shape.state.geometry.bounds());
        let rays = (eyes.rays, eyes.size);
        let shot = Shot::new(self.mesh, &numbers.numbers, &shape.state.transform, &bounds, rays, settings.threads);
        let termination = settings.termination as f32;
        let job = integrate::Job { table: &numbers.table, termination, threshold: eyes.threshold };
        self.seen = shot.map(|shot| Seen { shot, job });
    }

    /// Adds the pieces of a ray, given in object space, on one stretch.
    pub fn pieces(&self, [origin, direction]: [DVec3; 2], span: [f64; 2], cuts: &mut Vec<f64>, out: &mut Vec<Piece>) {
        self.mesh.trace(origin, direction, span, |crossing| {
            let value = |of: &Classified<'_>| crossing.interpolate(|v| of.value(v));
            let color = Run { value: value(&self.color), table: &self.color.table };
            let opacity = self.opacity.as_ref().map(|of| Run { value: value(of), table: &of.table });
            let known = |run: &Run<'_>| run.value.iter().all(|v| !v.is_nan());
            if known(&color) && opacity.as_ref().is_none_or(known) {
                cut(crossing.span, color, opacity, self.unit, cuts, out);
            }
            ControlFlow::Continue(())
        });
    }

    /// Straight colour and opacity at `t` of a ray in object space; `None` where there is no number.
    fn at(&self, [origin, direction]: [DVec3; 2], t: f64) -> Option<[f64; 4]> {
        let near = 1e-9 * t.abs() + f64::MIN_POSITIVE;
        let mut best: Option<(f64, Crossing)> = None;
        self.mesh.trace(origin, direction, [t - near, t + near], |crossing| {
            let [a, b] = crossing.span;
            let off = (a - t).max(t - b).max(0.0);
            if best.is_none_or(|(least, _)| off < least) {
                best = Some((off, *crossing));
            }
            ControlFlow::Continue(())
        });
        let weights = best?.1.weights_at(t);
        let vertices = best?.1.vertices;
        let rgba = |of: &Classified<'_>| {
            let value: f64 = (0..4).map(|i| weights[i] * of.value(vertices[i] as usize)).sum();
            (!value.is_nan()).then(|| of.table.classify(value))
        };
        let [r, g, b, a] = rgba(&self.color)?;
        let a = self.opacity.as_ref().map_or(Some(a), |of| Some(rgba(of)?[3]))?;
        Some([r, g, b, a])
    }
}

/// What is seen inside a region.
#[derive(Debug)]
pub enum Content<'a> {
    /// Voxels on the lattice.
    Voxels(Box<over::Job<'a>>),
    /// Numbers at a mesh's vertices.
    Field(Box<Field<'a>>),
    /// What a shader's program makes of places on the lattice.
    Shaded(Box<Dense<'a>>),
    /// Surfaces where a shader's value crosses given ones.
    Crossings(Box<Crossings<'a>>),
}

/// How a picture is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Eyes<'a> {
    /// The rays of its viewport.
    pub rays: &'a LinearRays,
    /// The viewport's size.
    pub size: [usize; 2],
    /// The action's settings.
    pub settings: &'a Settings,
    /// The opacity at which depth is taken.
    pub threshold: f32,
}

/// Planes on which a shape is cut.
#[derive(Debug)]
struct Slicing<'a> {
    planes: &'a [Plane],
    style: SliceStyle,
    medium: Option<Medium<'a>>,
}

/// An `over` shape, ready to be drawn.
#[derive(Debug)]
pub struct Part<'a> {
    /// The shape's identity: sums are made in this order.
    pub id: u64,
    /// Where it is.
    pub region: Region<'a>,
    /// What is seen of it.
    pub content: Content<'a>,
    /// Whether it is seen between its planes, too.
    pub volume: bool,
    slicing: Option<Slicing<'a>>,
}

impl<'a> Part<'a> {
    /// A part of a resolved `over` shape; `None` where nothing of it can be seen.
    pub fn new(
        shape: &'a ResolvedShape,
        scene: &'a Clip,
        resources: &'a Resources,
        lattice: Lattice,
        eyes: &Eyes<'_>,
    ) -> Option<Self> {
        let mut region = Region::new(shape, scene, resources)?;
        let (content, medium) = match shape.volume("volume") {
            _ if shaded::wanted(shape) => (Self::shaded(shape, &region, resources, lattice, eyes)?, None),
            Some(texture) => {
                let tables = resources.tables(shape.id)?;
                let early = mutated!("early_termination") && eyes.settings.termination > 0.0;
                let job = over::Job {
                    unit: eyes.settings.unit,
                    voxels: voxels(shape, texture).0,
                    lattice,
                    classes: tables.classes(),
                    empty: tables.empty.as_ref(),
                    termination: if early { 0.2 } else { eyes.settings.termination as f32 },
                    threshold: eyes.threshold,
                };
                (Content::Voxels(Box::new(job)), Some(Medium::new(shape, texture)))
            }
            None => {
                // Only its cells know where a field is.
                let mut field = Field::new(shape, region.mesh.take()?)?;
                if let Some(numbers) = resources.numbers(shape.id) {
                    field.see(shape, numbers, eyes);
                }
                (Content::Field(Box::new(field)), None)
            }
        };
        let slices = shape.state.geometry.slices();
        let slicing = slices.map(|s| Slicing { planes: &s.planes, style: s.style, medium });
        let volume = slices.is_none_or(|s| s.volume) && !matches!(content, Content::Crossings(_));
        Some(Self { id: shape.id, region, content, volume, slicing })
    }

    /// What is seen of a shape whose shader's source is evaluated.
    fn shaded(
        shape: &'a ResolvedShape,
        region: &Region<'a>,
        resources: &'a Resources,
        lattice: Lattice,
        eyes: &Eyes<'_>,
    ) -> Option<Content<'a>> {
        let (shader, unit) = (resources.shader(shape.id)?, eyes.settings.unit);
        if shape.compositing() == Compositing::First {
            let stop = eyes.settings.termination as f32;
            return Some(Content::Crossings(Box::new(Crossings::new(shape, shader, lattice.step, stop, unit)?)));
        }
        let skip = (!region.is_bent()).then(|| resources.skip(shape, unit)).flatten();
        Some(Content::Shaded(Box::new(Dense::new(shape, shader, skip, lattice.step, unit))))
    }

    /// The first failure of its program.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        match &self.content {
            Content::Shaded(shaded) => shaded.check(),
            Content::Crossings(crossings) => crossings.check(),
            _ => Ok(()),
        }
    }

    /// Whether there are planes or surfaces in it.
    pub fn has_hits(&self) -> bool {
        self.slicing.is_some() || matches!(self.content, Content::Crossings(_))
    }

    /// Adds the hits of rays on this part's planes and surfaces to those of each lane.
    pub fn hits(&self, bundle: &Bundle, aimed: &Aimed<'_>, hits: &mut [Vec<Hit>; LANES], counts: &mut Counts) {
        if let Content::Crossings(crossings) = &self.content {
            crossings.hits(aimed.rays(bundle), aimed.packets().iter(), hits, counts);
        }
        let Some(slicing) = &self.slicing else { return };
        if let Content::Shaded(shaded) = &self.content {
            let opaque = slicing.style == SliceStyle::Opaque;
            let rays = bundle.through(&self.region.place.to_object);
            for plane in slicing.planes {
                let (mut live, mut t) = (0u32, [0.0; LANES]);
                for l in (0..LANES).filter(|l| aimed.stretches.active() >> l & 1 == 1) {
                    let [origin, direction] = lane(&rays, l);
                    if let Some(met) = plane.meets(origin, direction).filter(|&t| aimed.stretches.holds(l, t)) {
                        (live, t[l]) = (live | 1 << l, met);
                    }
                }
                if live != 0 {
                    counts.samples += u64::from(live.count_ones());
                    counts.lattice += u64::from(live.count_ones());
                    shaded.planes(aimed.rays(bundle), (t, live), opaque, hits);
                }
            }
            return;
        }
        let rays = bundle.through(&self.region.place.to_object);
        for (l, hits) in hits.iter_mut().enumerate().filter(|(l, _)| aimed.stretches.active() >> l & 1 == 1) {
            let ray = lane(&rays, l);
            for plane in slicing.planes {
                let Some(t) = plane.meets(ray[0], ray[1]).filter(|&t| aimed.stretches.holds(l, t)) else { continue };
                let rgba = match (&slicing.medium, &self.content) {
                    (Some(medium), _) => medium.at(self.sample(aimed, l, t)),
                    (None, Content::Field(field)) => field.at(ray, t),
                    _ => None,
                };
                let Some([r, g, b, a]) = rgba else { continue };
                let a = if slicing.style == SliceStyle::Opaque && !mutated!("thin_slices") { 1.0 } else { a };
                if a > 0.0 {
                    hits.push(Hit { t, color: [r * a, g * a, b * a, a] });
                }
            }
        }
    }

    /// Sample coordinates.
    fn sample(&self, aimed: &Aimed<'_>, l: usize, t: f64) -> DVec3 {
        match &aimed.bent {
            Some(bent) => bent.at(l, t),
            None => DVec3::from_array(aimed.packet.at(l, t)),
        }
    }
}
