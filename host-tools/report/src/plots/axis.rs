//! Axes: from values to pixels, and the round numbers to mark.

use crate::DegreeOfFreedom;

/// A linear axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    pub(crate) low: f64,
    pub(crate) high: f64,
    from_px: f64,
    to_px: f64,
}

impl Axis {
    /// From `low` at `from_px` to `high` at `to_px`; an empty range is widened about its middle.
    pub(crate) fn new([low, high]: [f64; 2], [from_px, to_px]: [f64; 2]) -> Self {
        let smallest = (low.abs().max(high.abs()) * 1e-9).max(1e-9);
        if high - low >= smallest {
            Self { low, high, from_px, to_px }
        } else {
            let middle = (low + high) / 2.0;
            Self { low: middle - 0.5, high: middle + 0.5, from_px, to_px }
        }
    }

    pub(crate) fn px(&self, value: f64) -> f64 {
        self.from_px + (value - self.low) / (self.high - self.low) * (self.to_px - self.from_px)
    }

    /// Round values within the range, about `count` and at least two of them, each with its label.
    pub(crate) fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        let mut step = round_step((self.high - self.low) / count);
        while (self.high / step).floor() - (self.low / step).ceil() < 1.0 {
            step = round_step(step / 2.5);
        }
        let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        let (first, last) = ((self.low / step).ceil(), (self.high / step).floor());
        let mut ticks = Vec::new();
        let mut i = first;
        while i <= last && ticks.len() < 100 {
            let value = i * step;
            ticks.push((value, number(value, digits)));
            i += 1.0;
        }
        ticks
    }
}

/// The smallest of 1, 2, 5, 10... times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= step * (1.0 - 1e-9)).unwrap_or(10.0);
    factor * power
}

/// A number with its unit, as it is usual: a space before mm, none before the sign of degrees.
pub(crate) fn with_unit(number: String, of: &DegreeOfFreedom) -> String {
    let space = if of.is_angle { "" } else { " " };
    format!("{number}{space}{}", of.unit_sign)
}

/// A number for people: a true minus sign, none before a zero.
pub(crate) fn number(value: f64, digits: usize) -> String {
    crate::table::fixed(value, digits).replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_within_the_range() {
        let labels = |low, high| {
            let axis = Axis::new([low, high], [0.0, 100.0]);
            axis.ticks(4.0).into_iter().map(|t| t.1).collect::<Vec<_>>()
        };
        assert_eq!(labels(-0.013, 0.031), ["0.00", "0.02"]);
        assert_eq!(labels(-70.0, 60.0), ["\u{2212}50", "0", "50"]);
        assert_eq!(labels(0.0, 5.0), ["0", "2", "4"]);
        // 0.005 would leave the zero alone, so the next finer step is taken.
        assert_eq!(labels(-0.0041, 0.0041).len(), 5);
        // A range that is empty is widened, not divided by.
        assert_eq!(labels(3.0, 3.0), ["2.5", "3.0", "3.5"]);
    }
}
