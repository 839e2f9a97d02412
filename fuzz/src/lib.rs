//! Damaged files for every reader of unscatter: guided by coverage (cargo-fuzz), or by lot (stable Rust). See README.md.

pub mod formats;

/// A target of cargo-fuzz: one format.
#[cfg(feature = "libfuzzer")]
#[macro_export]
macro_rules! target {
    ($name:literal) => {
        thread_local! {
            static READER: $crate::formats::Reader = {
                $crate::end_at_panics();
                $crate::formats::Reader::new($name)
            };
        }
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| READER.with(|reader| {
            _ = reader.read(bytes);
        }));
    };
}

/// A panic ends the process, unless it is one of a decoder's that is caught and told as an error.
#[cfg(feature = "libfuzzer")]
pub fn end_at_panics() {
    std::panic::set_hook(Box::new(|panic| {
        if !unscatter::io::is_guarded() {
            eprintln!("{panic}");
            std::process::abort();
        }
    }));
}
