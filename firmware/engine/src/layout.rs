//! Where a carbody's circles truly are: a layout is measured with a tape, and off by millimetres that would
//! pull every pose differently as circles come and go. What counts is the motion since rest, so the rest
//! interval itself surveys the circles: each is moved, across the line of sight, to where the rest pose shows
//! it. How far off it is along the line of sight shows only as the train moves, and little.

use gangway_pose::{Centre, Circle, Lens, MAX_CIRCLES, Pose, Solution};
use gangway_vision::{Refusal, Ring};
use nalgebra::Vector3;

/// Standard deviations of a circle's place that the setting stands for.
const SIGMAS: f64 = 3.0;

/// Numbers of a target's place and turn that a picture shows well: two each; and those that a pose takes.
const SHOWN: f64 = 4.0;
const TAKEN: f64 = 6.0;

/// What is known of the places of a carbody's circles.
pub(crate) struct Layout {
    /// Bit i: circle i was surveyed.
    surveyed: u64,
    /// Direction in which the camera saw the carbody then, in the carbody's frame.
    seen_along: Vector3<f64>,
    /// How far circles were off a coordinate then, mm, root mean square.
    off_mm: f64,
    /// Circles of a target in the mean: they are off together.
    together: f64,
    /// Steps that take the circles to where single frames show them, summed, mm, and how many.
    steps: [Vector3<f64>; MAX_CIRCLES],
    counts: [u16; MAX_CIRCLES],
}

impl Layout {
    pub(crate) fn new(circles: &[Circle]) -> Self {
        Self {
            surveyed: 0,
            seen_along: Vector3::zeros(),
            off_mm: 0.0,
            together: circles.len() as f64 / targets(circles).max(1.0),
            steps: [Vector3::zeros(); MAX_CIRCLES],
            counts: [0; MAX_CIRCLES],
        }
    }

    /// Whether a rest interval surveyed the circles.
    pub(crate) fn is_surveyed(&self) -> bool {
        self.surveyed != 0
    }

    /// Whether these circles were all surveyed.
    pub(crate) fn has(&self, circles: u64) -> bool {
        circles & !self.surveyed == 0
    }

    /// By how much more a pose varies with the layout than with as much noise of each circle: those of a
    /// target are off together, and so hide what they are off by in the pose.
    pub(crate) fn correlation(&self) -> f64 {
        self.together * self.hidden()
    }

    /// What the surveyed circles are off by over what the pose leaves of it to be seen, squared.
    fn hidden(&self) -> f64 {
        let shown = SHOWN * f64::from(self.surveyed.count_ones()) / self.together;
        // A single target shows nothing of how it is mounted: the carbody's axes are its own.
        (shown / (shown - TAKEN).max(1.0)).max(1.0)
    }

    /// A circle's centre with what its place is uncertain by: all of it if others were surveyed and it was
    /// not, and if it was, how far it was off along the line of sight, as far as that has turned since.
    pub(crate) fn with(&self, circle: usize, centre: Centre, slack: &Slack) -> Centre {
        let sigma = match (self.surveyed, self.surveyed >> circle & 1) {
            (0, _) => return centre,
            (_, 0) => slack.whole_px / SIGMAS,
            _ => slack.turned_px,
        };
        let [uu, uv, vv] = centre.covariance;
        Centre { at: centre.at, covariance: [uu + sigma * sigma, uv, vv + sigma * sigma] }
    }

    /// How far layout and picture may disagree for a carbody about there.
    pub(crate) fn slack(&self, layout_mm: f64, circles: &[Circle], about: &Pose, lens: &Lens) -> Slack {
        let place = about.transform(&middle(circles));
        // What lies behind the camera shows nothing.
        let px_per_mm = lens.focal[0].max(lens.focal[1]) / place.z.max(1.0);
        // The sine of the angle by which the line of sight has turned in the carbody.
        let turned = along(&place, about).cross(&self.seen_along).norm();
        Slack {
            whole_px: layout_mm * px_per_mm,
            turned_px: self.off_mm * turned * px_per_mm * libm::sqrt(self.together),
        }
    }

    /// Takes a frame's rings that went into its pose and were not surveyed yet.
    pub(crate) fn observe(
        &mut self,
        circles: &[Circle],
        outcomes: &[Result<Ring, Refusal>],
        solution: &Solution,
        lens: &Lens,
    ) {
        for (i, (circle, outcome)) in circles.iter().zip(outcomes).enumerate() {
            let (Ok(ring), true) = (outcome, solution.used & !self.surveyed & 1 << i != 0) else { continue };
            let step = step(&circle.point, ring.centre.at, &solution.pose, lens);
            if let (Some(step), Some(sum), Some(count)) =
                (step, self.steps.get_mut(i), self.counts.get_mut(i))
            {
                *sum += step;
                *count = count.saturating_add(1);
            }
        }
    }

