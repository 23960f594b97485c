//! Which rows a fit uses: all, or a draw of N by the seed.

use crate::dataset::Dataset;
use rand::seq::index;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How rows are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Draw {
    /// Each movement gives its share, so that none is missed while N is at least their number.
    #[default]
    Stratified,
    /// As the paper draws: any row with the same chance. Most draws of 200 rows out of 57
    /// movements miss one, whose zero deviation then is free.
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
