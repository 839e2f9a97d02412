use super::data::{
    Certificate, Change, Coverage, HueAngles, LightRecord, ProblemSize, Report, RowStrategy, Share,
    StopRecord, ViewMatch, WishShares, Work,
};
use crate::Warning;
use crate::problem::{Nouns, RegularizationWeights};
use crate::solve::Progress;

/// A filled report of an invented solve, for tests, examples and the documentation.
///
/// It has three views (`front`, `aisle`, `window`), and the same numbers every time.
pub fn example() -> Report {
    Report {
        surroundings: None,
        warnings: vec![Warning::new(
            "stroke-in-shadow",
            "strokes[3] of view `aisle` lies in shadow: no light reaches any of its 212 pixels",
            "paint where light is seen, or take it away",
        )],
        hue: Some(HueAngles { median: 3.1, nine_tenths: 11.32 }),
        light: Some(LightRecord { brightest: 1.0, outside: 0.012, held_back: 0.002 }),
        out_of_reach: WishShares::default(),
        stages: Vec::new(),
        animation: None,
        version: env!("CARGO_PKG_VERSION").into(),
        command: "light-map".into(),
        scene: "chapel".into(),
        backend: "cpu".into(),
        device: "8 threads".into(),
        gpu: Some(Work {
            round_trips: 61,
            round_trips_an_iteration: Some(1.0),
            dispatches: 2_314,
            bytes: 64 << 20,
            deterministic: true,
        }),
        target: "tint".into(),
        solver: "fista".into(),
        strategy: RowStrategy { name: "mixed".into(), kept_rows: 38_912, walked_rows: 2_326 },
        nouns: Nouns { found: "light map".into(), pixel: "painted pixel".into(), wanted: "paint".into() },
        problem: ProblemSize {
            elements: "texels".into(),
            rows: 41_238,
            unknowns: 262_144,
            active_unknowns: 148_377,
            nonzeros: 11_640_213,
            views: 3,
            size: vec![512, 512],
        },
        regularization: RegularizationWeights { tikhonov: f64::powi(2.0, -9), laplacian: 0.0, gradient: 0.0 },
        settings: named([
            ("basis", "bilinear".to_string()),
            ("quadrature", "exact, cell by cell".to_string()),
            ("iterations", "at most 32".to_string()),
            ("tolerance", "0.001".to_string()),
            ("transmittance_bound", "6e-8".to_string()),
        ]),
        history: (0..=18).map(step).collect(),
        stop: StopRecord { reason: "tolerance".into(), iteration: 18 },
        certificate: Certificate {
            kind: "projected-gradient".into(),
            value: [9.1e-4, 7.4e-4, 8.8e-4],
            residual: [0.094, 0.081, 0.069],
            at_bounds: 61_204,
            restarts: 0,
        },
        set_up_applications: 4,
        weighted_residual: Change { before: 0.823, after: 0.0812 },
        matched: views(),
        timings: named([
            ("read", 0.031),
            ("shadow_map", 0.118),
            ("rays", 0.204),
            ("assemble", 0.297),
            ("solve", 0.422),
            ("pictures", 0.163),
            ("total", 1.241),
        ]),
        memory: named([
            ("matrix", 93_121_704),
            ("geometry", 18_450_112),
            ("shadow_map", 4_194_304),
            ("vectors", 12_870_016),
            ("pictures", 24_883_200),
            ("peak", 156_237_824),
            ("budget", 6_442_450_944),
        ]),
        skipped: named([
            ("pixels", Share { count: 2_723_562, of: 2_764_800 }),
            ("unknowns", Share { count: 113_767, of: 262_144 }),
            ("shadowed_cells", Share { count: 9_102_345, of: 24_518_002 }),
            ("dark_rays", Share { count: 2_311, of: 41_238 }),
            ("channel_iterations", Share { count: 5, of: 54 }),
            ("walks", Share { count: 1_478_656, of: 1_567_044 }),
        ]),
        adjoint_error: 2.4e-8,
        coverage: Coverage {
            elements: "texels".into(),
            reached: 148_377,
            total: 262_144,
            unreached: 113_767,
            joined: Some(20_511),
            filled: None,
            weak: Some(9_214),
        },
    }
}

fn views() -> Vec<ViewMatch> {
    let view = |name: &str, pixels, uncontested, residual: [f64; 2], hue: [f64; 2], agreed: [f64; 2]| {
        let change = |[before, after]: [f64; 2]| Change { before, after };
        ViewMatch {
            view: name.into(),
            painted_pixels: pixels,
            hue: Some(HueAngles { median: agreed[1], nine_tenths: 2.0 * hue[1] }),
            weighted_residual: change(residual),
            hue_error: Some(change(hue)),
            uncontested_hue_error: Some(change(agreed)),
            uncontested_pixels: Some(uncontested),
        }
    };
    vec![
        view("front", 21_004, 19_870, [0.841, 0.071], [71.2, 4.8], [70.9, 2.1]),
        view("aisle", 12_733, 11_015, [0.797, 0.094], [58.4, 8.3], [57.7, 3.4]),
        view("window", 7_501, 7_402, [0.812, 0.083], [64.0, 6.1], [63.8, 5.7]),
    ]
}

/// A residual that falls to where the strokes contradict each other, and a gradient that goes on falling,
/// not quite evenly, as that of conjugate gradients does.
fn step(iteration: usize) -> Progress {
    let k = iteration as f64;
    let channel = |floor: f64, rate: f64| floor + (1.0 - floor) * (-rate * k).exp();
    let wave = |rate: f64, phase: f64| (-rate * k + 0.35 * ((1.7 * k + phase).sin() - phase.sin())).exp();
    Progress {
        held_out: None,
        iteration,
        seconds: 0.022 * k,
        operator_applications: 2 * iteration + 1,
        residual: [channel(0.094, 0.62), channel(0.081, 0.71), channel(0.069, 0.55)],
        normal_residual: [wave(0.39, 0.0), wave(0.42, 1.0), wave(0.45, 2.0)],
    }
}

fn named<T, const N: usize>(entries: [(&str, T); N]) -> std::collections::BTreeMap<String, T> {
    entries.into_iter().map(|(name, value)| (name.to_string(), value)).collect()
}
