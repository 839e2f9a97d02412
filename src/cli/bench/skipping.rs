//! What is saved by what is skipped, and what it changes.

use super::measure::Patience;
use super::reference::{Sample, relative};
use super::subject::Problem;
use crate::Result;
use crate::cli::check::AGAINST_EXPLICIT;
use crate::march::Quantity;
use crate::operator::{CpuVector, LinearOperator, Vector};
use crate::problem::{TransportOperator, VolumeRows};
use crate::report::bench::{Pair, Skipped};
use crate::scene::{Quadrature, Strategy};

/// What is skipped and can be switched off: walks of rows that are kept, and the far ends of rays.
pub(super) fn skipped(patience: Patience, scene: &str, sample: &Sample) -> Result<Vec<Skipped>> {
    let mut all = vec![kept_rows(patience, scene, &sample.problem)?];
    all.extend(far_ends(patience, scene, &sample.problem)?);
    Ok(all)
}

/// Geometry and visibility, once and not in every application.
fn kept_rows(patience: Patience, scene: &str, problem: &Problem) -> Result<Skipped> {
    let kept = cost(patience, || problem.wide(Strategy::Assembled))?;
    let walked = cost(patience, || problem.wide(Strategy::MatrixFree))?;
    Ok(Skipped {
        scene: scene.to_owned(),
        what: "walks of rows that are kept".to_owned(),
        switch: "solve.strategy=matrix-free".to_owned(),
        unit: "walks a product".to_owned(),
        work: Pair { with: 0.0, without: problem.len() as f64 },
        seconds: Pair { with: kept.seconds, without: walked.seconds },
        difference: relative(kept.shown.0, &walked.shown)?,
        bound: AGAINST_EXPLICIT,
    })
}

/// The rest of a ray beyond the transmittance bound; none where what that can change is not known.
fn far_ends(patience: Patience, scene: &str, problem: &Problem) -> Result<Option<Skipped>> {
    // Of a row no more is left than the bound times this, for light of 1 everywhere.
    let (bound, scattering) = match problem {
        Problem::LightMap(problem) => {
            let most = |row: &crate::march::ViewRay| row.scattering.iter().copied().fold(0.0, f64::max);
            let all = problem.traversal.rays().iter().map(|row| most(row).powi(2)).sum::<f64>();
            (problem.traversal.transport().transmittance_bound, all.sqrt())
        }
        Problem::Volume(_, problem) => match &problem.traversal {
            VolumeRows::Voxels(rows)
                if rows.parts().iter().all(|part| matches!(part.quantity, Quantity::Emission)) =>
            {
                (rows.transport().transmittance_bound, (problem.targets.len() as f64).sqrt())
            }
            _ => return Ok(None),
        },
    };
    let whole = problem.walked(Quadrature::Exact, Some(f64::MIN_POSITIVE));
    let Some(mut whole) = whole else { return Ok(None) };
    whole.replan();
    let cut = cost(patience, || problem.wide(Strategy::MatrixFree))?;
    let uncut = cost(patience, || whole.wide(Strategy::MatrixFree))?;
    let norm = uncut.shown.norm_squared()?.iter().sum::<f64>().sqrt();
    Ok(Some(Skipped {
        scene: scene.to_owned(),
        what: "far ends of rays".to_owned(),
        switch: "solve.transmittance_bound=1e-300".to_owned(),
        unit: "non-zeros".to_owned(),
        work: Pair { with: problem.plan().nonzeros as f64, without: whole.plan().nonzeros as f64 },
        seconds: Pair { with: cut.seconds, without: uncut.seconds },
        difference: relative(cut.shown.0, &uncut.shown)?,
        // Each of the three channels may lose as much; rounding may add to it.
        bound: 3f64.sqrt() * bound * scattering / norm.max(f64::MIN_POSITIVE) + 1e-12,
    }))
}

struct Cost {
    /// T 1.
    shown: CpuVector<f64>,
    seconds: f64,
}

fn cost<O>(patience: Patience, make: impl Fn() -> Result<O>) -> Result<Cost>
where
    O: TransportOperator<Vector = CpuVector<f64>>
        + LinearOperator<Domain = CpuVector<f64>, Range = CpuVector<f64>>,
{
    let (operator, times) = patience.times(make)?;
    let (mut x, mut shown) = (operator.domain(), operator.range());
    x.fill([1.0; 3]);
    operator.apply(&x, &mut shown)?;
    Ok(Cost { shown, seconds: times.forward + times.backward })
}
