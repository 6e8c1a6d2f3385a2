//! Sample distances: a lattice of quarters of an octave, and when to go from one to another.

/// The coarsest step: 8 voxels.
pub const COARSEST: i32 = -12;

/// The finest: a 64th of a voxel.
pub const FINEST: i32 = 24;

/// Looks in a row that must allow a coarser step before it is taken.
const CALM: u32 = 6;

/// A coarser step is taken only where its error is expected to be within this part of the bound.
const ROOM: f64 = 0.8;

/// A number of the lattice as a distance, 0 being the smallest voxel.
pub fn distance(voxel: f64, k: i32) -> f64 {
    voxel * (-0.25 * f64::from(k)).exp2()
}

/// The coarsest number of the lattice whose distance is no larger than this.
pub fn at_most(voxel: f64, distance: f64) -> i32 {
    let k = -4.0 * (distance / voxel).log2();
    // Roundings of a number of the lattice itself do not count.
    (k - 1e-6).ceil().clamp(f64::from(COARSEST), f64::from(FINEST)) as i32
}

/// Order of the error that two measurements show, numbers of the lattice and errors; 2 where they show none.
pub fn order(a: (i32, f64), b: (i32, f64)) -> f64 {
    let octaves = 0.25 * f64::from(b.0 - a.0);
    let p = (a.1 / b.1).log2() / octaves;
    if p.is_finite() { p.clamp(0.5, 4.0) } else { 2.0 }
}

/// The number of the lattice at which an error of order `p`, measured at `k`, comes to a bound.
pub fn reaching(k: i32, error: f64, p: f64, bound: f64) -> i32 {
    let more = 4.0 * (error / bound).log2() / p;
    // No error at all, and none that is a number.
    let more = if more.is_nan() { 0.0 } else { more.clamp(-100.0, 100.0) };
    (k + (more - 1e-6).ceil() as i32).clamp(COARSEST, FINEST)
}

/// Keeps a step from one frame to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steady {
    /// The number of the lattice.
    pub k: i32,
    calm: u32,
}

impl Steady {
    /// Begins with a step.
    pub fn new(k: i32) -> Self {
        Self { k, calm: 0 }
    }

    /// Goes on with the error that is expected at the step, and its order: finer at once where the bound asks
    /// for it, coarser by one where six looks in a row allowed for it with room to spare.
    pub fn follow(&mut self, error: f64, p: f64, bound: f64) {
        let wanted = reaching(self.k, error, p, bound);
        if wanted > self.k {
            *self = Self::new(wanted);
        } else if reaching(self.k, error, p, ROOM * bound) < self.k {
            self.calm += 1;
            if self.calm >= CALM {
                *self = Self::new(self.k - 1);
            }
        } else {
            self.calm = 0;
        }
    }

    /// Goes on with the time that is expected at the step: coarser at once where that is too long, finer by one
    /// where six looks in a row left room for it. Half the distance takes twice the time at most.
    pub fn follow_time(&mut self, seconds: f64, wanted: f64) {
        let finer = (0.25_f64).exp2();
        if seconds > wanted {
            let less = (4.0 * (seconds / wanted).log2()).ceil().clamp(1.0, 100.0) as i32;
            *self = Self::new((self.k - less).max(COARSEST));
        } else if seconds * finer <= 0.9 * wanted && self.k < FINEST {
            self.calm += 1;
            if self.calm >= CALM {
                *self = Self::new(self.k + 1);
            }
        } else {
            self.calm = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_numbers_halve_the_distance() {
        assert_eq!(distance(2.0, 0), 2.0);
        assert!((distance(2.0, 4) - 1.0).abs() < 1e-12);
        for k in COARSEST..=FINEST {
            assert_eq!(at_most(0.3, distance(0.3, k)), k);
        }
        assert_eq!(at_most(1.0, 0.9), 1);
        assert_eq!(at_most(1.0, 1e-9), FINEST);
    }

    #[test]
    fn order_and_reach_are_those_of_a_power_law() {
        let error = |k: i32| 0.3 * distance(1.0, k).powf(1.5);
        assert!((order((0, error(0)), (6, error(6))) - 1.5).abs() < 1e-9);
        let k = reaching(0, error(0), 1.5, 0.01);
        assert!(error(k) <= 0.01 && error(k - 1) > 0.01);
        assert_eq!(order((0, 0.0), (4, 0.0)), 2.0);
        assert_eq!(reaching(3, 0.0, 2.0, 0.1), COARSEST);
        assert_eq!(reaching(3, f64::INFINITY, 2.0, 0.1), FINEST);
        assert_eq!(reaching(3, f64::NAN, 2.0, 0.1), 3);
    }

    #[test]
    fn a_time_is_kept_at_once_and_used_in_time() {
        let seconds = |k: i32| 0.01 / distance(1.0, k);
        let mut steady = Steady::new(8);
        steady.follow_time(seconds(8), 0.02);
        assert!(seconds(steady.k) <= 0.02 && seconds(steady.k + 1) > 0.02);
        for _ in 0..60 {
            steady.follow_time(seconds(steady.k), 0.08);
        }
        assert!(seconds(steady.k) <= 0.08 && seconds(steady.k) > 0.05);
    }

    #[test]
    fn a_step_does_not_flicker_while_errors_waver() {
        let mut steady = Steady::new(0);
        let mut changes = 0;
        for frame in 0..1000 {
            // Ten per cent up and down around the bound.
            let wavering = 1.0 + 0.1 * f64::from(frame).sin();
            let before = steady.k;
            let error = wavering * distance(1.0, steady.k).powi(2);
            steady.follow(error, 2.0, 1.0);
            changes += u32::from(steady.k != before);
        }
        assert!(changes <= 2, "{changes}");
        // A lasting change is followed.
        for _ in 0..100 {
            steady.follow(0.01 * distance(1.0, steady.k).powi(2), 2.0, 1.0);
        }
        assert!(steady.k <= -11, "{}", steady.k);
        steady.follow(16.0 * distance(1.0, steady.k).powi(2), 2.0, 1.0);
        assert!(steady.k >= 8, "{}", steady.k);
    }
}
