//! LSMR: least squares by Golub–Kahan bidiagonalization, minimizing the normal residual.
//!
//! Problem       min ½‖A x − b‖².
//! Equivalences  In exact arithmetic the iterates are those of MINRES on Aᵀ A x = Aᵀ b.
//! Caveats       ‖Aᵀ (b − A x)‖ falls monotonically, so it can be stopped early with less harm than LSQR; ‖b − A x‖ does
//!               too, a little later than LSQR's. Elements outside the row space keep their start.
//! Source        Fong and Saunders 2011, algorithm 1, ‖r‖ by sec. 3.

use super::bidiagonal::Bidiagonal;
use super::{LeastSquares, Live, Measure, Method, MethodMemory, Vectors, each, ratio};
use crate::Result;
use crate::operator::{LinearOperator, Scalars, Vector};

/// Least squares by bidiagonalization, with the normal residual falling monotonically.
#[derive(Debug)]
pub struct Lsmr<O: LinearOperator> {
    bidiagonal: Bidiagonal<O>,
    x: O::Domain,
    h: O::Domain,
    h_bar: O::Domain,
    recurrence: Recurrence,
    measure: Measure,
}

/// The scalars that go on from one iteration to the next, named as in the paper.
#[derive(Debug, Default)]
struct Recurrence {
    alpha_bar: Scalars,
    zeta_bar: Scalars,
    rho: Scalars,
    rho_bar: Scalars,
    cos_bar: Scalars,
    sin_bar: Scalars,
    zeta: Scalars,
    beta_double_dot: Scalars,
    beta_dot: Scalars,
    rho_dot: Scalars,
    tau_tilde: Scalars,
    theta_tilde: Scalars,
}

impl<O: LinearOperator> Lsmr<O> {
    /// The vectors that it keeps.
    pub const VECTORS: Vectors = Vectors { domain: 5, range: 2 };

    /// The method for problems of this operator's shape.
    pub fn new(operator: &O) -> Self {
        Self {
            bidiagonal: Bidiagonal::new(operator),
            x: operator.domain(),
            h: operator.domain(),
            h_bar: operator.domain(),
            recurrence: Recurrence::default(),
            measure: Measure { residual: [0.0; 3], normal_residual: [0.0; 3] },
        }
    }
}

impl Recurrence {
    fn begin(alpha: Scalars, beta: Scalars) -> Self {
        Self {
            alpha_bar: alpha,
            zeta_bar: each(|c| alpha[c] * beta[c]),
            rho: [1.0; 3],
            rho_bar: [1.0; 3],
            cos_bar: [1.0; 3],
            beta_double_dot: beta,
            rho_dot: [1.0; 3],
            ..Self::default()
        }
    }

    /// ‖b − A x‖² of one channel (Fong and Saunders, sec. 3).
    fn residual(&mut self, c: usize, [cos, sin]: [f64; 2], theta_bar: f64, zeta_old: f64) -> f64 {
        let beta_hat = cos * self.beta_double_dot[c];
        self.beta_double_dot[c] *= -sin;
        let theta_tilde_old = self.theta_tilde[c];
        let (cos_tilde, sin_tilde, rho_tilde) = rotation(self.rho_dot[c], theta_bar);
        self.theta_tilde[c] = sin_tilde * self.rho_bar[c];
        self.rho_dot[c] = cos_tilde * self.rho_bar[c];
        self.beta_dot[c] = cos_tilde * beta_hat - sin_tilde * self.beta_dot[c];
        self.tau_tilde[c] = over(zeta_old - theta_tilde_old * self.tau_tilde[c], rho_tilde);
        let tau_dot = over(self.zeta[c] - self.theta_tilde[c] * self.tau_tilde[c], self.rho_dot[c]);
        (self.beta_dot[c] - tau_dot).powi(2) + self.beta_double_dot[c].powi(2)
    }
}

