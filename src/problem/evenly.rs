/// The indices of at least one and at most `wanted` of so many things, evenly spread, in order: exactly `wanted` where there
/// are as many, and all of them where there are not.
pub fn evenly(wanted: usize, of: usize) -> Vec<usize> {
    let wanted = wanted.clamp(1, of.max(1));
    (0..wanted.min(of)).map(|index| (index as u128 * of as u128 / wanted as u128) as usize).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn as_many_as_wanted_and_no_gap_is_longer_than_another_by_more_than_one(wanted in 0usize..70, of in 0usize..70) {
            let picked = evenly(wanted, of);
            prop_assert_eq!(picked.len(), wanted.max(1).min(of));
            let ends = picked.iter().copied().skip(1).chain([of]);
            let gaps: Vec<usize> = picked.iter().zip(ends).map(|(&one, next)| next - one).collect();
            let (least, most) = (gaps.iter().min().unwrap_or(&1), gaps.iter().max().unwrap_or(&1));
            prop_assert!(*least >= 1 && most - least <= 1, "{picked:?}");
        }
    }

    #[test]
    fn without_a_limit_all_are_taken() {
        assert_eq!(evenly(usize::MAX, 3), [0, 1, 2]);
        assert_eq!(evenly(4, 10), [0, 2, 5, 7]);
    }
}
