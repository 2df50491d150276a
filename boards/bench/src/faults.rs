//! Faults on request, the same ones for the same seed: adapters beside the real camera and the real link.

mod camera;
mod link;

use std::str::FromStr;

pub use camera::FaultyCamera;
pub use link::FaultyLink;

/// How often a camera goes wrong: shares of its frames, 0 to 1, their sum at most 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraFaults {
    /// Never delivered: the next frame's number shows the gap.
    pub drop: f64,
    /// Delivered twice, with the same number.
    pub repeat: f64,
    /// Only a part arrives: the camera reports a corrupt frame.
    pub torn: f64,
    /// Black all over.
    pub dark: f64,
    /// The camera first reports that it stalls, then delivers.
    pub late: f64,
}

/// How often a link goes wrong: shares of the records, 0 to 1, their sum at most 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkFaults {
    /// The line takes nothing for a while before this record; nothing is lost.
    pub stall: f64,
    /// The connection is lost in the middle of this record.
    pub drop: f64,
    /// One byte of this record is changed on the way.
    pub garble: f64,
}

/// All faults, read from `drop:0.01,link-garble:0.002`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Faults of the camera.
    pub camera: CameraFaults,
    /// Faults of the link.
    pub link: LinkFaults,
}

/// What is wrong with a list of faults.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultError {
    /// No such fault.
    #[error(
        "'{0}' is no fault; there are drop, repeat, torn, dark and late, and link-stall, link-drop and link-garble, each as NAME:RATE"
    )]
    Name(String),
    /// The rate is missing or out of its bounds.
    #[error("'{0}' has no rate from 0 to 1; write NAME:RATE such as drop:0.01")]
    Rate(String),
    /// It is there already.
    #[error("'{0}' is there twice; give each fault one rate")]
    Twice(String),
    /// Together they are more than all.
    #[error("the rates of the {0} faults sum up to more than 1; make them smaller")]
    Sum(&'static str),
}

impl FromStr for Faults {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let mut faults = Self::default();
        let mut names: Vec<&str> = Vec::new();
        for item in text.split(',').map(str::trim).filter(|item| !item.is_empty()) {
            let (name, rate) = item.split_once(':').unwrap_or((item, ""));
            let slot = match name {
                "drop" => &mut faults.camera.drop,
                "repeat" => &mut faults.camera.repeat,
                "torn" => &mut faults.camera.torn,
                "dark" => &mut faults.camera.dark,
                "late" => &mut faults.camera.late,
                "link-stall" => &mut faults.link.stall,
                "link-drop" => &mut faults.link.drop,
                "link-garble" => &mut faults.link.garble,
                _ => return Err(FaultError::Name(name.to_owned())),
            };
            if names.contains(&name) {
                return Err(FaultError::Twice(name.to_owned()));
            }
            names.push(name);
            let rate = rate.parse().ok().filter(|rate| (0.0..=1.0).contains(rate));
            *slot = rate.ok_or_else(|| FaultError::Rate(item.to_owned()))?;
        }
        let CameraFaults { drop, repeat, torn, dark, late } = faults.camera;
        // A little more than 1, for rates such as ten times 0.1.
        if drop + repeat + torn + dark + late > 1.0 + 1e-9 {
            return Err(FaultError::Sum("camera's"));
        }
        if faults.link.stall + faults.link.drop + faults.link.garble > 1.0 + 1e-9 {
            return Err(FaultError::Sum("link's"));
        }
        Ok(faults)
    }
}

/// Which of several faults, given their shares, a number from 0 to 1 falls on.
fn choose(share: f64, rates: &[f64]) -> Option<usize> {
    let mut below = 0.0;
    rates.iter().position(|rate| {
        below += rate;
        share < below
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_faults_is_read() {
        let faults: Faults = "drop:0.1, late:0.5,link-garble:1".parse().unwrap();
        assert_eq!(faults.camera, CameraFaults { drop: 0.1, late: 0.5, ..CameraFaults::default() });
        assert_eq!(faults.link, LinkFaults { garble: 1.0, ..LinkFaults::default() });
        assert_eq!("".parse(), Ok(Faults::default()));
    }

    #[test]
    fn mistakes_in_it_are_named() {
        for (text, says) in [
            ("blur:0.1", "'blur' is no fault"),
            ("drop", "'drop' has no rate"),
            ("drop:2", "'drop:2' has no rate from 0 to 1"),
            ("drop:-0.1", "has no rate from 0 to 1"),
            ("drop:nan", "has no rate from 0 to 1"),
            ("drop:0.1,dark:0.1,drop:0.2", "'drop' is there twice"),
            ("drop:0.6,dark:0.6", "the camera's faults sum up to more than 1"),
            ("link-drop:0.6,link-stall:0.6", "the link's faults sum up to more than 1"),
        ] {
            let said = text.parse::<Faults>().unwrap_err().to_string();
            assert!(said.contains(says), "{said}");
        }
    }

    #[test]
    fn shares_fall_on_the_faults_in_their_order() {
        let rates = [0.1, 0.0, 0.2];
        let chosen = [0.0, 0.09, 0.1, 0.29, 0.31].map(|share| choose(share, &rates));
        assert_eq!(chosen, [Some(0), Some(0), Some(2), Some(2), None]);
    }
}
