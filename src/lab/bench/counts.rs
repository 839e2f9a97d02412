//! What is counted of cases and is the same on any machine, and how it is held against what it was.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use serde::Serialize;

use crate::io::input;
use crate::report::bench::{Law, Measured, Record, csv};
use crate::solve::StopReason;
use crate::{Error, Result};

/// The counts of one case; the names are those of the columns.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Counts {
    case: String,
    applications: u64,
    nonzeros: u64,
    bytes: u64,
}

const HEADER: &str = "case,applications,nonzeros,bytes";
/// The law that a case is still there.
pub(crate) const LEFT_OUT: &str = "left out, but counted before";

/// What applications may become: another machine's exponential rounds otherwise, which moves where a solve stops.
fn allowed(applications: u64) -> u64 {
    applications + 2 + applications / 20
}

/// The table of all counts that do not depend on the machine: without what an adapter's arithmetic decides, and without
/// solves that ran out of time.
pub(super) fn table(records: &[Record]) -> Result<String> {
    let same_everywhere = records.iter().filter(|record| record.backend == "cpu" && !is_cut_short(record));
    let counts: Vec<Counts> = same_everywhere.map(Counts::of).collect();
    // Such a table is kept among sources, whose lines end like this.
    Ok(if counts.is_empty() { format!("{HEADER}\n") } else { csv(&counts)?.replace("\r\n", "\n") })
}

/// Bytes of such a table at most.
const MAX_BYTES: u64 = 64 << 20;

/// Reads such a table.
///
/// Errors: [`Error::File`], and [`Error::Format`] naming the line.
pub(super) fn read(path: &Path) -> Result<Vec<Counts>> {
    let text = input::text(path, MAX_BYTES, "counts")?;
    parse(&text).map_err(|(line, problem)| Error::Format {
        path: path.to_owned(),
        format: "counts",
        reason: format!("line {line} {problem}"),
    })
}

fn parse(text: &str) -> Result<Vec<Counts>, (usize, String)> {
    let mut lines = text.lines().zip(1..);
    if lines.next().is_none_or(|(first, _)| first != HEADER) {
        return Err((1, format!("must be {HEADER}")));
    }
    let mut known = HashSet::new();
    let mut all = Vec::new();
    for (line, number) in lines {
        let counts = Counts::parse(line)
            .ok_or_else(|| (number, format!("is `{line}`; it must be a case and three whole numbers")))?;
        if !known.insert(counts.case.clone()) {
            return Err((number, format!("has the case {} a second time", counts.case)));
        }
        all.push(counts);
    }
    Ok(all)
}

impl Counts {
    fn of(record: &Record) -> Self {
        Self {
            case: record.case.clone(),
            applications: record.applications,
            nonzeros: record.nonzeros,
            bytes: record.kept_bytes,
        }
    }

    /// Names may have commas in them, numbers have none.
    fn parse(line: &str) -> Option<Self> {
        let mut fields = line.rsplitn(4, ',');
        let mut count = || fields.next()?.parse().ok();
        let [bytes, nonzeros, applications] = [count()?, count()?, count()?];
        let name = fields.next().filter(|name| !name.is_empty())?;
        let quoted = name.strip_prefix('"').and_then(|name| name.strip_suffix('"'));
        let case = quoted.map_or_else(|| name.to_owned(), |name| name.replace("\"\"", "\""));
        Some(Self { case, applications, nonzeros, bytes })
    }
}

fn is_cut_short(record: &Record) -> bool {
    record.stop.as_deref() == Some(StopReason::Time.name())
}

/// The laws of counts: none is more than it was, and what was counted still is, if the run came to its end.
pub(super) fn laws(before: &[Counts], records: &[Record], complete: bool) -> Vec<Law> {
    let records: HashMap<&str, &Record> =
        records.iter().map(|record| (record.case.as_str(), record)).collect();
    let of = |before: &Counts| match records.get(before.case.as_str()) {
        Some(record) => of_case(before, record),
        None if complete => vec![law(&before.case, LEFT_OUT, None, 1, 0)],
        None => Vec::new(),
    };
    before.iter().flat_map(of).collect()
}

fn of_case(before: &Counts, record: &Record) -> Vec<Law> {
    let now = Counts::of(record);
    let mut laws = vec![
        law(&now.case, "non-zeros", Some(before.nonzeros), now.nonzeros, before.nonzeros),
        law(&now.case, "bytes of kept rows", Some(before.bytes), now.bytes, before.bytes),
    ];
    let most = allowed(before.applications);
    // A solve that ran out of time would have gone on; only what it has done already counts against it.
    if record.measured == Measured::Solve && (!is_cut_short(record) || now.applications > most) {
        laws.push(law(&now.case, "operator applications", Some(before.applications), now.applications, most));
    }
    laws
}

fn law(case: &str, law: &'static str, before: Option<u64>, now: u64, most: u64) -> Law {
    let (error, bound) = (now as f64, most as f64);
    Law { case: case.to_owned(), law, error, bound, before, holds: now <= most }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_commas_and_quotes_come_back() {
        let counts = |case: &str| Counts { case: case.into(), applications: 1, nonzeros: 2, bytes: 3 };
        let all = ["hall/a 1e-3/cpu", "a, b/c", "\"a\", \"\"/c", "\"", "a,1"].map(counts);
        assert_eq!(parse(&csv(&all).unwrap()).unwrap(), all);
        assert_eq!(parse(&format!("{HEADER}\n")).unwrap(), []);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, line) in [
            ("", 1),
            ("case,bytes\na,1,2,3", 1),
            ("case,applications,nonzeros,bytes\na,1,2,3\n\n", 3),
            ("case,applications,nonzeros,bytes\na,1,2,3\nb,1,2", 3),
            ("case,applications,nonzeros,bytes\na,1,2,-3", 2),
            ("case,applications,nonzeros,bytes\n,1,2,3", 2),
            ("case,applications,nonzeros,bytes\na,1,2,3\na,1,2,3", 3),
        ] {
            assert_eq!(parse(text).unwrap_err().0, line, "{text}");
        }
    }
}
