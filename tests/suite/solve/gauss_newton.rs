//! Gauss–Newton on a curve whose parameter is known.

use unscatter::Result;
use unscatter::solve::{Control, GaussNewton, Looked, NonLinear, Taken, gauss_newton};

/// Which k fits exp(−k t) to what was measured at some t.
struct Decay {
    k: f64,
    looked: f64,
    measured: Vec<(f64, f64)>,
    told: Vec<Taken>,
    /// Whether every step is taken whole, whatever comes of it.
    blindly: bool,
    /// A distance below which it knows all that is left to be noise.
    noise: f64,
}

impl Decay {
    fn of(truth: f64, k: f64) -> Self {
        let measured = (1..=20).map(|i| 0.2 * f64::from(i)).map(|t| (t, (-truth * t).exp())).collect();
        Self { k, looked: k, measured, told: Vec::new(), blindly: false, noise: 0.0 }
    }

    fn distance_at(&self, k: f64) -> f64 {
        self.measured.iter().map(|(t, y)| ((-k * t).exp() - y).powi(2)).sum::<f64>().sqrt()
    }
}

impl NonLinear for Decay {
    type Step = f64;

    fn distance(&self) -> f64 {
        self.distance_at(self.k)
    }

    fn step(&mut self) -> Result<f64> {
        // min over d of Σ (f + f' d − y)², f = exp(−k t), f' = −t f.
        let (mut num, mut den) = (0.0, 0.0);
        for &(t, y) in &self.measured {
            let f = (-self.k * t).exp();
            num += -t * f * (y - f);
            den += (t * f).powi(2);
        }
        Ok(num / den)
    }

    fn look(&mut self, step: &f64, share: f32) -> Result<Looked> {
        self.looked = self.k + f64::from(share) * step;
        let is_nearer = self.blindly || self.distance_at(self.looked) < self.distance();
        Ok(match is_nearer {
            true if self.distance() < self.noise => Looked::NearerToNoise,
            true => Looked::Nearer,
            false => Looked::Farther,
        })
    }

    fn take(&mut self, _step: &f64) {
        self.k = self.looked;
    }

    fn told(&mut self, _step: f64, taken: Taken) -> Result<Control> {
        self.told.push(taken);
        Ok(Control::Continue)
    }
}

const SETTINGS: GaussNewton = GaussNewton { steps: 60, least_gain: 1e-9, tries: 20 };

#[test]
fn it_falls_in_every_step_and_ends_at_the_parameter() {
    for start in [0.05, 0.5, 4.0] {
        let mut decay = Decay::of(1.3, start);
        gauss_newton(&mut decay, &SETTINGS).unwrap();
        assert!((decay.k - 1.3).abs() < 1e-9, "from {start}: {}", decay.k);
        let falls = |taken: &Taken| taken.share.is_none() || taken.distance[1] < taken.distance[0];
        assert!(decay.told.iter().all(falls), "{:?}", decay.told);
        assert!(decay.told.windows(2).all(|pair| pair[1].number == pair[0].number + 1));
    }
    // From far away whole steps lead astray, and are halved; who takes them blindly never arrives.
    let far = |blindly| {
        let mut decay = Decay { blindly, ..Decay::of(1.3, 4.0) };
        gauss_newton(&mut decay, &SETTINGS).unwrap();
        decay
    };
    assert!(far(false).told.iter().any(|taken| taken.share.is_some_and(|share| share < 1.0)));
    let astray = far(true);
    assert!((astray.k - 1.3).abs() > 1e-3, "{}", astray.k);
}

#[test]
fn it_ends_where_no_step_helps_and_when_it_is_stopped() {
    let mut there = Decay::of(1.3, 1.3);
    gauss_newton(&mut there, &SETTINGS).unwrap();
    assert_eq!((there.told.len(), there.k), (1, 1.3));
    let mut few = Decay::of(1.3, 0.05);
    gauss_newton(&mut few, &GaussNewton { steps: 2, ..SETTINGS }).unwrap();
    assert_eq!(few.told.len(), 2);
}

#[test]
fn a_step_towards_noise_is_not_taken_and_is_the_last() {
    let mut decay = Decay { noise: 0.05, ..Decay::of(1.3, 0.5) };
    gauss_newton(&mut decay, &SETTINGS).unwrap();
    let [.., before, last] = &decay.told[..] else { panic!("{:?}", decay.told) };
    assert_eq!(last.share, None);
    assert!(before.share.is_some() && before.distance[1] < 0.05 && before.distance[0] >= 0.05, "{before:?}");
    assert_eq!(last.distance, [before.distance[1]; 2]);
}
