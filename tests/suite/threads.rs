//! What threads may share.

use unscatter::cpu;
use unscatter::operator::{
    Blocks, CpuVector, Gradient, Identity, Laplacian, Metric, Restricted, Scaled, Scaling, Stacked, Weighted,
};

fn assert_send_sync<T: Send + Sync + ?Sized>() {}

#[test]
fn operators_vectors_and_metrics_are_shared() {
    type Plain = Identity<CpuVector>;
    assert_send_sync::<Blocks<CpuVector>>();
    assert_send_sync::<Weighted<Plain>>();
    assert_send_sync::<Restricted<Plain>>();
    assert_send_sync::<Scaled<Plain>>();
    assert_send_sync::<Stacked<'_, CpuVector>>();
    assert_send_sync::<Gradient<CpuVector>>();
    assert_send_sync::<Laplacian<CpuVector>>();
    assert_send_sync::<Scaling<CpuVector>>();
    assert_send_sync::<cpu::TileMetric<f32, 3>>();
    assert_send_sync::<dyn Metric<CpuVector>>();
}

#[cfg(feature = "gpu")]
#[test]
fn what_is_on_an_adapter_is_shared() {
    use unscatter::gpu::{
        DeviceOperator, DeviceSum, Gpu, GpuOperator, GpuVector, Index, Kept, TileMetric, Walked,
    };
    type Plain = Identity<GpuVector>;
    assert_send_sync::<Gpu>();
    assert_send_sync::<GpuVector>();
    assert_send_sync::<Index>();
    assert_send_sync::<DeviceSum>();
    assert_send_sync::<GpuOperator>();
    assert_send_sync::<dyn DeviceOperator>();
    assert_send_sync::<Kept>();
    assert_send_sync::<Walked>();
    assert_send_sync::<TileMetric>();
    assert_send_sync::<Weighted<Plain>>();
    assert_send_sync::<Restricted<Plain>>();
    assert_send_sync::<Scaled<Plain>>();
    assert_send_sync::<Stacked<'_, GpuVector>>();
    assert_send_sync::<Gradient<GpuVector>>();
    assert_send_sync::<Laplacian<GpuVector>>();
    assert_send_sync::<Scaling<GpuVector>>();
}