    /// Starts over with the next frame: the train moved.
    pub(crate) fn restart(&mut self) {
        self.surveyed = 0;
        self.steps = [Vector3::zeros(); MAX_CIRCLES];
        self.counts = [0; MAX_CIRCLES];
    }

    /// Moves the circles that so many frames showed to where these did, none by more than `most_mm`. Gives
    /// the squares of their steps, summed, mm^2.
    pub(crate) fn adopt(&mut self, circles: &mut [Circle], least: u16, most_mm: f64) -> f64 {
        let mut squares = 0.0;
        for (i, circle) in circles.iter_mut().enumerate() {
            let (Some(sum), Some(count)) = (self.steps.get_mut(i), self.counts.get_mut(i)) else { continue };
            if *count < least.max(1) || self.surveyed >> i & 1 == 1 {
                continue;
            }
            let step = *sum / f64::from(*count);
            (*sum, *count) = (Vector3::zeros(), 0);
            if step.norm() <= most_mm {
                circle.point += step;
                self.surveyed |= 1 << i;
                squares += step.norm_squared();
            }
        }
        squares
    }

    /// The circles as the rest interval showed them, seen from `rest`.
    pub(crate) fn survey(&mut self, circles: &mut [Circle], least: u16, most_mm: f64, rest: &Pose) {
        let squares = self.adopt(circles, least, most_mm);
        let count = f64::from(self.surveyed.count_ones()).max(1.0);
        self.off_mm = libm::sqrt(0.5 * squares / count * self.hidden());
        self.seen_along = along(&rest.transform(&middle(circles)), rest);
    }
}

/// How far layout and picture may disagree, px: at a circle that was not surveyed, at most, and at those that
/// were, as a standard deviation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slack {
    pub(crate) whole_px: f64,
    turned_px: f64,
}

/// On how many targets the circles are.
fn targets(circles: &[Circle]) -> f64 {
    let firsts = circles
        .iter()
        .enumerate()
        .filter(|(i, circle)| circles.iter().take(*i).all(|before| before.target != circle.target));
    firsts.count() as f64
}

/// The middle of some circles, in the carbody's frame.
fn middle(circles: &[Circle]) -> Vector3<f64> {
    circles.iter().map(|circle| circle.point).sum::<Vector3<f64>>() / circles.len().max(1) as f64
}

