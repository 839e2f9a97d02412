/// The points that no other one beats: none has both coordinates at most theirs and one of them less. Their indices, by
/// the first coordinate; of equal points the first.
///
/// Cost  sorting
pub fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        let [p, q] = [points[a], points[b]];
        p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1]))
    });
    let mut least = f64::INFINITY;
    order.retain(|&index| {
        let better = points[index][1] < least;
        least = least.min(points[index][1]);
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn beats(a: [f64; 2], b: [f64; 2]) -> bool {
        a[0] <= b[0] && a[1] <= b[1] && a != b
    }

    #[test]
    fn what_is_slower_and_worse_is_left_out() {
        assert_eq!(front(&[[3.0, 1.0], [1.0, 3.0], [2.0, 3.0], [2.0, 2.0], [4.0, 1.0]]), [1, 3, 0]);
        assert_eq!(front(&[[1.0, 1.0], [1.0, 1.0]]), [0]);
        assert!(front(&[]).is_empty());
    }

    proptest! {
        #[test]
        fn the_front_is_what_nothing_beats(points in proptest::collection::vec([0u8..9, 0u8..9], 0..40)) {
            let points: Vec<[f64; 2]> = points.into_iter().map(|p| p.map(f64::from)).collect();
            let front = front(&points);
            for (index, &point) in points.iter().enumerate() {
                let beaten = points.iter().any(|&other| beats(other, point));
                let stands = front.iter().any(|&kept| points[kept] == point);
                prop_assert!(beaten != stands, "{index} of {points:?}");
            }
        }
    }
}
