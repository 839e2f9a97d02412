use super::VolumeScene;

/// A volume that changes from frame to frame, and what its pictures should show at some of them.
#[derive(Debug)]
pub struct Animation {
    /// Frames, numbered from 0.
    pub frames: usize,
    /// The key frames, in the order of their frames; at least one.
    pub keys: Vec<KeyFrame>,
}

/// A frame whose pictures are wanted, as a scene of its own.
#[derive(Debug)]
pub struct KeyFrame {
    /// Its number.
    pub frame: usize,
    /// The volume as it is at that frame before the solve, and what is wanted.
    pub scene: VolumeScene,
}

/// The two keys that a frame lies between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeySpan {
    /// Numbers of the key at or before the frame and of the key after it. At a key, before the first and behind the last they are the
    /// same.
    pub keys: [usize; 2],
    /// The share of the second key, from 0 to 1; the first has the rest.
    pub share: f64,
}

impl KeySpan {
    /// Where a frame lies among the frames of keys, which increase.
    pub fn of(keys: &[usize], frame: usize) -> Self {
        let behind = keys.partition_point(|&key| key <= frame);
        let (before, after) = (behind.saturating_sub(1), behind.min(keys.len().saturating_sub(1)));
        match (keys.get(before), keys.get(after)) {
            (Some(&a), Some(&b)) if a < frame && frame < b => {
                Self { keys: [before, after], share: (frame - a) as f64 / (b - a) as f64 }
            }
            _ => Self { keys: [before; 2], share: 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lie_between_their_neighbouring_keys() {
        let keys = [2, 6, 7];
        let at = |frame| {
            let KeySpan { keys, share } = KeySpan::of(&keys, frame);
            (keys, share)
        };
        assert_eq!(at(0), ([0, 0], 0.0));
        assert_eq!(at(2), ([0, 0], 0.0));
        assert_eq!(at(3), ([0, 1], 0.25));
        assert_eq!(at(4), ([0, 1], 0.5));
        assert_eq!(at(6), ([1, 1], 0.0));
        assert_eq!(at(7), ([2, 2], 0.0));
        assert_eq!(at(99), ([2, 2], 0.0));
    }
}
