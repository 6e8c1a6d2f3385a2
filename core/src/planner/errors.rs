//! Errors of a whole picture from those of some of its pixels.

/// How two pictures of the same pixels differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    /// The largest difference of any channel, pixel by pixel, largest first.
    pub worst: Vec<f64>,
    /// The root of the mean square over all channels.
    pub rmse: f64,
}

impl Errors {
    /// Of pixels of one picture against those of another; a pixel that is not finite differs without bound.
    pub fn between(a: &[[f32; 4]], b: &[[f32; 4]]) -> Self {
        let difference = |x: f32, y: f32| {
            let d = f64::from(x) - f64::from(y);
            if d.is_finite() { d.abs() } else { f64::INFINITY }
        };
        let pixel = |(a, b): (&[f32; 4], &[f32; 4])| std::array::from_fn::<f64, 4, _>(|i| difference(a[i], b[i]));
        let all: Vec<[f64; 4]> = a.iter().zip(b).map(pixel).collect();
        let mut worst: Vec<f64> = all.iter().map(|d| d.iter().fold(0.0, |m: f64, v| m.max(*v))).collect();
        worst.sort_by(|a, b| b.total_cmp(a));
        let squares: f64 = all.iter().flatten().map(|d| d * d).sum();
        Self { rmse: (squares / (4 * all.len().max(1)) as f64).sqrt(), worst }
    }
}

/// Tails of earlier sparse pictures count as much as the latest, up to so many pictures.
const POOLED: usize = 8;

/// Sizes of errors relative to their pictures' root of the mean square, of the last few pictures.
#[derive(Clone, Debug, Default)]
pub struct Tail(Vec<Vec<f64>>);

impl Tail {
    /// Takes in another picture.
    pub fn add(&mut self, errors: &Errors) {
        if errors.rmse > 0.0 && errors.rmse.is_finite() {
            self.0.push(errors.worst.iter().map(|e| e / errors.rmse).collect());
            let surplus = self.0.len().saturating_sub(POOLED);
            self.0.drain(..surplus);
        }
    }

    /// The largest error to be expected among `pixels`, of a picture with these errors among some of them.
    pub fn largest(&self, errors: &Errors, pixels: usize) -> f64 {
        let seen = errors.worst.first().copied().unwrap_or(0.0);
        let mut all: Vec<f64> = self.0.iter().flatten().copied().collect();
        all.sort_by(|a, b| b.total_cmp(a));
        if all.is_empty() || !errors.rmse.is_finite() {
            return seen;
        }
        seen.max(errors.rmse * extrapolated(&all, pixels))
    }
}

/// The value that one of `pixels` exceeds, from a sample, largest first.
///
/// Exceedances of a high threshold follow a generalised Pareto distribution (J. Pickands, *Statistical inference
/// using extreme order statistics*, 1975); its shape and scale are those with the sample's mean and variance
/// (J. Hosking, J. Wallis, *Parameter and quantile estimation for the generalized Pareto distribution*, 1987),
/// the shape no larger than 0.45, so that chance does not make them infinite.
fn extrapolated(sample: &[f64], pixels: usize) -> f64 {
    let exceeding = (sample.len() / 20).max(8);
    let Some(&threshold) = sample.get(exceeding) else { return sample.first().copied().unwrap_or(0.0) };
    let above: Vec<f64> = sample[..exceeding].iter().map(|v| v - threshold).collect();
    let n = exceeding as f64;
    let mean = above.iter().sum::<f64>() / n;
    let variance = above.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // How many of all pixels exceed the threshold.
    let expected = n / sample.len() as f64 * pixels as f64;
    if mean <= 0.0 || expected <= 1.0 {
        return sample[0];
    }
    let ratio = if variance > 0.0 { mean * mean / variance } else { 1.0 };
    let shape = (0.5 * (1.0 - ratio)).clamp(-0.5, 0.45);
    let scale = mean * (1.0 - shape);
    let over = if shape.abs() < 1e-3 { expected.ln() } else { (expected.powf(shape) - 1.0) / shape };
    (threshold + scale * over).max(sample[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_the_largest_of_each_pixel_and_the_mean_square_of_all_channels() {
        let a = [[0.0, 0.5, 0.25, 1.0], [0.0; 4]];
        let b = [[0.0, 0.25, 0.5, 0.5], [0.0; 4]];
        let errors = Errors::between(&a, &b);
        assert_eq!(errors.worst, [0.5, 0.0]);
        assert!((errors.rmse - ((0.0625 + 0.0625 + 0.25) / 8.0_f64).sqrt()).abs() < 1e-12);
        assert_eq!(Errors::between(&[[f32::NAN; 4]], &[[0.0; 4]]).worst, [f64::INFINITY]);
    }

    /// Largest of `pixels` values of a distribution given by its quantile function.
    fn ratio(quantile: impl Fn(f64) -> f64, sampled: usize, pixels: usize) -> f64 {
        // A sample without chance: the middles of its quantiles.
        let mut worst: Vec<f64> = (0..sampled).map(|i| quantile((i as f64 + 0.5) / sampled as f64)).collect();
        worst.sort_by(|a, b| b.total_cmp(a));
        let errors = Errors { rmse: 1.0, worst };
        let mut tail = Tail::default();
        tail.add(&errors);
        tail.largest(&errors, pixels) / quantile(1.0 - 1.0 / pixels as f64)
    }

    #[test]
    fn largest_of_many_is_told_from_few_of_known_distributions() {
        type Quantile = fn(f64) -> f64;
        let cases: [(&str, Quantile); 4] = [
            ("even", |u| u),
            ("exponential", |u| -(1.0 - u).ln()),
            ("a hump", |u| 1.0 - (1.0 - u).sqrt()),
            ("half of them nothing", |u| (2.0 * u - 1.0).max(0.0).powi(2)),
        ];
        for (name, quantile) in cases {
            for sampled in [256, 1024, 4096] {
                let found = ratio(quantile, sampled, 262_144);
                assert!((0.75..1.35).contains(&found), "{name} from {sampled}: {found}");
            }
        }
    }

    #[test]
    fn pictures_without_errors_have_none() {
        let errors = Errors { worst: vec![0.0; 64], rmse: 0.0 };
        let mut tail = Tail::default();
        tail.add(&errors);
        assert_eq!(tail.largest(&errors, 1_000_000), 0.0);
    }
}
