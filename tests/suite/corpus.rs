//! The corpus of the fuzzers, in stable Rust: what is named `read_…` is read, what is named `refused_…` is refused with a sentence.

#[path = "../../fuzz/src/formats.rs"]
mod formats;

use formats::{FORMATS, Reader, files, root};

#[test]
fn every_file_of_the_corpus_is_read_or_refused_as_its_name_says() {
    for format in FORMATS {
        let reader = Reader::new(format.name);
        let seeds = files(&root().join("corpus").join(format.name));
        let count = |begin: &str| seeds.iter().filter(|path| name(path).starts_with(begin)).count();
        assert!(count("read_") > 0, "{} has a file that is read", format.name);
        for path in seeds {
            let outcome = reader.read(&std::fs::read(&path).unwrap());
            let is_right = match &outcome {
                Ok(()) => !name(&path).starts_with("refused_"),
                Err(error) => !name(&path).starts_with("read_") && !error.to_string().is_empty(),
            };
            assert!(is_right, "{path:?}: {:?}", outcome.map_err(|error| error.to_string()));
        }
    }
}

fn name(path: &std::path::Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default()
}
