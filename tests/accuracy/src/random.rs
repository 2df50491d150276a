//! Chance, from a seed.

use gangway_pose::{Centre, Observation};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// A stream of random numbers.
pub struct Random(Pcg64Mcg);

impl Random {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    /// Even between -most and most.
    pub fn within(&mut self, most: f64) -> f64 {
        most * (2.0 * self.share() - 1.0)
    }

    /// From 0 up to 1.
    pub fn share(&mut self) -> f64 {
        self.0.random_range(0.0..1.0)
    }

    /// A whole number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        self.0.random_range(0..end)
    }

    /// Between two numbers above zero, evenly in its logarithm.
    pub fn logarithmic(&mut self, least: f64, most: f64) -> f64 {
        least * (most / least).powf(self.share())
    }

    /// A standard normal number.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// `count` different numbers below `end`.
    pub fn choose(&mut self, count: usize, end: usize) -> Vec<usize> {
        let mut all: Vec<usize> = (0..end).collect();
        for i in 0..count {
            let other = i + self.below(end - i);
            all.swap(i, other);
        }
        all.truncate(count);
        all
    }

    /// A centre as it is measured: `at` with an error of its own covariance. Standard deviations are between
    /// `sigma_px / spread` and `sigma_px * spread`, another along either of two random directions.
    pub fn measured(&mut self, at: [f64; 2], sigma_px: f64, spread: f64) -> Centre {
        let mut sigma = || sigma_px * self.logarithmic(1.0 / spread, spread);
        let (su, sv) = (sigma(), sigma());
        let (sine, cosine) = self.within(std::f64::consts::PI).sin_cos();
        let root = Matrix2::new(su * cosine, -sv * sine, su * sine, sv * cosine);
        let error = root * Vector2::new(self.normal(), self.normal());
        let covariance = root * root.transpose();
        Centre {
            at: [at[0] + error.x, at[1] + error.y],
            covariance: [covariance.m11, covariance.m12, covariance.m22],
        }
    }

    /// All circles of a set as they are measured where `centres` says.
    pub fn observe(
        &mut self,
        points: &[nalgebra::Vector3<f64>],
        centres: &[[f64; 2]],
        sigma_px: f64,
        spread: f64,
    ) -> Vec<Observation> {
        let observe = |(point, at): (&nalgebra::Vector3<f64>, &[f64; 2])| Observation {
            point: *point,
            centre: self.measured(*at, sigma_px, spread),
        };
        points.iter().zip(centres).map(observe).collect()
    }
}
