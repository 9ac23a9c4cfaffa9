//! What every input must keep, in a function that a fuzzer calls; `fuzz/` does so by the million, a test here by the dozen.

use crate::windows::Windows;

/// Any bytes as a file of windows: no panic, whichever window is read; and what is read as one is written and read again the same.
///
/// # Panics
/// If that does not hold.
pub fn windows(bytes: &[u8]) {
    // A fuzzer does not come by checksums by chance.
    crate::windows::any_window(bytes);
    let mended = crate::windows::with_right_checksums(bytes);
    for bytes in [bytes.to_vec(), mended] {
        let Ok(windows) = Windows::of_bytes(bytes) else { continue };
        for index in 0..windows.len() {
            let _ = windows.get(index);
        }
        assert!(windows.get(windows.len()).is_err());
        assert_eq!(windows.training().len() + windows.validation().len(), windows.len());
    }
}
