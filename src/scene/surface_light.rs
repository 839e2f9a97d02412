use super::Environment;

/// How much light from everywhere arrives at surfaces (Klehm 2015, ch. 3), in the place of the same ambient light on all of them.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceLight {
    /// Light from everywhere; the ambient light of the scene where none is given.
    pub environment: Option<Environment>,
    /// What is known of the directions from which light arrives.
    pub method: SurfaceMethod,
    /// What the directions of a hemisphere count.
    pub weighting: Weighting,
    /// Directions that a pixel asks: N.
    pub samples: usize,
    /// Places along each direction that are compared with the picture.
    pub steps: usize,
    /// How far away occluders count, in metres: r. Where none is given, rays meet all of them, and what is found in the picture is fitted to what the views see.
    pub radius: Option<f64>,
    /// Pixels a side of the square whose pixels ask different directions, and of the blur that unites them: m.
    pub pattern: usize,
}

/// What is known of the directions from which light arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceMethod {
    /// Nothing occludes.
    Open,
    /// The share of the directions that are open; light is that around the normal (eq. 3.8).
    AmbientOcclusion,
    /// The same, and light is that around the mean of the open directions (eq. 3.5).
    BentNormals,
    /// The same, and light comes from a cone around that mean (eqs. 3.6 and 3.9).
    BentCones,
    /// Rays through the scene itself: the reference.
    Rays,
}

/// What the directions of a hemisphere count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// Each as much as its cosine with the normal: as much as it lights a diffuse surface.
    Cosine,
    /// All alike, as in the paper, with its normalization and its geometric term (eqs. 3.1, 3.5, 3.6, 3.9 and 3.10).
    Uniform,
}

impl SurfaceLight {
    /// In a few words.
    pub fn in_words(&self) -> String {
        let Self { samples, .. } = self;
        match self.method {
            SurfaceMethod::Open => "surfaces in open light".to_owned(),
            SurfaceMethod::AmbientOcclusion => format!("ambient occlusion of {samples} directions"),
            SurfaceMethod::BentNormals => format!("bent normals of {samples} directions"),
            SurfaceMethod::BentCones => format!("bent cones of {samples} directions"),
            SurfaceMethod::Rays => format!("surfaces lit by {samples} rays"),
        }
    }
}
