//! What a person should know although it is no error.

use std::cell::RefCell;

use serde::{Deserialize, Serialize};

/// Something that a person should know, and what can be done about it.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Warning {
    /// Names its kind, for programs, such as `stroke-in-shadow`; docs/guide.md lists them.
    pub code: String,
    /// What is so, as a sentence without its end.
    pub text: String,
    /// What to do, in the imperative; empty where nothing helps or nothing is needed.
    pub remedy: String,
}

impl Warning {
    /// A warning of a kind.
    pub fn new(code: &str, text: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { code: code.to_owned(), text: text.into(), remedy: remedy.into() }
    }

    /// Says it to whoever listens to `tracing`, and to whoever collects warnings on this thread. Within one collection nothing is said twice.
    pub fn tell(self) {
        let is_new = COLLECTED.with_borrow_mut(|lists| match lists.last_mut() {
            Some(list) if list.contains(&self) => false,
            Some(list) => {
                list.push(self.clone());
                true
            }
            None => true,
        });
        if is_new {
            tracing::warn!("{self}");
        }
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.remedy.is_empty() {
            true => f.write_str(&self.text),
            false => write!(f, "{} ({})", self.text, self.remedy),
        }
    }
}

thread_local! {
    /// A list for each collection that goes on on this thread.
    static COLLECTED: RefCell<Vec<Vec<Warning>>> = const { RefCell::new(Vec::new()) };
}

/// Takes its list away, also where what is collected from panics.
struct Collection;

impl Drop for Collection {
    fn drop(&mut self) {
        COLLECTED.with_borrow_mut(|lists| _ = lists.pop());
    }
}

/// What a function gives, and what is told on this thread while it runs.
pub(crate) fn collected<T>(run: impl FnOnce() -> T) -> (T, Vec<Warning>) {
    COLLECTED.with_borrow_mut(|lists| lists.push(Vec::new()));
    let _collection = Collection;
    let given = run();
    let told = COLLECTED.with_borrow_mut(|lists| lists.last_mut().map(std::mem::take).unwrap_or_default());
    (given, told)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_is_collected_once_and_by_the_innermost() {
        let tell = |text: &str| Warning::new("test", text, "").tell();
        let ((_, inner), outer) = collected(|| {
            tell("a");
            tell("a");
            let inner = collected(|| tell("b"));
            tell("c");
            inner
        });
        let texts = |told: Vec<Warning>| told.into_iter().map(|it| it.text).collect::<String>();
        assert_eq!((texts(outer).as_str(), texts(inner).as_str()), ("ac", "b"));
        tell("nobody collects this");
        assert!(collected(|| ()).1.is_empty());
    }

    #[test]
    fn a_panic_ends_a_collection() {
        let caught = std::panic::catch_unwind(|| collected(|| -> () { panic!("as it must") }));
        assert!(caught.is_err());
        COLLECTED.with_borrow(|lists| assert!(lists.is_empty()));
    }
}
