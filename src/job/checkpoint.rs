//! Checkpoints: what a solve goes on from.

use std::cell::Cell;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::folder::Folder;
use crate::io::Checkpoint;
use crate::problem::{Paused, Problem, Snapshot, evenly};
use crate::scene::SolveSettings;
use crate::solve::{History, Measure, Progress, Progressing, State};
use crate::{Error, Result, Warning};

/// Numbers of one entry of the history.
const ENTRY: usize = 10;
/// Rows that tell one T from another.
const ROWS: usize = 1024;

/// Keeps a solve in the checkpoint of its output folder.
#[derive(Debug)]
pub(super) struct Keeper {
    path: PathBuf,
    /// Where the last one is made, to be published with the results.
    last: PathBuf,
    fingerprint: u64,
    /// Whether this run has written it.
    kept: Cell<bool>,
}

impl Keeper {
    /// Keeps the solve of a problem in a file called `name`.
    pub(super) fn new(
        folder: &Folder,
        name: &str,
        settings: &SolveSettings,
        problem: &dyn Problem,
    ) -> Result<Self> {
        let (path, last) = (folder.path().join(name), folder.file(name));
        Ok(Self { path, last, fingerprint: fingerprint(settings, problem)?, kept: Cell::new(false) })
    }

    /// Writes the checkpoint where [`Keeper::read`] finds it; a failure is no reason to lose the solve.
    pub(super) fn keep(&self, history: &History, snapshot: &mut dyn Snapshot) {
        match self.write(&self.path, history, snapshot) {
            Ok(()) => self.kept.set(true),
            Err(error) => Warning::new("checkpoint", format!("no checkpoint: {error}"), "").tell(),
        }
    }

    /// What this run has kept last, if anything.
    #[cfg(feature = "gpu")]
    pub(super) fn latest(&self) -> Option<Paused> {
        self.kept.get().then(|| self.read().ok()).flatten()
    }

    /// Writes the checkpoint of a solve that has ended among the results.
    pub(super) fn finish(&self, history: &History, snapshot: &mut dyn Snapshot) -> Result<()> {
        self.write(&self.last, history, snapshot)
    }

    fn write(&self, path: &Path, history: &History, snapshot: &mut dyn Snapshot) -> Result<()> {
        let [r, s] = [history.start.residual, history.start.normal_residual];
        let settled = history.settled.map(|settled| f64::from(u8::from(settled)));
        let Progressing { least, residual, without } = history.progressing;
        let counts = [history.restarts, history.spared, without].map(|count| count as f64);
        let start = [r, s, counts, settled, residual, [history.least_true, least, 0.0]].concat();
        let entries = history.progress.iter().flat_map(|entry| {
            let [r, s] = [entry.residual, entry.normal_residual];
            let counts = [entry.iteration as f64, entry.seconds, entry.operator_applications as f64];
            [&counts[..], &r, &s, &[entry.held_out.unwrap_or(f64::NAN)]].concat()
        });
        let (vectors, scalars) = snapshot.outline();
        let blocks: [Vec<f64>; 3] = [start, entries.collect(), scalars];
        let lengths = blocks.iter().map(Vec::len).chain(vectors.iter().map(|colors| 3 * colors));
        Checkpoint::write(path, self.fingerprint, &lengths.collect::<Vec<_>>(), |put| {
            blocks.iter().try_for_each(|block| put(block))?;
            snapshot.hand_out(&mut |vector| put(vector.as_flattened()))
        })
    }

    /// What a solve goes on from; where others were solved before, it may have come to nothing yet.
    pub(super) fn resumed(&self, is_later: bool) -> Result<Option<Paused>> {
        match self.read() {
            Err(Error::File { source, .. }) if is_later && source.kind() == ErrorKind::NotFound => Ok(None),
            read => read.map(Some),
        }
    }

    pub(super) fn read(&self) -> Result<Paused> {
        let wrong = || Error::Checkpoint { path: self.path.clone(), reason: "it is incomplete".to_owned() };
        let checkpoint = Checkpoint::read(&self.path, self.fingerprint)?;
        let [start, entries, scalars, vectors @ ..] = &checkpoint.blocks[..] else { return Err(wrong()) };
        if !vectors.iter().flatten().all(|number| number.is_finite()) {
            let reason = "it holds something that is not a number".to_owned();
            return Err(Error::Checkpoint { path: self.path.clone(), reason });
        }
        let ([r, s, counts, settled, residual, [least_true, least, _]], []) = start.as_chunks::<3>() else {
            return Err(wrong());
        };
        let (entries, rest) = entries.as_chunks::<ENTRY>();
        if entries.is_empty() || !rest.is_empty() {
            return Err(wrong());
        }
        let progress =
            entries.iter().map(|&[iteration, seconds, applications, r0, r1, r2, s0, s1, s2, held_out]| {
                Progress {
                    iteration: iteration as usize,
                    seconds,
                    operator_applications: applications as usize,
                    residual: [r0, r1, r2],
                    normal_residual: [s0, s1, s2],
                    held_out: Some(held_out).filter(|held_out| !held_out.is_nan()),
                }
            });
        let [restarts, spared, without] = counts.map(|count| count as usize);
        let history = History {
            progress: progress.collect(),
            start: Measure { residual: *r, normal_residual: *s },
            restarts,
            least_true: *least_true,
            settled: settled.map(|settled| settled != 0.0),
            spared,
            progressing: Progressing { least: *least, residual: *residual, without },
        };
        let vectors = vectors.iter().map(|vector| vector.as_chunks::<3>().0.to_vec()).collect();
        Ok(Paused { history, state: State { vectors, scalars: scalars.clone() } })
    }
}

/// A hash of everything that the path of a solve depends on; limits may change between its parts.
fn fingerprint(settings: &SolveSettings, problem: &dyn Problem) -> Result<u64> {
    let mut hash = Mixed(0);
    let formulation = problem.formulation(settings)?;
    let parts = formulation.parts.iter().map(|part| {
        let size = part.lattice.map(|lattice| lattice.size);
        format!("{} {} {:?} {} {size:?} {}", part.noun, part.start.len(), part.bounds, part.pull, part.scale)
    });
    let words = format!(
        "{:?} {:?} {:?} {:?} {:?} {:?} {} {} {:?} {:?}",
        settings.solver,
        settings.metric,
        settings.basis,
        settings.quadrature,
        settings.regularization,
        settings.strategy,
        settings.accuracy,
        settings.transmittance_bound,
        settings.skip,
        parts.collect::<Vec<_>>(),
    );
    words.bytes().for_each(|byte| hash.add(byte.into()));
    problem.digest(&mut |word| hash.add(word));
    for colors in [problem.targets(), &formulation.weights, &formulation.starts()] {
        colors.iter().flatten().for_each(|number| hash.add(number.to_bits().into()));
    }
    // Whatever else T depends on, such as the light, is in its rows.
    for row in evenly(ROWS, problem.rows()) {
        problem.row(row, &mut |element, weights| {
            hash.add(element as u64);
            weights.iter().for_each(|weight| hash.add(weight.to_bits()));
        });
    }
    Ok(hash.0)
}

/// FxHash: a rotation, so that two flips of a sign do not undo each other, and a multiplication a word.
struct Mixed(u64);

impl Mixed {
    fn add(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x517c_c1b7_2722_0a95);
    }
}
