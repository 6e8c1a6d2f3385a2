//! Which labels a volume has: its values as whole numbers, each once.

use std::{
    collections::BTreeSet,
    sync::{Arc, Mutex},
};

use super::Volume;

/// The most samples that are looked at.
const MOST_SAMPLES: usize = 1 << 24;
/// The most labels that are kept.
const MOST_LABELS: usize = 1 << 12;

/// Labels that were found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    /// In rising order.
    pub found: BTreeSet<i64>,
    /// Whether every sample was looked at; else there may be more.
    pub complete: bool,
}

/// By the version and the component that they were found in.
pub(super) type Cache = Mutex<Option<(u64, usize, Arc<Labels>)>>;

impl Volume {
    /// The values of a component as whole numbers, each once. Of large volumes every so manieth of
    /// the samples is looked at, 2^24 at most, and 4096 labels are found at most. Remembered until
    /// [`touch`](Self::touch) or until another component is asked for.
    ///
    /// # Panics
    /// If the component does not exist.
    pub fn labels(&self, component: usize) -> Arc<Labels> {
        let version = self.version();
        let mut cached = self.0.labels.lock().unwrap_or_else(|e| e.into_inner());
        match &*cached {
            Some((v, c, labels)) if (*v, *c) == (version, component) => Arc::clone(labels),
            _ => {
                let labels = Arc::new(self.find_labels(component, MOST_SAMPLES));
                *cached = Some((version, component, Arc::clone(&labels)));
                labels
            }
        }
    }

    fn find_labels(&self, component: usize, most: usize) -> Labels {
        let (desc, bytes) = (&self.0.desc, self.0.data.bytes());
        assert!(component < desc.components, "component outside the volume");
        let samples = desc.samples().unwrap_or(0);
        // An odd stride does not keep to a few columns of a volume whose width is a power of two.
        let stride = if samples > most { samples.div_ceil(most) | 1 } else { 1 };
        let (mut found, mut last) = (BTreeSet::new(), f64::NAN);
        for sample in (0..samples).step_by(stride) {
            let stored = desc.scalar.read(bytes, sample * desc.components + component);
            // Neighbours are mostly alike.
            if stored == last {
                continue;
            }
            last = stored;
            let value = stored * desc.slope + desc.intercept;
            if value.is_finite() && found.insert(value.round_ties_even() as i64) && found.len() == MOST_LABELS {
                return Labels { found, complete: false };
            }
        }
        Labels { found, complete: stride == 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ScalarType, VolumeDesc};

    fn volume(values: &[f32]) -> Volume {
        let desc = VolumeDesc::new([values.len() / 2, 1, 1], ScalarType::F32, 2);
        Volume::new(desc, values.to_vec()).unwrap()
    }

    #[test]
    fn labels_are_whole_and_of_one_component() {
        let volume = volume(&[3.0, 7.0, 3.0, 8.0, -1.0, 8.0, f32::NAN, 2.6]);
        let of = |component| volume.labels(component).found.iter().copied().collect::<Vec<_>>();
        assert_eq!((of(0), of(1), of(0)), (vec![-1, 3], vec![3, 7, 8], vec![-1, 3]));
        assert!(volume.labels(0).complete);
    }

    #[test]
    fn labels_of_large_volumes_are_those_of_some_samples() {
        let values: Vec<f32> = (0..64).flat_map(|i| [i as f32, 0.0]).collect();
        let some = volume(&values).find_labels(0, 16);
        // Every fifth: the next odd number after 64/16.
        assert_eq!(some.found.iter().copied().collect::<Vec<_>>(), (0..64).step_by(5).collect::<Vec<_>>());
        assert!(!some.complete);
        let many: Vec<f32> = (0..5000).flat_map(|i| [i as f32, 0.0]).collect();
        let bounded = volume(&many).labels(0);
        assert_eq!((bounded.found.len(), bounded.complete), (4096, false));
    }
}
