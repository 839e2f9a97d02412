use crate::scene::{Rgb, Scene};
use crate::{Error, Result};

/// One painted pixel: a row of the problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// Index of the view.
    pub view: usize,
    /// Column of the pixel.
    pub x: usize,
    /// Row of the pixel.
    pub y: usize,
    /// The painted colour: dimensionless for `tint`, radiance for `radiance`.
    pub color: Rgb,
    /// The painted alpha, in (0, 1]; 0 of pixels that are not painted, where they are not skipped.
    pub weight: f32,
}

/// What is known of the light that rows show, before anything is looked for.
///
/// Shapes  one colour a row
/// Units   radiance
pub(super) struct RowRadiance {
    /// The constant share of a row, which no unknown changes.
    pub(super) known: Vec<Rgb>,
    /// What a row would show, were each light as bright as it is, but white: what a tint is relative to.
    pub(super) white: Vec<Rgb>,
}

/// All painted pixels, view by view, row by row. Pixels without paint are among them where [`Skipping`](crate::scene::Skipping) does
/// not skip them.
///
/// Errors: [`Error::Empty`] when nothing is painted.
pub fn constraints(scene: &Scene) -> Result<Vec<Constraint>> {
    let constraints = pixels(scene)?;
    if constraints.iter().all(|pixel| pixel.weight <= 0.0) {
        return Err(Error::Empty {
            reason: "no pixel is painted in any view".to_owned(),
            remedy: "add strokes or layers to at least one view",
        });
    }
    Ok(constraints)
}

/// All painted pixels, as [`constraints`] gives them; none where nothing is painted.
///
/// Errors: those of [`paint`](super::paint), with the view's name.
pub fn pixels(scene: &Scene) -> Result<Vec<Constraint>> {
    let mut constraints = Vec::new();
    for (view, painted) in scene.views.iter().enumerate() {
        let painting = super::paint(painted)?;
        let width = painting.size()[0];
        for (index, &[r, g, b, weight]) in painting.pixels.iter().enumerate() {
            if weight > 0.0 || !scene.solve.skip.pixels {
                let (x, y) = (index % width, index / width);
                constraints.push(Constraint { view, x, y, color: [r, g, b], weight });
            }
        }
    }
    Ok(constraints)
}
