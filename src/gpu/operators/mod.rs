//! Operators on a device: rows that are kept, rays that are walked, the metric of tiles, and `T` made of those.

mod device_operator;
mod entry;
mod kept;
mod light_map;
mod marched;
mod operator;
mod pace;
mod picture;
mod rays;
mod rounds;
mod slices;
mod tiles;
mod volume;
mod walked;

pub use device_operator::DeviceOperator;
pub use kept::Kept;
pub use light_map::DepthPyramid;
pub use marched::{Marched, MarchedPicture};
pub use operator::GpuOperator;
pub use picture::LightPicture;
pub use slices::{PrefilteredPicture, SweptPicture, swept};
pub use tiles::TileMetric;
pub use walked::Walked;
