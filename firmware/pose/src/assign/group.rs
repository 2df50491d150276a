//! Rings that lie as the circles of one target do. A ring's ellipse says how its plane is stretched in the
//! picture, all but the turn about the line of sight; the way to a neighbour adds that. So two rings and the
//! circles that they are taken for say where the other circles of the target must show.

use heapless::Vec;

use crate::Sighting;
use crate::assign::layout::{Layout, MAX_PATTERN, Plate};

/// Most groups that are kept: 16 targets in two readings each.
pub(crate) const MAX_GROUPS: usize = 32;
/// Nearest rings to start from and, further, to find the others among.
const STARTS: usize = 4;
const NEAR: usize = 14;
/// A ring for no circle.
pub(crate) const NONE: u8 = u8::MAX;

/// How far the length of the way to a neighbour may be off, as a share: the ellipse is measured to a few
/// percent.
const LENGTH: f64 = 0.25;
/// Largest ratio of the sizes (areas) of rings of one target.
const SIZES: f64 = 1.6;
/// How far off a ring may be, in its diameters and as a share of the way to it ...
const OFF_DIAMETERS: f64 = 0.3;
const OFF_SHARE: f64 = 0.12;
/// ... and, in diameters, from the affine map through all of them: what perspective bends.
const OFF_FITTED: f64 = 0.3;
/// Groups of one pattern that share so many circles on the same rings are one.
const SHARED: usize = 3;
/// A group is larger than another by so many circles at least.
const LARGER: usize = 2;

// Work, in the unit of the slices that it is done in.
const WORK_RING: i32 = 16;
const WORK_PAIR: i32 = 16;
const WORK_TRY: i32 = 3_700;

/// A target's pattern found among the rings.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// The plate whose pattern it is; others may be alike.
    pub(crate) kind: usize,
    /// Number of the ring for every circle of the pattern.
    pub(crate) rings: [u8; MAX_PATTERN],
    /// How many there are.
    pub(crate) count: usize,
}

impl Group {
    /// The circles that have a ring, with its number.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + Clone {
        self.rings.iter().enumerate().filter(|(_, ring)| **ring != NONE).map(|(c, r)| (c, usize::from(*r)))
    }

    /// Whether a ring is in both.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        self.pairs().any(|(_, ring)| other.rings.contains(&(ring as u8)))
    }

    fn has(&self, circle: usize, ring: usize) -> bool {
        self.rings.get(circle).is_some_and(|known| usize::from(*known) == ring)
    }
}

/// The way from a plate's pattern to the picture.
struct Affine {
    at: [f64; 2],
    /// Row-major, px a diameter.
    by: [f64; 4],
}

impl Affine {
    fn of(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let [uu, uv, vu, vv] = self.by;
        [self.at[0] + uu * a + uv * b, self.at[1] + vu * a + vv * b]
    }
}

/// The search for groups; its memory is of one ring's neighbours.
#[derive(Default)]
pub(crate) struct Searcher {
    /// Squared distance and number, the nearest first.
    near: Vec<(f64, u8), NEAR>,
}

impl Searcher {
    /// Adds the groups that ring `number` begins together with its neighbour `start`, which is the nearest
    /// first; false if there is nothing more to begin with this ring.
    pub(crate) fn search(
        &mut self,
        layout: &Layout,
        rings: &[Sighting],
        (number, start): (usize, usize),
        groups: &mut Vec<Group, MAX_GROUPS>,
        work: &mut i32,
    ) -> bool {
        let Some(ring) = rings.get(number) else { return false };
        // A whole target came with all its readings when it was found first: each has this neighbour too.
        let whole = |group: &Group| {
            layout.plates.get(group.kind).is_some_and(|plate| plate.pattern.len() == group.count)
                && group.rings.contains(&(number as u8))
        };
        if groups.iter().any(whole) {
            return false;
        }
        if start == 0 {
            *work = work.saturating_sub(WORK_RING * rings.len() as i32);
            self.find_near(rings, number);
        }
        let other = self.near.get(start).filter(|_| start < STARTS).map(|(_, other)| usize::from(*other));
        let Some((other, neighbour)) = other.and_then(|other| Some((other, rings.get(other)?))) else {
            return false;
        };
        let Some(stretch) = Stretch::of(ring) else { return false };
        let way = stretch.flat([0, 1].map(|i| neighbour.at[i] - ring.at[i]));
        for (kind, plate) in layout.kinds() {
            *work = work.saturating_sub(WORK_PAIR * (plate.pattern.len() * plate.pattern.len()) as i32);
            for (a, b, turn) in fitting(plate, way) {
                let known = |group: &Group| group.kind == kind && group.has(a, number) && group.has(b, other);
                if groups.iter().any(known) {
                    continue;
                }
                *work = work.saturating_sub(WORK_TRY);
                let map = stretch.affine(ring.at, plate, a, turn);
                if let Some(group) = self.gather(plate, kind, rings, number, map) {
                    keep(groups, group);
                }
            }
        }
        true
    }

