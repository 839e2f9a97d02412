//! Where the numerics are looked at: laws checked, run time measured against error, numbers put under stress.

pub mod bench;
pub mod check;
pub mod stress;
