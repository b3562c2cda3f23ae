//! A list cut into runs of about equal cost.

use std::ops::Range;

use super::shard::Shard;

/// What the work of an item costs: its own cost, and that of getting ready, which is paid by the
/// first item of a run and by each one that does not share its `group` with the item before it.
/// In any unit; the same on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cost {
    /// Each item's own.
    pub item: u64,
    /// Getting ready for the group.
    pub ready: u64,
    /// Items of one group need to get ready once.
    pub group: u32,
}

/// The items of a shard: a run of the list, so that neighbours which share a scene stay together.
///
/// Of all cuts into that many runs this is one whose dearest run is the cheapest. Among these,
/// runs end once they have their share of what is left, so that they are about equal. The same
/// costs give the same cut everywhere; the runs of all shards together are the whole list, and some
/// are empty when there are fewer items than shards.
pub fn run_of(costs: &[Cost], shard: Shard) -> Range<usize> {
    let cut = Cut::new(costs, shard.count());
    let mut run = 0..0;
    for left in (shard.count() - shard.index() + 1..=shard.count()).rev() {
        run = run.end..cut.end(run.end, left);
    }
    run
}

struct Cut<'c> {
    costs: &'c [Cost],
    /// Cost of all items before each one, as if they were one run; one more than items.
    before: Vec<u64>,
    capacity: u64,
    /// From each item on, runs that are needed if each is as long as fits.
    needed: Vec<u32>,
}

impl<'c> Cut<'c> {
    fn new(costs: &'c [Cost], runs: u32) -> Self {
        let mut before = vec![0u64];
        for (at, cost) in costs.iter().enumerate() {
            let ready = if starts_group(costs, at) {
                cost.ready
            } else {
                0
            };
            let sum = before.last().copied().unwrap_or_default();
            before.push(sum.saturating_add(cost.item).saturating_add(ready));
        }
        let mut cut = Self {
            costs,
            before,
            capacity: 0,
            needed: Vec::new(),
        };
        let dearest = costs
            .iter()
            .map(|cost| cost.item.saturating_add(cost.ready))
            .max();
        let (mut low, mut high) = (dearest.unwrap_or_default(), cut.cost(0..costs.len()));
        while low < high {
            let middle = low + (high - low) / 2;
            cut.capacity = middle;
            match cut.fits(runs) {
                true => high = middle,
                false => low = middle + 1,
            }
        }
        cut.capacity = low;
        let mut needed = vec![0u32; costs.len() + 1];
        for at in (0..costs.len()).rev() {
            needed[at] = needed[cut.longest(at)] + 1;
        }
        cut.needed = needed;
        cut
    }

    fn cost(&self, run: Range<usize>) -> u64 {
        if run.is_empty() {
            return 0;
        }
        let within = self.before[run.end] - self.before[run.start];
        match starts_group(self.costs, run.start) {
            true => within,
            false => within.saturating_add(self.costs[run.start].ready),
        }
    }

    /// The end of the longest run from `start` within the capacity.
    fn longest(&self, start: usize) -> usize {
        let (mut low, mut high) = (start + 1, self.costs.len());
        while low < high {
            let middle = low + (high - low).div_ceil(2);
            match self.cost(start..middle) <= self.capacity {
                true => low = middle,
                false => high = middle - 1,
            }
        }
        low
    }

    fn fits(&self, runs: u32) -> bool {
        let mut at = 0;
        for _ in 0..runs {
            if at == self.costs.len() {
                break;
            }
            at = self.longest(at);
        }
        at == self.costs.len()
    }

    /// Where the run from `start` ends if it is the first of `left` runs.
    fn end(&self, start: usize, left: u32) -> usize {
        let all = self.costs.len();
        if start == all || left <= 1 {
            return all;
        }
        let share = self.cost(start..all).div_ceil(u64::from(left));
        let longest = self.longest(start);
        // The first end that has its share and leaves no more than the others can take.
        let is_enough = |end: usize| self.cost(start..end) >= share && self.needed[end] < left;
        let (mut low, mut high) = (start + 1, longest);
        while low < high {
            let middle = low + (high - low) / 2;
            match is_enough(middle) {
                true => high = middle,
                false => low = middle + 1,
            }
        }
        low
    }
}

fn starts_group(costs: &[Cost], at: usize) -> bool {
    at == 0 || costs[at - 1].group != costs[at].group
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn runs(costs: &[Cost], count: u32) -> Vec<Range<usize>> {
        let shards = (1..=count).filter_map(|index| Shard::new(index, count));
        shards.map(|shard| run_of(costs, shard)).collect()
    }

    fn total(costs: &[Cost], run: &Range<usize>) -> u64 {
        let part = &costs[run.clone()];
        let items = part.iter().enumerate().map(|(at, cost)| {
            cost.item
                + if starts_group(part, at) {
                    cost.ready
                } else {
                    0
                }
        });
        items.sum()
    }

    fn equal(count: usize) -> Vec<Cost> {
        vec![
            Cost {
                item: 5,
                ready: 0,
                group: 0
            };
            count
        ]
    }

    #[test]
    fn equal_items_are_counted_out() {
        let lengths = |items, shards| -> Vec<usize> {
            let runs = runs(&equal(items), shards);
            runs.into_iter().map(|run| run.len()).collect()
        };
        assert_eq!(lengths(10, 4), [3, 3, 2, 2]);
        assert_eq!(lengths(520, 32).iter().max(), Some(&17));
        assert_eq!(lengths(520, 32).iter().min(), Some(&16));
        assert_eq!(lengths(2, 4), [1, 1, 0, 0]);
        assert_eq!(lengths(0, 3), [0, 0, 0]);
        assert_eq!(lengths(7, 1), [7]);
    }

    #[test]
    fn cost_counts_and_not_number() {
        let mut costs = equal(9);
        costs[0].item = 40;
        assert_eq!(runs(&costs, 2), [0..1, 1..9]);
        // A scene that is dear to load is not split over two shards.
        let mut costs = equal(6);
        for (at, cost) in costs.iter_mut().enumerate() {
            cost.ready = 100;
            cost.group = u32::from(at >= 2);
        }
        assert_eq!(runs(&costs, 2), [0..2, 2..6]);
    }

    /// The cheapest dearest run of all cuts, by trying.
    fn best(costs: &[Cost], count: u32) -> u64 {
        let whole = total(costs, &(0..costs.len()));
        if count <= 1 {
            return whole;
        }
        let ends = 0..=costs.len();
        let tries =
            ends.map(|end| total(&costs[..end], &(0..end)).max(best(&costs[end..], count - 1)));
        tries.min().unwrap_or(whole)
    }

    proptest! {
        #[test]
        fn the_runs_are_the_list_and_no_cut_is_better(
            items in prop::collection::vec((1u64..50, 0u64..60, 0u32..3), 0..9),
            count in 1u32..5,
        ) {
            let costs: Vec<Cost> = items.iter()
                .map(|&(item, ready, group)| Cost { item, ready, group })
                .collect();
            let mut costs = costs;
            // Getting ready costs the same for all of a group.
            for at in 1..costs.len() {
                if costs[at].group == costs[at - 1].group {
                    costs[at].ready = costs[at - 1].ready;
                }
            }
            let runs = runs(&costs, count);
            let mut at = 0;
            for run in &runs {
                prop_assert_eq!(run.start, at);
                at = run.end;
            }
            prop_assert_eq!(at, costs.len());
            let dearest = runs.iter().map(|run| total(&costs, run)).max().unwrap_or(0);
            prop_assert_eq!(dearest, best(&costs, count));
        }
    }
}
