//! Hits: places on a ray that have colour and opacity, but no length.
//!
//! Slices, surfaces and what the application has drawn are hits. Of several at one place none is
//! in front: together they have the opacity 1 − Π(1 − αᵢ) and the colour Σαᵢcᵢ/Σαᵢ.

use std::cmp::Ordering;

use super::{line::EPS, mark::Mark};

/// A hit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub mark: Mark,
    /// Lowest and highest colour times opacity.
    pub light: [[f64; 2]; 3],
    /// Lowest and highest opacity.
    pub alpha: [f64; 2],
}

impl Hit {
    /// A hit of a straight colour, of which the lowest and highest are given.
    pub fn new(mark: Mark, color: [[f64; 2]; 3], alpha: [f64; 2]) -> Self {
        let exact = alpha == [1.0; 2];
        let round = if exact { 0.0 } else { 2.0 * EPS };
        let light = color.map(|c| [c[0] * alpha[0] * (1.0 - round), c[1] * alpha[1] * (1.0 + round)]);
        Self { mark, light, alpha }
    }

    /// The same hit where it may not be there at all.
    pub fn doubtful(self) -> Self {
        let light = self.light.map(|l| [l[0].min(0.0), l[1].max(0.0)]);
        Self { light, alpha: [0.0, self.alpha[1]], ..self }
    }

    /// Widens the lowest and highest number of all colours by its own.
    pub fn widen(&self, range: &mut [f64; 2]) {
        for [low, high] in self.light {
            let most = if self.alpha[0] > 0.0 { high / self.alpha[0] } else { high };
            *range = [range[0].min(low), range[1].max(if most.is_finite() { most } else { high })];
        }
    }

    /// Whether nothing behind it can be seen.
    pub fn is_opaque(&self) -> bool {
        self.alpha[0] == 1.0
    }
}

/// Puts hits in order, those at one place together.
pub(super) fn in_order(mut hits: Vec<Hit>) -> Vec<Hit> {
    // By content, too, so that sums do not depend on where hits came from.
    let content = |h: &Hit| [h.alpha, h.light[0], h.light[1], h.light[2]].concat();
    hits.sort_by(|a, b| {
        let apart = || content(a).iter().zip(content(b)).map(|(a, b)| a.total_cmp(&b)).find(|o| o.is_ne());
        a.mark.order(&b.mark).then_with(|| apart().unwrap_or(Ordering::Equal))
    });
    let apart = |a: &Hit, b: &Hit| a.mark.compare(&b.mark) == Some(Ordering::Less);
    hits.chunk_by(|a, b| !apart(a, b)).map(together).collect()
}

fn together(hits: &[Hit]) -> Hit {
    let first = hits[0];
    if hits.len() == 1 {
        return first;
    }
    let left = |end: usize| hits.iter().map(|h| 1.0 - h.alpha[end]).product::<f64>();
    let sum = |end: usize| hits.iter().map(|h| h.alpha[end]).sum::<f64>();
    let round = 4.0 * EPS * hits.len() as f64;
    let solid = hits.iter().any(Hit::is_opaque);
    let alpha = if solid { [1.0; 2] } else { [0, 1].map(|end| 1.0 - left(end)) };
    let alpha = [if solid { 1.0 } else { (alpha[0] - round).max(0.0) }, (alpha[1] + round).min(1.0)];
    let one_place = hits.iter().all(|h| h.mark.compare(&first.mark) == Some(Ordering::Equal));
    let total = |c: usize, end: usize| hits.iter().map(|h| h.light[c][end]).sum::<f64>();
    if one_place {
        // What is left of the sum of lights falls with every opacity.
        let share = |alpha: f64, sum: f64| if sum > 0.0 { (alpha / sum).min(1.0) } else { 1.0 };
        let exact = [0, 1].map(|end| if solid { 1.0 } else { 1.0 - left(end) });
        let share = [share(exact[1], sum(1)) * (1.0 - round), (share(exact[0], sum(0)) * (1.0 + round)).min(1.0)];
        let light = [0, 1, 2].map(|c| bounds(total(c, 0), total(c, 1), share));
        return Hit { light, alpha, ..first };
    }
    // Any order: opacity is the same, colour lies between the colours.
    let far = hits.iter().map(|h| (h.mark.t.hi - first.mark.t.hi).abs() + h.mark.error).fold(0.0, f64::max);
    let mark = Mark { error: 2.0 * far, fine: false, ..first.mark };
    let straight = |c: usize, end: usize, pick: fn(f64, f64) -> f64| {
        let colors = hits.iter().filter(|h| h.alpha[1] > 0.0).map(|h| h.light[c][end] / h.alpha[end]);
        colors.filter(|v| !v.is_nan()).reduce(pick).unwrap_or(0.0)
    };
    let light = [0, 1, 2].map(|c| {
        let (low, high) = (straight(c, 0, f64::min), straight(c, 1, f64::max));
        let most = total(c, 1).max(0.0);
        [(low * alpha[0]).min(total(c, 0)).min(most), (high * alpha[1] * (1.0 + round)).min(most)]
    });
    Hit { mark, light, alpha }
}

/// Bounds on a product of something between `low` and `high` and a share.
fn bounds(low: f64, high: f64, share: [f64; 2]) -> [f64; 2] {
    [low * share[usize::from(low < 0.0)], high * share[usize::from(high > 0.0)]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f64, c: f64, a: f64) -> Hit {
        Hit::new(Mark::exact(t), [[c; 2]; 3], [a; 2])
    }

    fn is(found: [f64; 2], wanted: f64) -> bool {
        found[0] <= wanted && wanted <= found[1] && found[1] - found[0] < 1e-14
    }

    #[test]
    fn hits_at_one_place_weigh_by_opacity() {
        let made = in_order(vec![hit(2.0, 1.0, 0.5), hit(1.0, 0.25, 1.0), hit(2.0, 0.0, 0.25)]);
        assert_eq!(made.len(), 2);
        assert_eq!((made[0].alpha, made[0].light[0]), ([1.0; 2], [0.25; 2]));
        assert!(is(made[1].alpha, 0.625), "{made:?}");
        assert!(is(made[1].light[2], 0.625 * 0.5 / 0.75), "{made:?}");
        let solid = in_order(vec![hit(1.0, 1.0, 1.0), hit(1.0, 0.0, 1.0)]);
        assert!(solid[0].is_opaque() && is(solid[0].light[0], 0.5));
    }

    #[test]
    fn hits_in_any_order_are_enclosed() {
        let rough = |c: f64, a: f64| Hit { mark: Mark::rough(1.0, 1e-9), ..hit(1.0, c, a) };
        let [made] = in_order(vec![rough(1.0, 0.5), rough(0.25, 0.5)])[..] else { panic!("they are one") };
        assert!(is(made.alpha, 0.75));
        for truth in [0.5 + 0.5 * 0.125, 0.125 + 0.5 * 0.5, 0.75 * 0.625] {
            assert!(made.light[0][0] <= truth && truth <= made.light[0][1], "{made:?}");
        }
    }
}
