/// See below.
#[derive(Debug)]
pub struct ShadowMap;