    /// The rings nearest to ring `number` that could be of the same target.
    fn find_near(&mut self, rings: &[Sighting], number: usize) {
        self.near.clear();
        let Some(ring) = rings.get(number) else { return };
        let area = determinant(&ring.shape);
        for (other, place) in rings.iter().zip(0u8..) {
            let share = determinant(&other.shape) / area;
            // Areas squared.
            if usize::from(place) == number || !(share < SIZES * SIZES && share * SIZES * SIZES > 1.0) {
                continue;
            }
            let apart = square(other.at[0] - ring.at[0]) + square(other.at[1] - ring.at[1]);
            if self.near.last().is_some_and(|(most, _)| apart >= *most) && self.near.is_full() {
                continue;
            }
            if self.near.is_full() {
                self.near.pop();
            }
            let at = self.near.iter().take_while(|(nearer, _)| *nearer <= apart).count();
            // There is room: one was taken out above if there was none.
            let _ = self.near.insert(at, (apart, place));
        }
    }

    /// The rings where `start` puts the circles, if they are enough and lie on one affine map.
    fn gather(
        &self,
        plate: &Plate,
        kind: usize,
        rings: &[Sighting],
        number: usize,
        start: Affine,
    ) -> Option<Group> {
        let ring = rings.get(number)?;
        let diameter = ring.diameter_px();
        let mut map = start;
        let mut group = Group { kind, rings: [NONE; MAX_PATTERN], count: 0 };
        // The map through those that are found is better than the first: it may find more.
        for round in 0..2 {
            group.rings = [NONE; MAX_PATTERN];
            group.count = 0;
            for (c, circle) in plate.pattern.iter().enumerate() {
                let at = map.of(*circle);
                let off = if round == 0 {
                    let way = [at[0] - ring.at[0], at[1] - ring.at[1]];
                    OFF_DIAMETERS * diameter + OFF_SHARE * (way[0].abs() + way[1].abs())
                } else {
                    OFF_FITTED * diameter
                };
                if let Some(found) = self.nearest(rings, number, at, off) {
                    if group.rings.contains(&(found as u8)) {
                        return None;
                    }
                    group.rings[c] = found as u8;
                    group.count += 1;
                }
                let left = plate.pattern.len() - 1 - c;
                if group.count + left < plate.needed() {
                    return None;
                }
            }
            if round == 0 {
                map = fitted(plate, &group, rings)?;
            }
        }
        Some(group)
    }

    /// The ring nearest to a place, not further than `off`.
    fn nearest(&self, rings: &[Sighting], number: usize, at: [f64; 2], off: f64) -> Option<usize> {
        let own = core::iter::once(number);
        let near = own.chain(self.near.iter().map(|(_, ring)| usize::from(*ring)));
        let mut best = None;
        let mut least = off * off;
        for place in near {
            let other = rings.get(place)?;
            let apart = square(other.at[0] - at[0]) + square(other.at[1] - at[1]);
            if apart < least {
                (best, least) = (Some(place), apart);
            }
        }
        best
    }
}

/// How a plane is stretched at a ring, from its ellipse.
struct Stretch {
    /// Symmetric square root of 16 times the moments: px a diameter along each axis.
    root: [f64; 3],
    /// Its inverse.
    inverse: [f64; 3],
}

impl Stretch {
    fn of(ring: &Sighting) -> Option<Self> {
        let [uu, uv, vv] = ring.shape.map(|m| 16.0 * m);
        let root = libm::sqrt((uu * vv - uv * uv).max(0.0));
        let trace = libm::sqrt(uu + vv + 2.0 * root);
        let root3 = [(uu + root) / trace, uv / trace, (vv + root) / trace];
        let determinant = determinant(&root3);
        let inverse = [root3[2], -root3[1], root3[0]].map(|c| c / determinant);
        (determinant > 0.0 && determinant.is_finite()).then_some(Self { root: root3, inverse })
    }

    /// A way in the picture as it is on the plane, in diameters, up to a turn.
    fn flat(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [a, b, c] = self.inverse;
        [a * u + b * v, b * u + c * v]
    }