/// The line of sight to a place in the camera, as a direction in the carbody's frame.
fn along(place: &Vector3<f64>, pose: &Pose) -> Vector3<f64> {
    pose.rotation.transpose() * place.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

/// The shortest step, in the carbody's frame, that takes a point to the line on which it is seen.
fn step(point: &Vector3<f64>, seen: [f64; 2], pose: &Pose, lens: &Lens) -> Option<Vector3<f64>> {
    let [x, y] = lens.pixel_to_ray(seen).ok()?;
    let (ray, place) = (Vector3::new(x, y, 1.0), pose.transform(point));
    let step = ray * (ray.dot(&place) / ray.norm_squared()) - place;
    Some(pose.rotation.transpose() * step)
}

#[cfg(test)]
mod tests {
    use gangway_pose::project_circle;
    use nalgebra::Matrix6;

    use super::*;

    const LENS: Lens =
        Lens { focal: [1500.0, 1500.0], principal: [960.0, 540.0], skew: 0.0, distortion: [0.0; 5] };

    fn circle(target: u8, point: [f64; 3]) -> Circle {
        Circle { point: point.into(), normal: -Vector3::x(), outer_mm: 30.0, inner_mm: 15.0, target }
    }

    /// Two targets of three circles.
    fn circles() -> [Circle; 6] {
        [
            [0.0, -400.0, 0.0],
            [0.0, -300.0, 0.0],
            [0.0, -350.0, 90.0],
            [50.0, 300.0, 10.0],
            [50.0, 400.0, 0.0],
            [50.0, 350.0, 90.0],
        ]
        .map(|point| circle(u8::from(point[1] > 0.0), point))
    }

    fn rest() -> Solution {
        Solution {
            pose: Pose::of_camera([-1600.0, 40.0, 300.0], [0.5, 4.0, -1.0]),
            covariance: Matrix6::identity(),
            residual_px: 0.1,
            used: 0b11_1111,
            alternative: None,
        }
    }

    /// What the camera sees of circles that are there.
    fn seen(circles: &[Circle], pose: &Pose) -> std::vec::Vec<Result<Ring, Refusal>> {
        let ring = |circle: &Circle| Ring {
            centre: Centre {
                at: project_circle(circle, pose, &LENS).unwrap().centre,
                covariance: [1e-4, 0.0, 1e-4],
            },
            diameter_px: 28.0,
            white: 0.8,
            black: 0.1,
            noise: 0.01,
            blur_px: 0.7,
        };
        circles.iter().map(|circle| Ok(ring(circle))).collect()
    }

    #[test]
    fn a_surveyed_circle_lies_where_it_is_seen_and_no_further_off_than_it_must() {
        let (mut known, mut there) = (circles(), circles());
        there[1].point += Vector3::new(0.0, 1.5, -0.7);
        there[4].point += Vector3::new(15.0, 0.0, 0.0);
        let mut layout = Layout::new(&known);
        for _ in 0..9 {
            layout.observe(&known, &seen(&there, &rest().pose), &rest(), &LENS);
        }
        layout.survey(&mut known, 9, 5.0, &rest().pose);
        for (i, (known, there)) in known.iter().zip(&there).enumerate() {
            let [shown, seen] =
                [known, there].map(|circle| project_circle(circle, &rest().pose, &LENS).unwrap().centre);
            assert!((shown[0] - seen[0]).hypot(shown[1] - seen[1]) < 1e-6, "circle {i}");
        }
        assert!((known[1].point - circles()[1].point).norm() <= Vector3::new(0.0, 1.5, -0.7).norm());
        // Along the line of sight it shows little, and so it is moved little.
        assert!((known[4].point - circles()[4].point).norm() < 5.0 && layout.has(0b11_1111));
    }

    #[test]
    fn what_is_off_by_more_than_a_tape_is_not_believed() {
        let (mut known, mut there) = (circles(), circles());
        there[2].point += Vector3::new(0.0, 8.0, 0.0);
        let mut layout = Layout::new(&known);
        layout.observe(&known, &seen(&there, &rest().pose), &rest(), &LENS);
        layout.survey(&mut known, 1, 5.0, &rest().pose);
        assert_eq!(known[2].point, circles()[2].point);
        assert!(layout.has(0b11_1011) && !layout.has(0b100));
    }

    #[test]
    fn a_circle_that_rest_did_not_show_counts_little_until_enough_frames_have() {
        let mut known = circles();
        let mut layout = Layout::new(&known);
        let hidden = Solution { used: 0b01_1111, ..rest() };
        let rings = seen(&circles(), &rest().pose);
        layout.observe(&known, &rings, &hidden, &LENS);
        layout.survey(&mut known, 1, 5.0, &rest().pose);
        let sigma = |layout: &Layout, circle: usize| {
            let slack = layout.slack(5.0, &circles(), &rest().pose, &LENS);
            let centre = Centre { at: [900.0, 500.0], covariance: [1e-4, 0.0, 1e-4] };
            layout.with(circle, centre, &slack).covariance[0].sqrt()
        };
        // A third of 5 mm at 1.7 m.
        assert!((sigma(&layout, 5) - 1.5).abs() < 0.2 && (sigma(&layout, 0) - 0.01).abs() < 1e-6);
        for frame in 0..10 {
            layout.adopt(&mut known, 10, 5.0);
            assert!(!layout.has(1 << 5), "{frame} frames");
            layout.observe(&known, &rings, &rest(), &LENS);
        }
        layout.adopt(&mut known, 10, 5.0);
        assert!(layout.has(1 << 5) && (sigma(&layout, 5) - 0.01).abs() < 1e-6);
    }

    #[test]
    fn circles_that_were_off_are_less_certain_as_the_line_of_sight_turns() {
        let (mut known, mut there) = (circles(), circles());
        there.iter_mut().take(3).for_each(|circle| circle.point += Vector3::new(0.0, 2.0, 0.0));
        let mut layout = Layout::new(&known);
        layout.observe(&known, &seen(&there, &rest().pose), &rest(), &LENS);
        layout.survey(&mut known, 1, 5.0, &rest().pose);
        let sigma = |by: [f64; 3]| {
            let slack = layout.slack(5.0, &known, &rest().pose.moved_by(by, [0.0; 3]), &LENS);
            layout.with(0, Centre { at: [900.0, 500.0], covariance: [1e-4, 0.0, 1e-4] }, &slack).covariance[0]
                .sqrt()
        };
        assert!((sigma([0.0; 3]) - 0.01).abs() < 1e-4);
        let aside = sigma([170.0, 0.0, 0.0]);
        // Of 2 mm in half of the circles 1 mm a coordinate is left, by the correlation three to four times as
        // much; a tenth of that shows.
        assert!((0.2..1.0).contains(&aside), "{aside}");
    }
}
