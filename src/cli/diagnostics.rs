use miette::{LabeledSpan, MietteDiagnostic, NamedSource, Report, SourceOffset};

use crate::{Error, Fault};

/// Bytes of a line that a person can still read; longer ones are written by programs, and a column says more than they do.
const READABLE: usize = 200;

/// Shows an error on standard error; one inside a scene file with the lines around it.
pub(super) fn show(error: &Error) {
    let report = match error {
        Error::Scene { file, line, column, path, problem, suggestion } => {
            let help = suggestion.as_ref().map(|name| format!("did you mean `{name}`?"));
            in_file(file, *line, *column, format!("{file}:{line}:{column}: {path}: {problem}"), help)
        }
        other => Report::msg(match other.fault() {
            Fault::Machine => format!("this machine cannot do it: {other}"),
            Fault::Input => other.to_string(),
        }),
    };
    eprint_report(&report);
}

#[allow(clippy::print_stderr, reason = "this is where errors are shown")]
fn eprint_report(report: &Report) {
    eprintln!("{report:?}");
}

fn in_file(file: &str, line: usize, column: usize, message: String, help: Option<String>) -> Report {
    let mut diagnostic = MietteDiagnostic::new(message);
    diagnostic.help = help;
    let Ok(text) = std::fs::read_to_string(file) else { return Report::new(diagnostic) };
    let mut around = text.lines().skip(line.saturating_sub(2)).take(3);
    if around.any(|line| line.len() > READABLE) {
        return Report::new(diagnostic);
    }
    let offset = SourceOffset::from_location(&text, line, column);
    diagnostic.labels = Some(vec![LabeledSpan::at_offset(offset.offset(), "here")]);
    Report::new(diagnostic).with_source_code(NamedSource::new(file, text))
}
