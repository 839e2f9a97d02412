//! From a scene and what is painted on it to a least-squares problem, and from its solution to pictures.

mod assess;
mod constraints;
mod extents;
mod fill;
mod light_map;
mod painting;
mod render;
mod solution;
mod system;

pub use assess::{Assessment, Assessor, Match};
pub use constraints::{Constraint, constraints};
pub use extents::{Maps, fit};
pub use light_map::{LightMapOperator, LightMapProblem};
pub use painting::paint;
pub use render::{Rendering, render};
pub use solution::{Paused, Snapshot, Solved, SystemOperator, measure, method, solve, vectors};
pub use system::{System, Weights};
