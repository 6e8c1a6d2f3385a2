//! The floating-point state of a thread, which a plugin must leave as it found it.
//!
//! A library built with fast-math turns on flush-to-zero when it is loaded, for the whole thread
//! and all threads that it starts: pictures would differ from then on.

/// Restores the state in force when it was made, when it is dropped.
#[derive(Debug)]
pub struct FloatState(Control);

impl FloatState {
    /// Remembers the state of this thread.
    pub fn save() -> Self {
        Self(read())
    }
}

impl Drop for FloatState {
    fn drop(&mut self) {
        write(self.0);
    }
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
type Control = (u32, u16);

#[cfg(all(target_arch = "x86_64", not(miri)))]
fn read() -> Control {
    let (mut vector, mut stack) = (0u32, 0u16);
    // SAFETY: both instructions store a control word into the variable that they are given.
    unsafe {
        std::arch::asm!("stmxcsr [{}]", "fnstcw [{}]", in(reg) &raw mut vector, in(reg) &raw mut stack,
            options(nostack, preserves_flags));
    }
    (vector, stack)
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
fn write((vector, stack): Control) {
    // SAFETY: both instructions load a control word that `read` stored.
    unsafe {
        std::arch::asm!("ldmxcsr [{}]", "fldcw [{}]", in(reg) &raw const vector, in(reg) &raw const stack,
            options(nostack, preserves_flags));
    }
}

#[cfg(all(target_arch = "aarch64", not(miri)))]
type Control = u64;

#[cfg(all(target_arch = "aarch64", not(miri)))]
fn read() -> Control {
    let control: u64;
    // SAFETY: reads a register that every program may read.
    unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack, preserves_flags)) };
    control
}

#[cfg(all(target_arch = "aarch64", not(miri)))]
fn write(control: Control) {
    // SAFETY: writes what `read` read.
    unsafe { std::arch::asm!("msr fpcr, {}", in(reg) control, options(nomem, nostack, preserves_flags)) };
}

#[cfg(any(miri, not(any(target_arch = "x86_64", target_arch = "aarch64"))))]
type Control = ();

#[cfg(any(miri, not(any(target_arch = "x86_64", target_arch = "aarch64"))))]
fn read() -> Control {}

#[cfg(any(miri, not(any(target_arch = "x86_64", target_arch = "aarch64"))))]
fn write((): Control) {}

#[cfg(all(test, target_arch = "x86_64", not(miri)))]
mod tests {
    use super::*;

    #[test]
    fn flush_to_zero_does_not_outlive_the_guard() {
        let tiny = std::hint::black_box(f32::MIN_POSITIVE);
        let half = || std::hint::black_box(tiny) * std::hint::black_box(0.5f32);
        {
            let _state = FloatState::save();
            let (vector, stack) = read();
            write((vector | 0x8040, stack));
            assert_eq!(half(), 0.0);
        }
        assert!(half() > 0.0);
    }
}
