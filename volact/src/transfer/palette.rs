//! Colours for numbers of which nothing is known but whether they have a middle.

/// From low to high, each step about as bright above the last and visible over black; after
/// *plasma* (N. Smith and S. van der Walt, matplotlib 1.5), begun where it can be seen.
const RISING: [[f64; 3]; 8] = [
    [0.17, 0.10, 0.62],
    [0.36, 0.10, 0.70],
    [0.57, 0.12, 0.67],
    [0.74, 0.22, 0.56],
    [0.87, 0.36, 0.42],
    [0.96, 0.53, 0.28],
    [1.00, 0.73, 0.25],
    [0.97, 0.97, 0.45],
];

/// From one side over a pale middle to the other; after K. Moreland, *Diverging color maps for
/// scientific visualization*, ISVC 2009.
const PARTED: [[f64; 3]; 7] = [
    [0.10, 0.25, 0.85],
    [0.30, 0.52, 1.00],
    [0.62, 0.78, 1.00],
    [0.88, 0.87, 0.86],
    [1.00, 0.72, 0.55],
    [0.96, 0.42, 0.28],
    [0.80, 0.08, 0.12],
];

/// How colours go with numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Palette {
    /// From low to high.
    Rising,
    /// From below a middle to above it.
    Parted,
}

impl Palette {
    /// The colour at a place from 0 to 1.
    pub fn at(self, place: f64) -> [f64; 3] {
        let colors: &[[f64; 3]] = match self {
            Self::Rising => &RISING,
            Self::Parted => &PARTED,
        };
        let at = place.clamp(0.0, 1.0) * (colors.len() - 1) as f64;
        let below = (at as usize).min(colors.len() - 2);
        let t = at - below as f64;
        std::array::from_fn(|c| colors[below][c] * (1.0 - t) + colors[below + 1][c] * t)
    }
}
