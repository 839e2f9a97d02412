use crate::Result;
use crate::scene::{RgbaImage, View};
/// stub
pub fn paint(view: &View) -> Result<RgbaImage> {
    Ok(RgbaImage::transparent(view.camera.size()))
}
