use crate::march::VolumeTraversal;
use crate::problem::transport::HostOperator;

/// `T` of a volume problem on the CPU in f32.
pub type VolumeOperator = HostOperator<VolumeTraversal>;
