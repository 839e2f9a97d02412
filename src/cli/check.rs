use super::args::CheckArguments;
use super::bar::Bar;
use super::{Done, Manners};
use crate::Result;
use crate::io::to_json;
use crate::lab::check::{Checked, CheckedLaw, check};

/// `unscatter check`: the adjoint test, every way of applying T against the explicit matrix, finite differences.
pub(super) fn run(arguments: &CheckArguments, manners: &Manners) -> Result<Done> {
    let mut bar = Bar::new(manners.quiet);
    let job = arguments.scene.open(&[])?;
    let all = check(&job, &arguments.backend.choice(), &mut bar)?;
    bar.finish();
    let verdicts: Vec<&CheckedLaw> = all.iter().flat_map(|checked| &checked.verdicts).collect();
    let lines: Vec<String> = all.iter().flat_map(lines).collect();
    manners.print(&to_json(&verdicts)?, &lines.join("\n"))?;
    Ok(if verdicts.iter().all(|verdict| verdict.holds) { Done::Completely } else { Done::Broken })
}

fn lines(Checked { name, rows, nonzeros, verdicts }: &Checked) -> Vec<String> {
    let line = |CheckedLaw { law, backend, error, bound, holds }: &CheckedLaw| {
        let mark = if *holds { "holds" } else { "BROKEN" };
        format!("  {mark:6}  {law:34} {backend:22} {error:8.1e}  (at most {bound:.0e})")
    };
    let head = format!("{name}: {rows} rows, {nonzeros} non-zeros");
    std::iter::once(head).chain(verdicts.iter().map(line)).collect()
}
