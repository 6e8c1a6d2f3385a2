//! 5: borders of bricks and parts.

use volact_core::{Aabb, Block, Camera, FrameDesc, Roi, ScalarType, Shape, Volume, VolumeTexture, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Method,
    lab::{Lab, certified, ensure, limited, refused_with},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::{rule, warm},
    metrics::max_error,
    rig::{Scene, Setup},
    scene::{look, lut, lut_of, volume},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 5,
        title: "Borders of bricks and parts",
        about: "Bricks that share no voxel leave a voxel's gap between them, or stretch to close it. Parts whose \
                samples begin anew where a ray enters count the last step of each whole or not at all. Both are seams \
                that grow with the number of parts.",
        ladders: vec![parts()],
        answers: answers(),
    }
}

/// Cells along the axis that is split.
const CELLS: usize = 64;

fn data() -> Volume {
    volume([CELLS + 1, 4, 4], ScalarType::F32, rule)
}

fn view() -> FrameDesc {
    let target = DVec3::new(32.0, 1.5, 1.5);
    FrameDesc::new(Camera::orthographic(target - DVec3::new(60.0, 1.7, 1.1), target, DVec3::Z, 2.2), 16, 16)
}

/// From the first cell of a part to the one behind its last.
fn ends(count: usize) -> impl Iterator<Item = [usize; 2]> {
    let cells = CELLS / count;
    (0..count).map(move |i| [i * cells, (i + 1) * cells])
}

const UNIT: f64 = 8.0;

/// Blocks of one volume, a shape each, from front to back.
fn blocks(count: usize) -> Scene {
    let texture = VolumeTexture::new(&data());
    let part = |[a, b]: [usize; 2]| {
        let (min, size) = (DVec3::new(a as f64, 0.0, 0.0), DVec3::new((b - a) as f64, 3.0, 3.0));
        Shape::new(Block::new(min, size).expect("a block"), look("lut", warm(), UNIT).with("volume", texture.clone()))
    };
    Scene::new(ends(count).map(part), view())
}

/// Regions of one volume, with the sample of the border in both, or not, and stretched to close the gap.
fn regions(count: usize, shared: bool) -> Scene {
    let texture = VolumeTexture::new(&data());
    let part = |[a, b]: [usize; 2]| {
        let last = if shared || b == CELLS { b } else { b - 1 };
        let roi = Roi { min: [a, 0, 0], max: [last, 3, 3] };
        let place = Aabb::new(DVec3::new(a as f64, 0.0, 0.0), DVec3::new(b as f64, 3.0, 3.0));
        let texture = texture.clone().with_data_roi(roi).and_then(|t| t.with_geometry_roi(place));
        lut_of(&texture.expect("a region"), warm(), UNIT)
    };
    Scene::new(ends(count).map(part), view())
}

fn parts() -> Ladder {
    let whole = || Scene::new([lut(&data(), warm(), UNIT)], view());
    let of = move |how: Setup, scene: fn(usize) -> Scene| {
        move |lab: &Lab, count: f64| lab.error(&how, &scene(count as usize), &certified(&whole())?)
    };
    Ladder {
        name: "parts",
        title: "A volume of 64 cells in 1 to 64 parts, looked through lengthwise",
        knob: "parts",
        truth: "`reference` of the whole",
        rungs: vec![1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0],
        methods: vec![
            Method::holds("cpu, a block each", 3e-3, of(Setup::post(0.2), blocks)),
            Method::holds("cpu, a region of the data each", 3e-3, of(Setup::post(0.2), |n| regions(n, true))),
            Method::holds("wgpu, slices, a block each", 3e-3, move |lab, count| {
                let how = Setup::new("wgpu").with("method", "slices").step(0.2);
                limited(lab.error(&how, &blocks(count as usize), &certified(&whole())?))
            }),
            Method::fails(
                "cpu, regions that share no sample",
                (3e-3, [0.02, 1.0]),
                of(Setup::post(0.2), |n| regions(n, false)),
            ),
            Method::fails("model: samples begin anew in each part", (0.02, [0.03, 1.0]), move |_, count| {
                let found = Naive { step: 0.7, mistake: Mistake::Anew }.draw(&blocks(count as usize))?;
                Ok(max_error(&found, &certified(&whole())?))
            }),
        ],
    }
}

fn answers() -> Vec<Answer> {
    let room = Answer::new(
        Does::Refuses,
        "More parts than a device can hold textures for in one picture are refused by name, with the cure; they are \
         drawn, or that, and nothing between.",
        |lab| {
            let how = Setup::new("wgpu").step(0.2);
            match lab.frame(&how, &blocks(64)) {
                Ok(frame) => {
                    let whole = Scene::new([lut(&data(), warm(), UNIT)], view());
                    let truth = certified(&whole).map_err(|e| format!("{e:?}"))?;
                    let error = max_error(&crate::metrics::wide(&frame), &truth);
                    ensure(error < 3e-3, format!("off by {error}"))
                }
                refused => refused_with(refused, &["number of volumes", "draw fewer shapes"]),
            }
        },
    );
    let lattice = Answer::new(
        Does::Avoids,
        "There is one lattice a frame, whatever the number of shapes, and only a shape's own ends cut its segments: \
         where the cuts lie on the lattice, 64 parts are the whole to rounding.",
        |lab| {
            // Looked at along x, the orthographic lattice begins at the plane through the origin.
            let desc = FrameDesc::new(
                Camera::orthographic(DVec3::new(-9.0, 1.3, 1.4), DVec3::new(0.0, 1.3, 1.4), DVec3::Z, 1.0),
                8,
                8,
            );
            let whole = Scene::new([lut(&data(), warm(), UNIT)], desc.clone());
            let draw = |scene: &Scene| {
                lab.frame(&Setup::post(0.5), scene).map(|f| crate::metrics::wide(&f)).map_err(|e| format!("{e:?}"))
            };
            let apart = max_error(&draw(&blocks(64).seen(desc))?, &draw(&whole)?);
            ensure(apart < 1e-5, format!("{apart} apart"))
        },
    );
    vec![lattice, room]
}
