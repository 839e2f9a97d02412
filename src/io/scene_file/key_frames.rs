//! What the frames of all animations are held to.

use super::flaw::{Built, Flaw, within};

/// Frames at most.
const MOST_FRAMES: usize = 10_000;

/// Checks how many frames there are, and the numbers of the key frames among them.
pub(super) fn check_frames(frames: usize, keys: &[usize]) -> Built<()> {
    within("frames", frames, [2, MOST_FRAMES])?;
    if keys.len() < 2 {
        return Err(Flaw::new("keys", format!("at least two are needed, not {}", keys.len())));
    }
    for (index, &frame) in keys.iter().enumerate() {
        let place = format!("keys[{index}].frame");
        if frame >= frames {
            return Err(Flaw::value(place, frame, &format!("below {frames}, the number of frames")));
        }
        if let Some(before) = index.checked_sub(1).map(|before| keys[before])
            && frame <= before
        {
            let expected = format!("above {before}, the frame of the key before it");
            return Err(Flaw::value(place, frame, &expected));
        }
    }
    Ok(())
}

/// Which of the scene's views each view of a key is.
pub(super) fn views_of_key<'n>(
    names: impl Iterator<Item = &'n str> + Clone,
    views: &[&str],
) -> Built<Vec<usize>> {
    let number = |(index, name): (usize, &str)| {
        let place = format!("views[{index}].name");
        if names.clone().take(index).any(|other| other == name) {
            return Err(Flaw::value(place, name, "the name of another view"));
        }
        let view = views.iter().position(|view| *view == name);
        view.ok_or_else(|| Flaw::value(place, name, "the name of a view of the scene"))
    };
    names.clone().enumerate().map(number).collect()
}
