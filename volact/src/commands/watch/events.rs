//! Says that something may have changed in some folders. What did is for others to find out.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    sync::mpsc::{self, Receiver},
    time::{Duration, Instant, SystemTime},
};

use notify::{RecommendedWatcher, RecursiveMode, Watcher as _};

/// Several changes at once are one: it is over when nothing happens for this long.
const QUIET: Duration = Duration::from_millis(60);
/// For longer than this nobody waits for quiet.
const RESTLESS: Duration = Duration::from_millis(600);

/// The system's watcher of folders. Folders and not files, since a file that is replaced is another.
pub struct Events {
    /// `None` where the system has none for us.
    watcher: Option<RecommendedWatcher>,
    told: Receiver<()>,
    /// What is watched, and when that folder was made: one that comes back is another.
    folders: BTreeMap<PathBuf, Option<SystemTime>>,
}

impl Events {
    /// A watcher of nothing yet.
    pub fn new() -> Self {
        let (tell, told) = mpsc::channel();
        let watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
            // Reading is no change; an error may have been one.
            if event.map_or(true, |event| !event.kind.is_access()) {
                _ = tell.send(());
            }
        });
        let watcher = watcher.inspect_err(|error| log::info!("changes are found by looking: {error}")).ok();
        Self { watcher, told, folders: BTreeMap::new() }
    }

    /// Watches these folders and no others.
    pub fn watch(&mut self, wanted: BTreeSet<PathBuf>) {
        let Some(watcher) = self.watcher.as_mut() else { return };
        let made = |folder: &Path| fs::metadata(folder).and_then(|data| data.created()).ok();
        self.folders.retain(|folder, since| {
            let keep = wanted.contains(folder) && *since == made(folder);
            if !keep {
                _ = watcher.unwatch(folder);
            }
            keep
        });
        for folder in wanted {
            if self.folders.contains_key(&folder) {
                continue;
            }
            let since = made(&folder);
            match watcher.watch(&folder, RecursiveMode::NonRecursive) {
                Ok(()) => _ = self.folders.insert(folder, since),
                Err(error) => log::info!("{}: changes are found by looking: {error}", folder.display()),
            }
        }
    }

    /// Waits until something happened and it is quiet again, or that time has passed.
    pub fn wait(&self, at_most: Duration) {
        let start = Instant::now();
        if self.watcher.is_none() || self.told.recv_timeout(at_most).is_err() {
            // Without a watcher, the receiver returns at once.
            std::thread::sleep(at_most.saturating_sub(start.elapsed()));
            return;
        }
        let heard = Instant::now();
        while heard.elapsed() < RESTLESS && self.told.recv_timeout(QUIET).is_ok() {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_of_changes_is_one_and_reading_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        fs::write(&file, "1").unwrap();
        let mut events = Events::new();
        events.watch(BTreeSet::from([folder.path().to_owned()]));
        for text in ["2", "3", "4"] {
            fs::write(&file, text).unwrap();
        }
        events.wait(Duration::from_secs(20));
        assert!(events.told.try_recv().is_err(), "the burst is over");
        assert_eq!(fs::read_to_string(&file).unwrap(), "4");
        let start = Instant::now();
        events.wait(Duration::from_millis(300));
        assert!(start.elapsed() >= Duration::from_millis(300), "reading told of a change");
    }
}
