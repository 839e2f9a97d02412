//! How much light passes a surface that covers a part of what is behind it.

use crate::scene::{Rgb, rgb};

/// What passes of light through a film of a `color` that covers the share `alpha`; of what falls on it, it lets `transmission` through,
/// times its colour.
///
/// What is beside the film passes, coloured by as much of it as there is: `(1 − α) ((1 − α) + α c) + α t c`. That is 1 − α for a white
/// film, all for none, nothing for one that covers all, and a red film that covers half lets reddish light through: glass that was made
/// with an alpha is meant so, although glTF composes it as if light beside it stayed white.
pub(super) fn passing(color: Rgb, alpha: f32, transmission: f32) -> Rgb {
    let beside = 1.0 - alpha;
    rgb(|c| beside * (beside + alpha * color[c]) + alpha * transmission * color[c])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_passes_what_it_leaves_free_and_what_goes_through_it() {
        let red = [1.0, 0.5, 0.0];
        assert_eq!(passing([1.0; 3], 0.25, 0.0), [0.75; 3]);
        assert_eq!(passing(red, 0.0, 0.0), [1.0; 3]);
        assert_eq!(passing(red, 1.0, 0.0), [0.0; 3]);
        assert_eq!(passing(red, 1.0, 0.5), [0.5, 0.25, 0.0]);
        assert_eq!(passing(red, 0.5, 0.0), [0.5, 0.375, 0.25]);
        assert_eq!(passing(red, 0.5, 1.0), [1.0, 0.625, 0.25]);
    }
}
