// Whether x is at a bound and going down the gradient would leave the box.
fn is_held(x: f32, gradient: f32, lower: f32, upper: f32) -> bool {
    return (x <= lower && gradient > 0.0) || (x >= upper && gradient < 0.0);
}
