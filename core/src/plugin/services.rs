//! What a host offers to its plugins, and how a plugin in Rust uses it.

use std::{
    ffi::c_void,
    sync::atomic::{AtomicPtr, AtomicU64, Ordering},
};

use super::{
    abi::{self, Host, Text},
    arena::{bytes_of, str_of},
    status::{Code, Fault, caught, keep_for_host, last_of_host, leave, result_of},
};

/// The host's table.
pub(super) static HOST: Host = Host {
    size: size_of::<Host>() as u32,
    oldest: abi::VERSION,
    newest: abi::VERSION,
    reserved: 0,
    set_error: Some(set_error),
    last_error: Some(last_error),
    log: Some(log_message),
    log_level: Some(log_level),
    parallel_for: Some(host_parallel_for),
};

/// The host of the plugin that this code is part of; null where it is the host's own.
static MINE: AtomicPtr<Host> = AtomicPtr::new(std::ptr::null_mut());

/// Remembers the host, in a plugin.
pub(super) fn set_host(host: &'static Host) {
    MINE.store(std::ptr::from_ref(host).cast_mut(), Ordering::Release);
}

/// Whether a host's table is this very code's: the plugin is linked statically.
pub(super) fn is_own(host: &Host) -> bool {
    std::ptr::eq(host, &raw const HOST)
}

fn host() -> Option<&'static Host> {
    // SAFETY: `set_host` stored a table that lives as long as the process.
    unsafe { MINE.load(Ordering::Acquire).as_ref() }
}

fn as_text(text: &str) -> Text {
    Text { data: text.as_ptr(), length: text.len() as u64 }
}

/// What the host says about its last failure on this thread, in a plugin.
pub(super) fn words_of_host() -> Option<String> {
    let host = host().filter(|host| !is_own(host))?;
    // SAFETY: the text is valid until the host's next failure on this thread.
    let text = unsafe { bytes_of((host.last_error?)(), "message") }.ok()?;
    (!text.is_empty()).then(|| String::from_utf8_lossy(text).into_owned())
}

/// Runs what the other side asked for: nothing unwinds, and the message stays with the thread.
pub(super) fn answer(run: impl FnOnce() -> Result<(), Fault>) -> i32 {
    match caught(run) {
        Ok(()) => abi::OK,
        Err(fault) => {
            keep_for_host(&fault.message);
            if let Some(set_error) = host().and_then(|host| host.set_error) {
                // SAFETY: the host copies the text.
                unsafe { set_error(as_text(&fault.message)) };
            }
            fault.code.number()
        }
    }
}

unsafe extern "C" fn set_error(message: Text) {
    // SAFETY: the boundary's rules: the text is valid during the call.
    let words = unsafe { bytes_of(message, "message") }.map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    leave(words.unwrap_or_else(|fault| format!("an error whose message cannot be read: {fault}")));
}

unsafe extern "C" fn last_error() -> Text {
    last_of_host()
}

unsafe extern "C" fn log_message(level: u32, target: Text, message: Text) {
    let level = match level {
        abi::LOG_ERROR => log::Level::Error,
        abi::LOG_WARN => log::Level::Warn,
        abi::LOG_INFO => log::Level::Info,
        abi::LOG_DEBUG => log::Level::Debug,
        _ => log::Level::Trace,
    };
    // A logger that panics is no reason to end.
    let logged = caught(|| {
        // SAFETY: the boundary's rules: both texts are valid during the call.
        let (target, message) = unsafe { (bytes_of(target, "target")?, bytes_of(message, "message")?) };
        let (target, message) = (String::from_utf8_lossy(target), String::from_utf8_lossy(message));
        log::log!(target: &target, level, "{message}");
        Ok(())
    });
    if let Err(fault) = logged {
        keep_for_host(&fault.message);
    }
}

unsafe extern "C" fn log_level() -> u32 {
    log::max_level() as u32
}

type Task = unsafe extern "C" fn(*mut c_void, u64);

unsafe extern "C" fn host_parallel_for(threads: u32, count: u64, task: Option<Task>, user: *mut c_void) -> i32 {
    answer(|| {
        let task = task.ok_or_else(|| Fault::bad("task", "null", "a function"))?;
        run_tasks(threads, count, task, User(user));
        Ok(())
    })
}

#[derive(Clone, Copy)]
struct User(*mut c_void);

impl User {
    /// By a method, so that the wrapper is what crosses to the thread.
    fn pointer(self) -> *mut c_void {
        self.0
    }
}

// SAFETY: the caller of `parallel_for` says by calling it that its tasks may run on any thread.
unsafe impl Send for User {}
// SAFETY: as for Send.
unsafe impl Sync for User {}

fn run_tasks(threads: u32, count: u64, task: Task, user: User) {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = if threads == 0 { all } else { (threads as usize).min(4 * all) };
    let threads = threads.min(usize::try_from(count).unwrap_or(usize::MAX));
    let next = AtomicU64::new(0);
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                break;
            }
            // SAFETY: the caller of `parallel_for` gave the two together.
            unsafe { task(user.pointer(), index) };
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            // Where no thread can be had, this one does the work.
            _ = std::thread::Builder::new().spawn_scoped(scope, work);
        }
        work();
    });
}

