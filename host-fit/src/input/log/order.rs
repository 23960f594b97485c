//! The order of the rows of a log: movement after movement, time forwards.

use std::collections::HashMap;

/// Most movements of a log: more than a week of the shortest, in little memory.
pub(super) const MOVEMENTS_MAX: usize = 1 << 19;

/// What is wrong with the place of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OrderFault {
    /// Time runs backwards.
    Backwards { before_us: i64 },
    /// Same movement and time as the row above.
    Repeated,
    /// The movement was left at this line and comes back.
    Returns { left_line: usize },
    /// A movement more than [`MOVEMENTS_MAX`].
    TooMany,
}

/// Follows the rows of one log.
#[derive(Debug, Default)]
pub(super) struct Order {
    current: Option<(i64, i64)>,
    /// The line at which each movement was left.
    left: HashMap<i64, usize>,
}

impl Order {
    /// Takes the next row, in this line; tells whether a movement begins.
    pub(super) fn take(
        &mut self,
        movement: i64,
        t_us: i64,
        line: usize,
    ) -> Result<bool, OrderFault> {
        let begins = match self.current {
            Some((current, before_us)) if current == movement => {
                if t_us < before_us {
                    return Err(OrderFault::Backwards { before_us });
                }
                if t_us == before_us {
                    return Err(OrderFault::Repeated);
                }
                false
            }
            Some((current, _)) => {
                self.left.insert(current, line);
                if let Some(&left_line) = self.left.get(&movement) {
                    return Err(OrderFault::Returns { left_line });
                }
                if self.left.len() >= MOVEMENTS_MAX {
                    return Err(OrderFault::TooMany);
                }
                true
            }
            None => true,
        };
        self.current = Some((movement, t_us));
        Ok(begins)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_go_movement_after_movement_and_forwards_in_time() {
        let mut order = Order::default();
        assert_eq!(order.take(3, 10, 0), Ok(true));
        assert_eq!(order.take(3, 11, 1), Ok(false));
        assert_eq!(order.take(3, 11, 2), Err(OrderFault::Repeated));
        assert_eq!(
            order.take(3, 9, 3),
            Err(OrderFault::Backwards { before_us: 11 })
        );
        assert_eq!(order.take(1, 0, 4), Ok(true));
        assert_eq!(
            order.take(3, 12, 5),
            Err(OrderFault::Returns { left_line: 4 })
        );
    }
}
