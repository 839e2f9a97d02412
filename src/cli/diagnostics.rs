use std::io::Write;

use miette::{LabeledSpan, MietteDiagnostic, NamedSource, Report, SourceOffset};

use super::out::{self, visible};
use crate::{Error, Fault};

/// What the library calls settings, and what the command says in its place.
const FLAGS: [(&str, &str); 10] = [
    ("set `", "use --set `"),
    ("raise solve.memory", "raise --memory"),
    ("compute on the processor", "use --backend cpu"),
    ("choose an adapter", "choose one by --backend gpu or --adapter"),
    ("name a software adapter", "name a software adapter with --adapter"),
    ("leave rasterize away", "leave --rasterize away"),
    ("leave resume away", "leave --resume away"),
    ("without resume", "without --resume"),
    ("resume continues", "--resume continues"),
    ("set by an override", "set by --set"),
];

/// Settings whose values may be refused, and their flags.
const VALUES: [(&str, &str); 4] =
    [("adapter", "--adapter"), ("frames", "--frames"), ("resume", "--resume"), ("override", "--set")];

/// What the library says, with the flags of its settings.
fn in_flags(text: &str) -> String {
    FLAGS.iter().fold(text.to_owned(), |text, (setting, flag)| text.replace(setting, flag))
}

/// Standard error, for warnings: each is written whole, after what each begins with.
pub(super) struct Warnings(pub(super) &'static str);

impl Write for Warnings {
    fn write(&mut self, warning: &[u8]) -> std::io::Result<usize> {
        out::remark(&visible(&format!(
            "{}{}",
            self.0,
            in_flags(String::from_utf8_lossy(warning).trim_start())
        )));
        Ok(warning.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Shows an error on standard error; one inside a scene file with the lines around it.
pub(super) fn show(error: &Error) {
    let report = match error {
        Error::Scene { file, line, column, path, problem, suggestion, excerpt } => {
            let help = suggestion.as_ref().map(|name| format!("did you mean `{name}`?"));
            let message = format!("{file}:{line}:{column}: {path}: {}", in_flags(problem));
            let mut diagnostic = MietteDiagnostic::new(visible(&message));
            diagnostic.help = help.map(|help| visible(&help).into_owned());
            in_file(diagnostic, &visible(file), &visible(excerpt), *line, *column)
        }
        Error::Value { path, value, expected } => {
            let flag =
                VALUES.iter().find(|(setting, _)| setting == path).map_or(path.as_str(), |(_, flag)| *flag);
            Report::msg(visible(&Error::value(flag, value, expected).to_string()).into_owned())
        }
        other => {
            let told = match other.fault() {
                Fault::Machine => format!("this machine cannot do it: {other}"),
                Fault::Input => other.to_string(),
            };
            Report::msg(visible(&in_flags(&told)).into_owned())
        }
    };
    out::remark(&format!("{report:?}\n"));
}

/// The message with the lines of a file that it is about.
fn in_file(
    mut diagnostic: MietteDiagnostic,
    file: &str,
    excerpt: &str,
    line: usize,
    column: usize,
) -> Report {
    if excerpt.is_empty() {
        return Report::new(diagnostic);
    }
    // What is not there are empty lines, so that those that are have their numbers.
    let text = "\n".repeat(line.saturating_sub(2)) + excerpt;
    let offset = SourceOffset::from_location(&text, line, column);
    diagnostic.labels = Some(vec![LabeledSpan::at_offset(offset.offset(), "here")]);
    Report::new(diagnostic).with_source_code(NamedSource::new(file, text))
}