/// Calls `task(i)` for each `i` below `count`, from up to `threads` of the host's threads at once
/// (0: as many as there are processors), and returns when all are done. For plugins, which should
/// not start threads of their own for every picture.
///
/// # Errors
/// If a task panicked; the others are done all the same.
pub fn parallel_for(threads: u32, count: u64, task: impl Fn(u64) + Sync) -> Result<(), Fault> {
    struct Shared<'a> {
        task: &'a (dyn Fn(u64) + Sync),
        failed: std::sync::Mutex<Option<Fault>>,
    }
    unsafe extern "C" fn run(user: *mut c_void, index: u64) {
        // SAFETY: `user` is the `Shared` of the call that is still running.
        let shared = unsafe { &*user.cast::<Shared<'_>>() };
        let done = caught(|| {
            (shared.task)(index);
            Ok(())
        });
        if let Err(fault) = done {
            *shared.failed.lock().unwrap_or_else(|e| e.into_inner()) = Some(fault);
        }
    }
    let shared = Shared { task: &task, failed: std::sync::Mutex::default() };
    let call = host().and_then(|host| host.parallel_for).unwrap_or(host_parallel_for);
    // SAFETY: `run` takes what it is given here, and the call returns when all tasks are done.
    let status = unsafe { call(threads, count, Some(run), (&raw const shared).cast_mut().cast()) };
    result_of(status)?;
    match shared.failed.into_inner().unwrap_or_else(|e| e.into_inner()) {
        Some(fault) => Err(fault),
        None => Ok(()),
    }
}

/// A logger that hands everything to the host, for a plugin that was loaded.
struct HostLog;

impl log::Log for HostLog {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        let level = host().and_then(|host| host.log_level);
        // SAFETY: the function is the host's, which takes nothing.
        level.is_some_and(|level| metadata.level() as u32 <= unsafe { level() })
    }

    fn log(&self, record: &log::Record<'_>) {
        if !self.enabled(record.metadata()) {
            return;
        }
        if let Some(write) = host().and_then(|host| host.log) {
            let message = record.args().to_string();
            // SAFETY: both texts are valid during the call.
            unsafe { write(record.level() as u32, as_text(record.target()), as_text(&message)) };
        }
    }

    fn flush(&self) {}
}

/// Sends what this library logs, and what its panics say, to the host.
pub(super) fn redirect(plugin: &'static str) {
    static LOG: HostLog = HostLog;
    if log::set_logger(&LOG).is_ok() {
        log::set_max_level(log::LevelFilter::Trace);
    }
    std::panic::set_hook(Box::new(move |info| log::debug!(target: plugin, "{info}")));
}

/// Checks that a host's table can be used.
///
/// # Safety
/// `host` is null or points to a table whose `size` is true, and that lives as long as the process.
pub(super) unsafe fn check_host(host: *const Host) -> Result<&'static Host, Fault> {
    // SAFETY: as promised by the caller.
    let host = unsafe { host.as_ref() }.ok_or_else(|| Fault::bad("host", "a null pointer", "a table"))?;
    if (host.size as usize) < size_of::<Host>() {
        return Err(Fault::new(Code::BadVersion, format!("size of the host's table is {}", host.size)));
    }
    Ok(host)
}

/// Text of the other side for a sink; what cannot be read is said so.
///
/// # Safety
/// The text is valid during the call.
pub(super) unsafe fn words(text: Text, what: &str) -> Result<String, Fault> {
    // SAFETY: as promised by the caller.
    unsafe { str_of(text, what) }.map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_runs_once() {
        let counts: Vec<_> = (0..1000).map(|_| AtomicU64::new(0)).collect();
        parallel_for(0, 1000, |i| _ = counts[i as usize].fetch_add(1, Ordering::Relaxed)).unwrap();
        assert!(counts.iter().all(|c| c.load(Ordering::Relaxed) == 1));
        parallel_for(3, 0, |_| unreachable!()).unwrap();
    }

    #[test]
    fn panicking_task_is_an_error_and_the_others_are_done() {
        let done = AtomicU64::new(0);
        let task = |i| {
            assert_ne!(i, 7, "seven");
            done.fetch_add(1, Ordering::Relaxed);
        };
        let fault = parallel_for(2, 20, task).unwrap_err();
        assert!(fault.code == Code::Panicked && fault.message.contains("seven"), "{fault}");
        assert_eq!(done.load(Ordering::Relaxed), 19);
    }

    #[test]
    fn null_task_is_refused_with_a_message() {
        // SAFETY: nothing is called.
        let status = unsafe { host_parallel_for(1, 1, None, std::ptr::null_mut()) };
        // SAFETY: the text is valid until the next failure.
        let text = unsafe { words(last_error(), "message") }.unwrap();
        assert_eq!((status, text.as_str()), (abi::BAD_VALUE, "task is null, wanted a function"));
    }
}
