//! Which rows a fit uses: all, or a draw of N by the seed.

use hallstage_input::dataset::Dataset;
use rand::rngs::ChaCha8Rng;
use rand::seq::index;
use rand::{Rng, SeedableRng};

/// How rows are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Draw {
    /// Each movement gives its share, so that none is missed while N is at least their number.
    #[default]
    Stratified,
    /// As the paper draws: any row with the same chance. Most draws of 200 rows out of 57
    /// movements miss a movement; its zero deviation is then free.
    Plain,
}

/// The drawn rows, as ascending indices into [`Dataset::rows`]. `count` of all rows or more
/// gives all rows. The same seed gives the same rows.
pub fn draw_rows(dataset: &Dataset, count: usize, draw: Draw, seed: u64) -> Vec<usize> {
    let all = dataset.rows.len();
    if count >= all {
        return (0..all).collect();
    }
    // ChaCha8 is portable and its stream is fixed by its specification: a seed means the same
    // rows on every machine and in every version.
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut rows = match draw {
        Draw::Plain => index::sample(&mut random, all, count).into_vec(),
        Draw::Stratified => stratified(dataset, count, &mut random),
    };
    rows.sort_unstable();
    rows
}

/// Shares by the largest remainder of each movement's part of all rows; movements that would
/// get none come first while there are rows to give.
fn stratified(dataset: &Dataset, count: usize, random: &mut impl Rng) -> Vec<usize> {
    let all = dataset.rows.len();
    let sizes: Vec<usize> = dataset.movements.iter().map(|m| m.rows.len()).collect();
    let mut shares: Vec<usize> = sizes.iter().map(|n| n * count / all).collect();
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    // Ties are broken by chance, so that no movement is favoured by its place in the log.
    let lots: Vec<u64> = order.iter().map(|_| random.next_u64()).collect();
    order.sort_by_key(|&m| {
        let remainder = sizes[m] * count % all;
        (shares[m] > 0, std::cmp::Reverse(remainder), lots[m])
    });
    let mut left = count - shares.iter().sum::<usize>();
    while left > 0 {
        for &m in &order {
            if left > 0 && shares[m] < sizes[m] {
                shares[m] += 1;
                left -= 1;
            }
        }
    }
    let mut rows = Vec::with_capacity(count);
    for (movement, share) in dataset.movements.iter().zip(shares) {
        let drawn = index::sample(random, movement.rows.len(), share);
        rows.extend(drawn.iter().map(|k| movement.rows.start + k));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::dataset::Movement;
    use hallstage_input::shipped;

    /// A log with movements of the sizes given: a draw looks at nothing else.
    fn log(sizes: &[usize]) -> Dataset {
        let stage = shipped::stage();
        let truth = crate::estimator::paper::Parameters::designed(&stage);
        let row = crate::estimator::synthetic_for_tests::Protocol::exact(truth, 1)
            .dataset(&stage)
            .rows[0];
        let mut dataset = Dataset::default();
        for (movement, size) in sizes.iter().enumerate() {
            let start = dataset.rows.len();
            dataset.rows.resize(start + size, row);
            dataset.movements.push(Movement {
                log: 0,
                index: movement as i64,
                rows: start..start + size,
            });
        }
        dataset
    }

    fn by_movement(dataset: &Dataset, rows: &[usize]) -> Vec<usize> {
        let of = |m: &Movement| rows.iter().filter(|row| m.rows.contains(row)).count();
        dataset.movements.iter().map(of).collect()
    }

    #[test]
    fn a_stratified_draw_misses_no_movement_while_there_are_rows_enough() {
        let dataset = log(&[1000, 1000, 2, 1]);
        for seed in 0..20 {
            let rows = draw_rows(&dataset, 10, Draw::Stratified, seed);
            assert_eq!(by_movement(&dataset, &rows), [4, 4, 1, 1], "seed {seed}");
        }
        let rows = draw_rows(&dataset, 2, Draw::Stratified, 1);
        assert_eq!(rows.len(), 2);
    }

    #[test]
    fn a_draw_has_no_row_twice_and_its_seed_says_which() {
        let dataset = log(&[30, 1, 50, 7]);
        for draw in [Draw::Stratified, Draw::Plain] {
            for count in 1..=90 {
                let rows = draw_rows(&dataset, count, draw, 5);
                assert_eq!(rows.len(), count.min(88));
                assert!(rows.is_sorted_by(|a, b| a < b) && rows[rows.len() - 1] < 88);
                assert_eq!(rows, draw_rows(&dataset, count, draw, 5));
            }
            let other = draw_rows(&dataset, 20, draw, 6);
            assert_ne!(draw_rows(&dataset, 20, draw, 5), other);
        }
    }

    #[test]
    fn a_plain_draw_takes_any_row_with_the_same_chance() {
        let dataset = log(&[10, 30]);
        let mut times = [0; 40];
        for seed in 0..4000 {
            for row in draw_rows(&dataset, 4, Draw::Plain, seed) {
                times[row] += 1;
            }
        }
        // 400 each, with a standard deviation of 19.
        assert!(times.iter().all(|n| (300..500).contains(n)), "{times:?}");
    }
}
