use super::{Camera, RgbaImage, Stroke};

/// A camera and what has been painted on its picture.
#[derive(Debug, Clone)]
pub struct View {
    /// Unique in the scene; names the result files of the view.
    pub name: String,
    /// Where it looks from, and the size of its picture.
    pub camera: Camera,
    /// Strokes, painted in this order over the layers.
    pub strokes: Vec<Stroke>,
    /// Painted layers of the view's size, from the bottom up.
    pub layers: Vec<RgbaImage>,
    /// Weight, from 0 to 1, of the wish that a pixel without paint stays as it is.
    pub keep: f32,
}
