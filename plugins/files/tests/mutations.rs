//! Damaged files: every sample with bits flipped, bytes replaced, inserted and cut. Nothing may
//! panic, hang or lie about its size.
//!
//! The same check as in `fuzz/`, without its tools: a fixed seed, a few seconds.

mod samples;

use std::{path::Path, time::Instant};

use samples::{Sample, all};
use volact_core::{
    Volume,
    loader::{LoadOptions, NoProgress},
};
use volact_files::{Storage, open_in};

/// Reads what is accepted; returns whether it was.
fn check(sample: &Sample, storage: &Storage) -> bool {
    let Ok(mut reader) = open_in(storage, sample.loader, Path::new(sample.path), &LoadOptions::new()) else {
        return false;
    };
    let desc = reader.desc().clone();
    if desc.bytes().unwrap() > 16 << 20 {
        return true;
    }
    let Ok(data) = reader.read(&NoProgress) else { return false };
    Volume::new(desc, data).unwrap();
    true
}

/// A small generator of numbers that never changes: xorshift64*.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % limit.max(1)
    }
}

fn damage(bytes: &mut Vec<u8>, numbers: &mut Numbers) {
    let at = numbers.below(bytes.len());
    match numbers.below(7) {
        0 => bytes[at] ^= 1 << numbers.below(8),
        1 => bytes[at] = numbers.below(256) as u8,
        2 => bytes[at] = [0, 0xff, 0x7f, 0x80, b'9', b'-', b' ', b'\n'][numbers.below(8)],
        3 => bytes.truncate(at),
        4 => bytes.insert(at, b"0123456789-\n %"[numbers.below(14)]),
        5 => {
            let end = (at + 1 + numbers.below(8)).min(bytes.len());
            bytes.drain(at..end);
        }
        _ => {
            let end = (at + 4).min(bytes.len());
            let fill = [0, 0xff][numbers.below(2)];
            bytes[at..end].fill(fill);
        }
    }
}

#[test]
fn damaged_files_are_errors_or_volumes() {
    let mut numbers = Numbers(0x5eed_0f01_ac70_0001);
    let (mut accepted, mut refused) = (0, 0);
    for sample in all() {
        for _ in 0..400 {
            let index = numbers.below(sample.files.len());
            let mut bytes = sample.files[index].1.clone();
            for _ in 0..=numbers.below(3) {
                if !bytes.is_empty() {
                    damage(&mut bytes, &mut numbers);
                }
            }
            let start = Instant::now();
            match check(&sample, &sample.with(index, bytes)) {
                true => accepted += 1,
                false => refused += 1,
            }
            assert!(start.elapsed().as_secs() < 5, "{}: slow", sample.name);
        }
    }
    // Both must happen, or the damage misses what it is for.
    assert!(accepted > 1000 && refused > 1000, "{accepted} accepted, {refused} refused");
}

/// Every sample cut at every byte: only what does not carry data may be missing.
#[test]
fn truncated_files_never_give_a_volume_of_other_voxels() {
    for sample in all() {
        let (_, whole) = &sample.files[0];
        for length in 0..whole.len() {
            let storage = sample.with(0, whole[..length].to_vec());
            let Ok(mut reader) = open_in(&storage, sample.loader, Path::new(sample.path), &LoadOptions::new()) else {
                continue;
            };
            let Ok(data) = reader.read(&NoProgress) else { continue };
            let same = data.bytes() == sample.voxels && reader.desc().dims == samples::DIMS;
            // A header may lose a field, or its last digit, and mean another grid with the same files.
            let header_only = sample.files.len() > 1;
            // The last number of a text may lose a digit, which nobody can see.
            let digits = sample.name.ends_with(" text") && data.bytes()[..58] == sample.voxels[..58];
            assert!(same || header_only || digits, "{} cut at {length} of {}", sample.name, whole.len());
        }
    }
}

/// Writes all samples as a first corpus for `fuzz/`, if `VOLACT_SEEDS` names a folder.
#[test]
fn seeds_are_written_where_asked() {
    let Some(folder) = std::env::var_os("VOLACT_SEEDS") else { return };
    for sample in all() {
        let target = Path::new(&folder).join(sample.loader);
        std::fs::create_dir_all(&target).unwrap();
        let mut bytes = sample.files[0].1.clone();
        if sample.loader == "dicom" {
            bytes = sample.files.iter().fold(vec![2], |all, (_, file)| [all, file.clone()].concat());
        }
        std::fs::write(target.join(sample.name.replace(' ', "_")), bytes).unwrap();
    }
}

/// Found by fuzzing: 2^32 × 2^32 pixels of three bytes overflowed the number of bytes.
#[test]
fn png_of_more_bytes_than_64_bits_count_is_refused() {
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\xf0\x80\0\x07\xff\x98\xef\xff\x08\x02\0\0\0".to_vec();
    bytes.extend(b"\x88\x6a\x18\x72\0\0\0\0IDAT");
    let storage = Storage::memory([("v.png", bytes)]);
    let error = open_in(&storage, "png", Path::new("v.png"), &LoadOptions::new()).err().unwrap().to_string();
    let wanted = "v.png: holds 41 bytes of PNG, enough for at most 42312 bytes of pixels, wanted 18446744073709551615";
    assert_eq!(error, wanted);
}
