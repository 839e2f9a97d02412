//! Operators on a device: rows that are kept, rays that are walked, the metric of tiles, and `T` made of those.

mod device_operator;
mod entry;
mod kept;
mod light_map;
mod operator;
mod pace;
mod rays;
mod rounds;
mod tiles;
mod volume;
mod walked;

pub use device_operator::DeviceOperator;
pub use kept::Kept;
pub use light_map::DepthPyramid;
pub use operator::GpuOperator;
pub use tiles::TileMetric;
pub use walked::Walked;
