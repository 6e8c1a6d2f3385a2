//! The atlas of failure: each known way in which volume rendering goes wrong as a family of scenes with a
//! knob that makes them harder.
//!
//! A [`Ladder`] turns one knob. The error of each [`Method`] is measured on every rung against a truth of
//! its own (a closed form, else the certified reference) and held from both sides: a method that holds
//! stays below its bound on all rungs, one that fails is seen to fail, and is right at the easy end, so
//! that it is the knob that makes it fail. Methods are actions with their options, and, where Volact has
//! no such method because it fails, a plain model of it (`naive`), said to be one.
//!
//! An [`Answer`] is what Volact does about it, with the check that it does. `docs/stability.md` is
//! [written](page) from this; `tests/stability.rs` holds both to the code.

mod accumulation;
mod anisotropy;
mod bricks;
mod cells;
mod faults;
mod lab;
mod naive;
mod numbers;
pub mod page;
mod perspective;
mod places;
mod precision;
mod shading;
mod switching;
mod tables;

pub use lab::Lab;

/// What is measured: an error, or why there is none.
pub type Measured = Result<f64, Missing>;

/// Why there is no error to a rung.
#[derive(Clone, Debug, PartialEq)]
pub enum Missing {
    /// There is nothing here that draws it: no device.
    Skipped(String),
    /// The action refused, in its words.
    Refused(String),
}

type Measure = Box<dyn Fn(&Lab, f64) -> Measured + Send + Sync>;
type Check = Box<dyn Fn(&Lab) -> Result<(), String> + Send + Sync>;

/// One way of going wrong, or several that are akin.
pub struct Family {
    /// Its number in the list of failures.
    pub number: usize,
    /// In words.
    pub title: &'static str,
    /// What goes wrong, and why.
    pub about: &'static str,
    /// What is measured of it.
    pub ladders: Vec<Ladder>,
    /// What Volact does about it.
    pub answers: Vec<Answer>,
}

/// Scenes along a knob, and methods that draw them.
pub struct Ladder {
    /// A short name, also of its chart's file.
    pub name: &'static str,
    /// In words.
    pub title: &'static str,
    /// What the knob is, with its unit.
    pub knob: &'static str,
    /// What is taken for true.
    pub truth: &'static str,
    /// From easy to hard.
    pub rungs: Vec<f64>,
    /// Who draws.
    pub methods: Vec<Method>,
}

/// A way of drawing a ladder's scenes, and what is said of it.
pub struct Method {
    /// In words; models say so.
    pub name: &'static str,
    /// What it is said to do.
    pub bound: Bound,
    measure: Measure,
}

/// What a method is said to do, from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// On all rungs the error is at most this.
    Holds(f64),
    /// The greatest error lies between these, and that of the first rung is at most `easy`.
    Fails {
        /// Least and most that the greatest error may be.
        worst: [f64; 2],
        /// The most that the error may be at the easy end.
        easy: f64,
    },
    /// From some rung to the last it is refused, with these words; what is drawn is right to `error`.
    Refuses {
        /// Part of the error's words.
        words: &'static str,
        /// The most that the error may be of what is drawn.
        error: f64,
    },
}

/// What Volact does about a way of going wrong.
pub struct Answer {
    /// Whether it detects, adapts, refuses, is right by its making, or does nothing.
    pub does: Does,
    /// In a sentence.
    pub what: &'static str,
    check: Check,
}

/// In which way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Does {
    /// It draws, and the frame says so.
    Detects,
    /// It takes another method by itself, and says which.
    Adapts,
    /// It is an error that names the thing.
    Refuses,
    /// It cannot happen, by how it is made.
    Avoids,
    /// It draws what is wrong and does not say so: a gap, with its cure.
    Silent,
}

/// The errors of one method along a ladder.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// The method's name.
    pub name: &'static str,
    /// What is said of it.
    pub bound: Bound,
    /// On each rung.
    pub errors: Vec<Measured>,
}

/// The families, in the order of their numbers.
pub fn families() -> Vec<Family> {
    vec![
        perspective::family(),
        tables::family(),
        precision::family(),
        cells::family(),
        bricks::family(),
        anisotropy::family(),
        places::family(),
        numbers::family(),
        switching::family(),
        shading::family(),
        accumulation::family(),
        faults::family(),
    ]
}

impl Ladder {
    /// Draws everything.
    pub fn climb(&self, lab: &Lab) -> Vec<Curve> {
        self.methods.iter().map(|m| m.climb(lab, &self.rungs)).collect()
    }
}

impl Method {
    /// One whose errors stay below a bound.
    fn holds(name: &'static str, most: f64, measure: impl Fn(&Lab, f64) -> Measured + Send + Sync + 'static) -> Self {
        Self { name, bound: Bound::Holds(most), measure: Box::new(measure) }
    }

    /// One that is right to `easy` on the first rung, and whose worst error is between two numbers.
    fn fails(
        name: &'static str,
        (easy, worst): (f64, [f64; 2]),
        measure: impl Fn(&Lab, f64) -> Measured + Send + Sync + 'static,
    ) -> Self {
        Self { name, bound: Bound::Fails { worst, easy }, measure: Box::new(measure) }
    }

