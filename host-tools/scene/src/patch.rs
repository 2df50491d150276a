//! Light in a part of the picture: a low sun that falls on some of it, and a lamp mirrored in a wall or a
//! pane.

use crate::occluder::place;

/// A rectangle of sunshine on whatever is there.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sun {
    /// Width and height, px.
    pub(crate) size: [f64; 2],
    /// (seconds, u, v of its middle), times rising; it shows from the first to the last.
    pub(crate) path: Vec<[f64; 3]>,
    /// Width of its edges' half-shadow, px.
    pub(crate) edge: f64,
    /// Light that it adds to a reflectance of 1, share of full scale.
    pub(crate) level: f64,
}

/// A spot of light over whatever is there, round and falling off as a bell curve.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Glare {
    /// Standard deviation of the bell curve, px.
    pub(crate) radius: f64,
    /// (seconds, u, v of its middle), times rising; it shows from the first to the last.
    pub(crate) path: Vec<[f64; 3]>,
    /// Light in its middle, share of full scale.
    pub(crate) level: f64,
}

/// The patches of one frame, with their places.
#[derive(Default)]
pub(crate) struct Patches<'a> {
    suns: Vec<(&'a Sun, [f64; 2])>,
    glares: Vec<(&'a Glare, [f64; 2])>,
}

impl<'a> Patches<'a> {
    pub(crate) fn new(suns: &'a [Sun], glares: &'a [Glare], t: f64) -> Self {
        Self {
            suns: suns.iter().filter_map(|sun| Some((sun, place(&sun.path, t)?))).collect(),
            glares: glares.iter().filter_map(|glare| Some((glare, place(&glare.path, t)?))).collect(),
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.suns.is_empty() && self.glares.is_empty()
    }

    /// Light on a reflectance of 1, and light beside that, at a pixel.
    pub(crate) fn at(&self, pixel: [f64; 2]) -> [f64; 2] {
        let sun = |(sun, middle): &(&Sun, [f64; 2])| {
            let inside = |i: usize| {
                let within = 0.5 * sun.size[i] - (pixel[i] - middle[i]).abs();
                if sun.edge > 0.0 {
                    (0.5 + within / sun.edge).clamp(0.0, 1.0)
                } else {
                    f64::from(u8::from(within >= 0.0))
                }
            };
            sun.level * inside(0) * inside(1)
        };
        let glare = |(glare, middle): &(&Glare, [f64; 2])| {
            let square = (pixel[0] - middle[0]).powi(2) + (pixel[1] - middle[1]).powi(2);
            glare.level * (-0.5 * square / (glare.radius * glare.radius)).exp()
        };
        [self.suns.iter().map(sun).sum(), self.glares.iter().map(glare).sum()]
    }
}
