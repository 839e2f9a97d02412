use std::fmt;
use std::str::FromStr;

use crate::Error;
use crate::march::{MOST_COEFFICIENTS, MOST_SAMPLES};

/// How what the medium scatters of the sun is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawing {
    /// Of each ray.
    pub method: DrawingMethod,
    /// Pixels from one ray to the next; the others are between those that are as deep.
    pub reduced: usize,
}

impl Default for Drawing {
    fn default() -> Self {
        Self { method: DrawingMethod::Exact, reduced: 1 }
    }
}

/// How the scattered light of rays is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrawingMethod {
    /// Row by row in closed form: what solves use.
    Exact,
    /// In so many steps of equal length.
    March {
        /// Steps a ray.
        steps: usize,
    },
    /// Over slices, by trees of least and largest depths (Chen et al. 2011); under the plain light alone.
    MinMax {
        /// Samples of a slice at most.
        samples: usize,
    },
    /// Over slices, by visibility in a Fourier series that is summed up beforehand (Klehm et al. 2014).
    Prefiltered {
        /// Sines and cosines.
        coefficients: usize,
    },
    /// Over slices, by a sweep with partial sums: [`EpipolarTraversal`](crate::march::EpipolarTraversal).
    Epipolar {
        /// Samples of a slice at most.
        samples: usize,
    },
    /// In few steps that differ from pixel to pixel, smoothed where pixels are as deep (Ali et al. 2017).
    Bilateral {
        /// Steps a ray.
        steps: usize,
    },
}

impl DrawingMethod {
    /// Each with its own number as it is by default.
    pub const ALL: [Self; 6] = [
        Self::Exact,
        Self::March { steps: 256 },
        Self::MinMax { samples: 2048 },
        Self::Prefiltered { coefficients: 32 },
        Self::Epipolar { samples: 2048 },
        Self::Bilateral { steps: 32 },
    ];

    /// Its name, and the number that says how exact it is.
    pub fn name(self) -> (&'static str, Option<usize>) {
        match self {
            Self::Exact => ("exact", None),
            Self::March { steps } => ("march", Some(steps)),
            Self::MinMax { samples } => ("min-max", Some(samples)),
            Self::Prefiltered { coefficients } => ("prefiltered", Some(coefficients)),
            Self::Epipolar { samples } => ("epipolar", Some(samples)),
            Self::Bilateral { steps } => ("bilateral", Some(steps)),
        }
    }

    /// The same with another number; none where it has none, or not that one.
    fn with(self, number: usize) -> Option<Self> {
        let (method, most) = match self {
            Self::Exact => return None,
            Self::March { .. } => (Self::March { steps: number }, 100_000),
            Self::MinMax { .. } => (Self::MinMax { samples: number }, MOST_SAMPLES),
            Self::Prefiltered { .. } => (Self::Prefiltered { coefficients: number }, MOST_COEFFICIENTS),
            Self::Epipolar { .. } => (Self::Epipolar { samples: number }, MOST_SAMPLES),
            Self::Bilateral { .. } => (Self::Bilateral { steps: number }, 100_000),
        };
        (1..=most).contains(&number).then_some(method)
    }
}

impl fmt::Display for DrawingMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            (name, None) => f.write_str(name),
            (name, Some(number)) => write!(f, "{name}:{number}"),
        }
    }
}

impl FromStr for DrawingMethod {
    type Err = Error;

    /// `march`, or `march:64` with a number of its own.
    fn from_str(text: &str) -> Result<Self, Error> {
        let (name, number) = match text.split_once(':') {
            Some((name, number)) => (name, Some(number)),
            None => (text, None),
        };
        let method = Self::ALL.into_iter().find(|method| method.name().0 == name);
        let method = match (method, number) {
            (method, None) => method,
            (method, Some(number)) => {
                method.zip(number.parse().ok()).and_then(|(method, number)| method.with(number))
            }
        };
        method.ok_or_else(|| {
            let expected = "exact, march[:steps], min-max[:samples], prefiltered[:coefficients up to 256], epipolar[:samples up to 32768] or \
                            bilateral[:steps]";
            Error::value("method", text, expected)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for method in DrawingMethod::ALL {
            assert_eq!(method.to_string().parse::<DrawingMethod>().unwrap(), method);
            assert_eq!(method.name().0.parse::<DrawingMethod>().unwrap(), method);
        }
        assert_eq!("march:7".parse::<DrawingMethod>().unwrap(), DrawingMethod::March { steps: 7 });
        for wrong in
            ["", "marsh", "march:", "march:0", "march:-1", "exact:3", "prefiltered:257", "epipolar:32769"]
        {
            assert!(wrong.parse::<DrawingMethod>().is_err(), "{wrong}");
        }
    }
}