    /// One that refuses the last rung, and is right before.
    fn refuses(
        name: &'static str,
        (words, error): (&'static str, f64),
        measure: impl Fn(&Lab, f64) -> Measured + Send + Sync + 'static,
    ) -> Self {
        Self { name, bound: Bound::Refuses { words, error }, measure: Box::new(measure) }
    }

    fn climb(&self, lab: &Lab, rungs: &[f64]) -> Curve {
        let errors = rungs.iter().map(|&at| (self.measure)(lab, at)).collect();
        Curve { name: self.name, bound: self.bound, errors }
    }
}

impl Answer {
    fn new(does: Does, what: &'static str, check: impl Fn(&Lab) -> Result<(), String> + Send + Sync + 'static) -> Self {
        Self { does, what, check: Box::new(check) }
    }

    /// Whether Volact does it.
    ///
    /// # Errors
    /// If not, what it did.
    pub fn check(&self, lab: &Lab) -> Result<(), String> {
        (self.check)(lab)
    }
}

impl Does {
    /// As a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Detects => "detects",
            Self::Adapts => "adapts",
            Self::Refuses => "refuses",
            Self::Avoids => "avoids",
            Self::Silent => "does not say",
        }
    }
}

impl Curve {
    /// The greatest error of what was drawn.
    pub fn worst(&self) -> f64 {
        self.errors.iter().flatten().fold(0.0, |m, e| if e.is_nan() { f64::INFINITY } else { m.max(*e) })
    }

    /// Whether nothing here draws it.
    pub fn skipped(&self) -> Option<&str> {
        self.errors.iter().find_map(|e| match e {
            Err(Missing::Skipped(why)) => Some(why.as_str()),
            _ => None,
        })
    }

    /// What is not as it is said to be.
    pub fn problems(&self) -> Vec<String> {
        let refused = |part: &[Measured]| {
            part.iter().find_map(|e| if let Err(Missing::Refused(why)) = e { Some(why.clone()) } else { None })
        };
        let last = self.errors.len().saturating_sub(1);
        // What fails or refuses somewhere may refuse elsewhere.
        let drawn = if matches!(self.bound, Bound::Holds(_)) { self.errors.len() } else { 0 };
        let mut problems: Vec<String> =
            refused(&self.errors[..drawn]).map(|why| format!("{}: refused: {why}", self.name)).into_iter().collect();
        let mut wrong = |what: String| problems.push(format!("{}: {what}", self.name));
        match self.bound {
            Bound::Holds(most) if self.worst() > most => {
                wrong(format!("error {:.3e}, wanted at most {most:e}", self.worst()));
            }
            Bound::Fails { worst: [low, high], easy } => {
                if !(low..=high).contains(&self.worst()) {
                    wrong(format!("error {:.3e}, wanted {low:e} to {high:e}", self.worst()));
                }
                if let Some(Ok(first)) = self.errors.first()
                    && *first > easy
                {
                    wrong(format!("error {first:.3e} at the easy end, wanted at most {easy:e}"));
                }
            }
            Bound::Refuses { words, error } => {
                let why = refused(&self.errors[last..]);
                if !why.as_ref().is_some_and(|why| why.contains(words)) {
                    wrong(format!("last rung is {why:?}, wanted a refusal with {words:?}"));
                }
                if self.worst() > error {
                    wrong(format!("error {:.3e} of what is drawn, wanted at most {error:e}", self.worst()));
                }
            }
            Bound::Holds(_) => {}
        }
        problems
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(bound: Bound, errors: &[f64]) -> Curve {
        Curve { name: "m", bound, errors: errors.iter().map(|e| Ok(*e)).collect() }
    }

    #[test]
    fn bounds_hold_from_both_sides() {
        let (holds, fails) = (Bound::Holds(0.1), Bound::Fails { worst: [0.5, 1.0], easy: 0.1 });
        assert!(curve(holds, &[0.01, 0.1]).problems().is_empty());
        assert_eq!(curve(holds, &[0.01, 0.2]).problems().len(), 1);
        assert_eq!(curve(holds, &[f64::NAN]).problems().len(), 1);
        assert!(curve(fails, &[0.01, 0.7]).problems().is_empty());
        assert_eq!(curve(fails, &[0.01, 0.2]).problems().len(), 1, "said to fail, and does not");
        assert_eq!(curve(fails, &[0.2, 0.7]).problems().len(), 1, "wrong from the first on");
        assert_eq!(curve(fails, &[0.01, 7.0]).problems().len(), 1, "worse than said");
    }

    #[test]
    fn a_refusal_is_one_by_its_words() {
        let bound = Bound::Refuses { words: "too long", error: 0.1 };
        let refused =
            |why: &str| Curve { errors: vec![Ok(0.0), Err(Missing::Refused(why.into()))], ..curve(bound, &[]) };
        assert!(refused("a ray is too long").problems().is_empty());
        assert_eq!(refused("no").problems().len(), 1);
        assert_eq!(curve(bound, &[0.0, 0.0]).problems().len(), 1);
    }
}