    /// The map that puts circle `a` of a plate on the ring and turns the plate by (cosine, sine), scaled.
    fn affine(&self, at: [f64; 2], plate: &Plate, a: usize, [cos, sin]: [f64; 2]) -> Affine {
        let [p, q, r] = self.root;
        let by = [p * cos + q * sin, q * cos - p * sin, q * cos + r * sin, r * cos - q * sin];
        let [x, y] = plate.pattern.get(a).copied().unwrap_or_default();
        let at = [at[0] - by[0] * x - by[1] * y, at[1] - by[2] * x - by[3] * y];
        Affine { at, by }
    }
}

/// The ordered pairs of circles whose way is as long as `way`, with the turn (cosine, sine, times the ratio
/// of the lengths) that takes theirs to it.
fn fitting(plate: &Plate, way: [f64; 2]) -> impl Iterator<Item = (usize, usize, [f64; 2])> {
    let length2 = square(way[0]) + square(way[1]);
    let bounds = [square(1.0 - LENGTH), square(1.0 + LENGTH)].map(|share| share * length2);
    let all = plate.pattern.iter().enumerate();
    all.clone().flat_map(move |(a, from)| {
        all.clone().filter_map(move |(b, to)| {
            let own = [to[0] - from[0], to[1] - from[1]];
            let own2 = square(own[0]) + square(own[1]);
            let turn = [own[0] * way[0] + own[1] * way[1], own[0] * way[1] - own[1] * way[0]];
            (a != b && bounds[0] < own2 && own2 < bounds[1]).then(|| (a, b, turn.map(|c| c / own2)))
        })
    })
}

/// The affine map through a group, by least squares; `None` where its rings do not lie on one.
fn fitted(plate: &Plate, group: &Group, rings: &[Sighting]) -> Option<Affine> {
    let share = 1.0 / group.count as f64;
    let pairs = group.pairs().filter_map(|(c, r)| Some((*plate.pattern.get(c)?, rings.get(r)?.at)));
    let (mut from, mut to) = ([0.0; 2], [0.0; 2]);
    for (circle, at) in pairs.clone() {
        for i in 0..2 {
            from[i] += share * circle[i];
            to[i] += share * at[i];
        }
    }
    let (mut spread, mut cross) = ([0.0; 3], [0.0; 4]);
    for (circle, at) in pairs {
        let [a, b] = [circle[0] - from[0], circle[1] - from[1]];
        let [u, v] = [at[0] - to[0], at[1] - to[1]];
        spread = [spread[0] + a * a, spread[1] + a * b, spread[2] + b * b];
        cross = [cross[0] + u * a, cross[1] + u * b, cross[2] + v * a, cross[3] + v * b];
    }
    let det = determinant(&spread);
    // On one line they show no plane.
    let is_plane = det > 1e-3 * square(spread[0] + spread[2]);
    if !is_plane {
        return None;
    }
    let row = |x: f64, y: f64| [(x * spread[2] - y * spread[1]) / det, (y * spread[0] - x * spread[1]) / det];
    let ([uu, uv], [vu, vv]) = (row(cross[0], cross[1]), row(cross[2], cross[3]));
    let at = [to[0] - uu * from[0] - uv * from[1], to[1] - vu * from[0] - vv * from[1]];
    Some(Affine { at, by: [uu, uv, vu, vv] })
}

/// Keeps a group unless it is known; of two that are one, the larger. Rings that are a larger group of the
/// same pattern are not also a smaller one: the five in the middle of seven lie as turned ones do.
fn keep(groups: &mut Vec<Group, MAX_GROUPS>, group: Group) {
    let is_part = |small: &Group, large: &Group| {
        let within = |(_, ring): (usize, usize)| large.rings.contains(&(ring as u8));
        small.kind == large.kind && small.count + LARGER <= large.count && small.pairs().all(within)
    };
    if groups.iter().any(|known| is_part(&group, known)) {
        return;
    }
    groups.retain(|known| !is_part(known, &group));
    let same = |known: &Group| {
        let shared = group.pairs().filter(|(c, r)| known.has(*c, *r)).count();
        known.kind == group.kind && shared >= SHARED
    };
    match groups.iter_mut().find(|known| same(known)) {
        Some(known) if known.count < group.count => *known = group,
        Some(_) => {}
        // What is too many is left out: there are then more patterns than targets.
        None => drop(groups.push(group)),
    }
}

fn determinant([a, b, c]: &[f64; 3]) -> f64 {
    a * c - b * b
}

fn square(x: f64) -> f64 {
    x * x
}
