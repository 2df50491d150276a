//! What the thesis published (tables 5.1 to 5.7): MAX, RMSE, MEAN and STD of the deviations in x, y, z (mm)
//! and roll, pitch, yaw (degrees).

/// The four statistics of the six degrees of freedom.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Statistics {
    /// Largest absolute deviation.
    pub(crate) max: [f64; 6],
    /// Root mean square deviation.
    pub(crate) rmse: [f64; 6],
    /// Mean deviation.
    pub(crate) mean: [f64; 6],
    /// Standard deviation about the mean.
    pub(crate) std: [f64; 6],
}

impl Statistics {
    /// The four, in the order of the tables.
    pub(crate) fn all(&self) -> [&[f64; 6]; 4] {
        [&self.max, &self.rmse, &self.mean, &self.std]
    }
}

/// One line of a published table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Published {
    /// The solver, and the circles where they are not all.
    pub(crate) name: &'static str,
    /// Its figures.
    pub(crate) statistics: Statistics,
}

const fn published(
    name: &'static str,
    max: [f64; 6],
    rmse: [f64; 6],
    mean: [f64; 6],
    std: [f64; 6],
) -> Published {
    Published { name, statistics: Statistics { max, rmse, mean, std } }
}

/// Table 5.1.
pub(crate) const EX_1A: &[Published] = &[
    published(
        "DLT",
        [1.5, 0.6, 0.3, 0.01, 0.59, 0.57],
        [0.8, 0.2, 0.1, 0.01, 0.20, 0.19],
        [0.7, 0.0, 0.0, 0.00, -0.16, -0.02],
        [0.4, 0.2, 0.1, 0.00, 0.12, 0.19],
    ),
    published(
        "EPnP",
        [1.5, 0.6, 0.3, 0.01, 0.68, 0.33],
        [0.7, 0.2, 0.1, 0.01, 0.28, 0.14],
        [0.6, 0.0, 0.0, 0.00, -0.25, 0.11],
        [0.3, 0.2, 0.1, 0.00, 0.13, 0.09],
    ),
];

/// Table 5.2.
pub(crate) const EX_1B: &[Published] = &[
    published(
        "DLT",
        [4.1, 4.9, 0.7, 0.09, 0.34, 1.04],
        [1.4, 2.2, 0.3, 0.07, 0.19, 0.30],
        [0.2, -1.7, -0.1, 0.06, -0.11, -0.16],
        [1.4, 1.4, 0.3, 0.03, 0.15, 0.25],
    ),
    published(
        "EPnP",
        [5.9, 2.9, 0.7, 0.15, 0.83, 1.59],
        [2.0, 1.2, 0.3, 0.08, 0.36, 0.44],
        [0.4, -0.9, -0.1, 0.07, 0.26, 0.01],
        [1.9, 0.9, 0.3, 0.04, 0.26, 0.45],
    ),
];

/// Table 5.3.
pub(crate) const EX_1C: &[Published] = &[
    published(
        "DLT",
        [7.3, 2.8, 1.4, 0.44, 1.21, 2.31],
        [3.7, 1.4, 0.8, 0.22, 0.78, 1.19],
        [-2.7, 1.2, 0.7, 0.03, -0.66, -0.92],
        [2.7, 0.8, 0.4, 0.22, 0.42, 0.76],
    ),
    published(
        "EPnP",
        [9.9, 2.4, 1.2, 0.42, 1.28, 1.59],
        [3.8, 1.0, 0.6, 0.17, 0.63, 0.76],
        [0.6, 0.3, 0.0, 0.05, -0.04, -0.08],
        [3.8, 1.0, 0.6, 0.16, 0.64, 0.77],
    ),
];

/// Tables 5.4 and 5.7.
pub(crate) const EX_2A: &[Published] = &[
    published(
        "DLT",
        [2.0, 1.8, 2.2, 0.09, 0.14, 0.18],
        [0.7, 0.8, 1.4, 0.02, 0.02, 0.04],
        [-0.5, -0.6, -1.3, 0.00, 0.01, -0.01],
        [0.4, 0.5, 0.6, 0.02, 0.02, 0.04],
    ),
    published(
        "EPnP",
        [1.7, 1.8, 2.2, 0.09, 0.14, 0.19],
        [0.5, 0.8, 1.4, 0.02, 0.02, 0.04],
        [-0.3, -0.5, -1.2, -0.01, 0.00, -0.01],
        [0.4, 0.5, 0.6, 0.02, 0.02, 0.04],
    ),
    published(
        "DLT, 3 x 5-CCC",
        [1.9, 1.8, 2.4, 0.09, 0.14, 0.19],
        [0.7, 0.7, 1.4, 0.03, 0.02, 0.04],
        [-0.5, -0.5, -1.3, -0.01, 0.00, -0.01],
        [0.4, 0.5, 0.6, 0.02, 0.02, 0.04],
    ),
];

/// Tables 5.5 and 5.6.
pub(crate) const EX_2B: &[Published] = &[
    published(
        "DLT",
        [1.6, 2.0, 2.1, 0.05, 0.11, 0.14],
        [0.5, 0.7, 1.2, 0.01, 0.02, 0.03],
        [-0.4, -0.6, -1.0, 0.00, 0.00, 0.01],
        [0.3, 0.5, 0.6, 0.01, 0.02, 0.03],
    ),
    published(
        "EPnP",
        [1.4, 2.1, 2.1, 0.05, 0.11, 0.14],
        [0.6, 0.8, 1.1, 0.01, 0.02, 0.03],
        [-0.4, -0.6, -1.0, -0.01, 0.00, 0.01],
        [0.4, 0.5, 0.6, 0.01, 0.02, 0.03],
    ),
    published(
        "DLT, middle A3 only",
        [5.1, 6.0, 6.6, 0.11, 0.38, 0.32],
        [1.4, 1.6, 2.2, 0.03, 0.10, 0.08],
        [-0.1, -0.7, -0.9, -0.02, -0.01, 0.01],
        [1.4, 1.4, 2.0, 0.03, 0.10, 0.08],
    ),
];

/// Table 5.6; EPnP's figures were left out.
pub(crate) const EX_2C: &[Published] = &[published(
    "DLT",
    [6.6, 5.6, 7.1, 0.09, 0.40, 0.22],
    [1.7, 1.4, 1.7, 0.02, 0.11, 0.07],
    [-1.1, -0.2, 1.0, -0.01, -0.08, 0.01],
    [1.2, 1.4, 1.4, 0.02, 0.07, 0.06],
)];