impl<O: LinearOperator> Method<O> for Lsmr<O> {
    fn name(&self) -> &'static str {
        "lsmr"
    }

    fn keeps_bounds(&self) -> bool {
        false
    }

    fn vectors(&self) -> Vectors {
        Self::VECTORS
    }

    fn begin(&mut self, problem: &LeastSquares<O>, x: &O::Domain) -> Result<()> {
        self.x.copy_from(x);
        self.bidiagonal.begin(problem, &self.x)?;
        let Bidiagonal { alpha, beta, v, .. } = &self.bidiagonal;
        self.h.copy_from(v);
        self.h_bar.fill([0.0; 3]);
        self.recurrence = Recurrence::begin(*alpha, *beta);
        self.measure = Measure {
            residual: beta.map(|beta| beta * beta),
            normal_residual: self.recurrence.zeta_bar.map(|zeta| zeta * zeta),
        };
        Ok(())
    }

    fn step(&mut self, problem: &LeastSquares<O>, live: Live) -> Result<()> {
        self.bidiagonal.step(problem)?;
        let Bidiagonal { alpha, beta, v, .. } = &self.bidiagonal;
        let now = &mut self.recurrence;
        let (mut of_h_bar, mut of_x, mut of_h) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for c in (0..3).filter(|&c| live[c]) {
            let (rho_old, rho_bar_old, zeta_old) = (now.rho[c], now.rho_bar[c], now.zeta[c]);
            let (cos, sin, rho) = rotation(now.alpha_bar[c], beta[c]);
            let theta = sin * alpha[c];
            now.alpha_bar[c] = cos * alpha[c];
            let theta_bar = now.sin_bar[c] * rho;
            let (cos_bar, sin_bar, rho_bar) = rotation(now.cos_bar[c] * rho, theta);
            (now.rho[c], now.rho_bar[c]) = (rho, rho_bar);
            (now.cos_bar[c], now.sin_bar[c]) = (cos_bar, sin_bar);
            now.zeta[c] = cos_bar * now.zeta_bar[c];
            now.zeta_bar[c] *= -sin_bar;
            of_h_bar[c] = over(theta_bar * rho, rho_old * rho_bar_old);
            of_x[c] = over(now.zeta[c], rho * rho_bar);
            of_h[c] = over(theta, rho);
            self.measure.residual[c] = now.residual(c, [cos, sin], theta_bar, zeta_old);
            self.measure.normal_residual[c] = now.zeta_bar[c].powi(2);
        }
        self.h_bar.axpby([1.0; 3], &self.h, of_h_bar.map(|factor| -factor));
        self.x.axpby(of_x, &self.h_bar, [1.0; 3]);
        self.h.axpby([1.0; 3], v, of_h.map(|factor| -factor));
        Ok(())
    }

    fn solution(&self) -> &O::Domain {
        &self.x
    }

    fn measure(&self) -> Measure {
        self.measure
    }

    fn residual(&self) -> Option<&O::Range> {
        None
    }

    fn memory(&mut self) -> MethodMemory<'_, O> {
        let now = &mut self.recurrence;
        MethodMemory {
            domain: vec![&mut self.x, &mut self.h, &mut self.h_bar, &mut self.bidiagonal.v],
            range: vec![&mut self.bidiagonal.u],
            scalars: vec![
                &mut self.bidiagonal.alpha,
                &mut self.bidiagonal.beta,
                &mut now.alpha_bar,
                &mut now.zeta_bar,
                &mut now.rho,
                &mut now.rho_bar,
                &mut now.cos_bar,
                &mut now.sin_bar,
                &mut now.zeta,
                &mut now.beta_double_dot,
                &mut now.beta_dot,
                &mut now.rho_dot,
                &mut now.tau_tilde,
                &mut now.theta_tilde,
                &mut self.measure.residual,
                &mut self.measure.normal_residual,
            ],
        }
    }
}

/// The rotation that turns (a, b) into (ρ, 0): cosine, sine, ρ.
fn rotation(a: f64, b: f64) -> (f64, f64, f64) {
    let rho = a.hypot(b);
    (over(a, rho), over(b, rho), rho)
}

fn over(a: f64, b: f64) -> f64 {
    ratio([a; 3], [b; 3])[0]
}
