//! What must hold of the tracker, on pictures drawn here.

use std::boxed::Box;
use std::vec;
use std::vec::Vec;

use gangway_device::Layout;

mod discs;

use super::*;
use crate::synthetic::{Picture, Random};

fn tracker() -> Box<Tracker> {
    Box::new(Tracker::new(Settings::default()))
}

/// A ring of `diameter` at `centre` on white in a small picture, blurred as by a good lens.
fn one_ring(centre: [f64; 2], diameter: f64) -> Picture {
    let mut picture = Picture::new(170, 170, 0.8);
    picture.ring(centre, diameter, 0.12);
    picture.blur(0.6);
    picture
}

fn look(picture: &Picture, layout: Layout, search: &Search) -> Result<Ring, Refusal> {
    let bytes = picture.bytes(layout);
    tracker().look(&picture.frame(&bytes, layout), search)
}

fn error(ring: &Ring, centre: [f64; 2]) -> f64 {
    (ring.centre.at[0] - centre[0]).hypot(ring.centre.at[1] - centre[1])
}

#[test]
fn centres_are_sub_pixel_for_every_size_phase_and_depth() {
    let mut random = Random::new(1);
    for diameter in [12.0, 17.3, 36.0, 60.0] {
        for layout in
            [Layout::GREY, Layout::Word { bits: 10 }, Layout::Word { bits: 12 }, Layout::Word { bits: 16 }]
        {
            let centre = [random.between(84.0, 85.0), random.between(84.0, 85.0)];
            let search = Search::round([85.5, 83.0], diameter);
            let ring = look(&one_ring(centre, diameter), layout, &search).unwrap();
            // The drawing's own 36 samples a pixel leave 0.01 px at the smallest rings.
            assert!(error(&ring, centre) < 0.01, "{diameter} {layout:?}: {} {ring:?}", error(&ring, centre));
            assert!((ring.diameter_px / diameter - 1.0).abs() < 0.02, "{diameter}: {}", ring.diameter_px);
            // Thin rings are black only in their middle, and hardly that.
            assert!((ring.white - 0.8).abs() < 0.01 && (ring.black - 0.12).abs() < 0.08, "{ring:?}");
        }
    }
}

#[test]
fn the_stated_covariance_is_true() {
    let mut random = Random::new(2);
    let (mut sum, mut count) = (0.0, 0.0);
    for round in 0..150 {
        let diameter = [17.0, 30.0][round % 2];
        let centre = [random.between(40.0, 41.0), random.between(40.0, 41.0)];
        let mut picture = Picture::new(82, 82, 0.8);
        picture.ring(centre, diameter, 0.12);
        picture.light(0.001);
        picture.blur(0.6);
        picture.noise(0.02, &mut random);
        let ring = look(&picture, Layout::Word { bits: 12 }, &Search::round([40.0, 41.0], diameter)).unwrap();
        let e = [ring.centre.at[0] - centre[0], ring.centre.at[1] - centre[1]];
        let [uu, uv, vv] = ring.centre.covariance;
        sum += (vv * e[0] * e[0] - 2.0 * uv * e[0] * e[1] + uu * e[1] * e[1]) / (uu * vv - uv * uv);
        count += 1.0;
    }
    // The mean of 150 squared errors of two coordinates scatters by 2 / sqrt(150) = 0.16 about 2; three times
    // that.
    assert!((sum / count - 2.0).abs() < 0.5, "{}", sum / count);
}

#[test]
fn uneven_light_does_not_pull_the_centre() {
    let search = Search::round([84.0, 84.0], 36.0);
    let mut picture = one_ring([84.3, 84.8], 36.0);
    let even = look(&picture, Layout::Word { bits: 12 }, &search).unwrap();
    // 30 % over 10 diameters is 0.0008 a pixel; twice that.
    picture.light(0.0016);
    let uneven = look(&picture, Layout::Word { bits: 12 }, &search).unwrap();
    // The bias that a centre may have in all.
    assert!(error(&uneven, even.centre.at) < 0.003, "{}", error(&uneven, even.centre.at));
}

#[test]
fn every_layout_gives_the_same_centre() {
    let picture = one_ring([84.2, 85.1], 30.0);
    let search = Search::round([83.0, 86.0], 30.0);
    let grey = look(&picture, Layout::GREY, &search).unwrap();
    for (step, offset) in [(2, 0), (2, 1), (3, 2), (4, 3)] {
        assert_eq!(look(&picture, Layout::Byte { step, offset }, &search).unwrap(), grey);
    }
    for bits in [9, 10, 12, 14, 16] {
        let word = look(&picture, Layout::Word { bits }, &search).unwrap();
        // Rounding to 8 bits moves a centre by less than 0.003 px: 1/12 level^2 over some 100 edge pixels.
        assert!(error(&word, grey.centre.at) < 0.003, "{bits} bits");
        if let 10 | 12 = bits {
            assert_eq!(look(&picture, Layout::Packed { bits }, &search).unwrap(), word);
        }
    }
}

#[test]
fn a_projective_bias_that_is_known_is_taken_off() {
    // The outer edge is moved by all of it, the inner one by a quarter.
    let (centre, bias) = ([84.2, 85.1], [0.2, -0.12]);
    let mut picture = Picture::new(170, 170, 0.8);
    let within = |x: f64, y: f64, share: f64, radius: f64| {
        (x - centre[0] - share * bias[0]).hypot(y - centre[1] - share * bias[1]) < radius
    };
    picture.cover(0.12, |x, y| within(x, y, 1.0, 15.0) && !within(x, y, 0.25, 7.5));
    picture.blur(0.6);
    let search = Search { bias, ..Search::round([84.0, 85.0], 30.0) };
    let ring = look(&picture, Layout::Word { bits: 12 }, &search).unwrap();
    // The drawing's own samples.
    assert!(error(&ring, centre) < 0.005, "{}", error(&ring, centre));
}

#[test]
fn a_post_over_a_ring_never_moves_its_centre_unnoticed() {
    let centre = [48.4, 48.7];
    let mut refused = 0;
    for level in [0.12, 0.3, 0.5] {
        for third in -6..45 {
            // Its edge comes from 2 px left of the ring and ends near the ring's middle.
            let edge = centre[0] - 18.0 + f64::from(third) / 3.0;
            let mut picture = Picture::new(96, 96, 0.8);
            picture.ring(centre, 36.0, 0.12);
            picture.cover(level, |x, _| x < edge);
            picture.blur(0.6);
            match look(&picture, Layout::GREY, &Search::round([49.0, 48.0], 36.0)) {
                // The bound is what coding artefacts do to a free ring.
                Ok(ring) => {
                    assert!(error(&ring, centre) < 0.2, "{level}, {third}: {}", error(&ring, centre))
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(refused > 110, "{refused}");
}

#[test]
fn a_post_beside_a_ring_does_not_cost_it() {
    let centre = [84.4, 84.7];
    let mut picture = Picture::new(170, 170, 0.8);
    picture.ring(centre, 36.0, 0.12);
    picture.cover(0.3, |x, _| x < centre[0] - 18.0 - 4.0);
    picture.blur(0.6);
    let ring = look(&picture, Layout::GREY, &Search::round([86.0, 84.0], 36.0)).unwrap();
    // The drawing's own samples.
    assert!(error(&ring, centre) < 0.01);
}

#[test]
fn a_small_ring_that_blur_fills_is_found_with_the_filter_on() {
    let mut random = Random::new(5);
    for phase in [0.0, 0.25, 0.5, 0.75] {
        let centre = [48.0 + phase, 47.7];
        let mut picture = Picture::new(96, 96, 0.8);
        // The sheet ends within the window's corners: what is beside it is darker than the blurred ring.
        picture.cover(0.24, |x, y| (x - centre[0]).hypot(y - centre[1]) > 18.0);
        picture.ring(centre, 12.0, 0.12);
        picture.blur(1.5);
        picture.noise(0.008, &mut random);
        let ring = look(&picture, Layout::GREY, &Search::round([49.0, 47.0], 12.0)).unwrap();
        // Five standard deviations of such a ring's noise.
        assert!(error(&ring, centre) < 0.05, "{phase}: {}", error(&ring, centre));
    }
}

#[test]
fn a_narrow_margin_on_something_dark_is_white_enough() {
    let centre = [84.4, 84.7];
    let mut random = Random::new(6);
    let mut picture = Picture::new(170, 170, 0.3);
    picture.cover(0.09, |x, y| (x - centre[0]).hypot(y - centre[1]) > 14.5 + 4.0);
    picture.ring(centre, 29.0, 0.045);
    picture.blur(1.5);
    picture.noise(0.005, &mut random);
    let ring = look(&picture, Layout::GREY, &Search::round([86.0, 84.0], 29.0)).unwrap();
    assert!(error(&ring, centre) < 0.05, "{}", error(&ring, centre));
}

#[test]
fn refusals_say_why() {
    let search = Search::round([85.0, 85.0], 36.0);
    let at = |x: f64, y: f64| Search { at: [x, y], ..search };
    let blank = Picture::new(170, 170, 0.8);
    let whole = one_ring([85.0, 85.0], 36.0);
    assert_eq!(look(&blank, Layout::GREY, &search), Err(Refusal::LowContrast));
    assert_eq!(look(&whole, Layout::GREY, &at(-60.0, 80.0)), Err(Refusal::OutsidePicture));
    assert_eq!(look(&whole, Layout::GREY, &at(85.0, 120.0)), Err(Refusal::CutByWindow));
    assert_eq!(look(&one_ring([5.0, 85.0], 36.0), Layout::GREY, &at(8.0, 85.0)), Err(Refusal::CutByPicture));
    // A disc is no ring.
    let mut disc = Picture::new(170, 170, 0.8);
    disc.cover(0.1, |x, y| (x - 85.0).hypot(y - 85.0) < 18.0);
    assert_eq!(look(&disc, Layout::GREY, &search), Err(Refusal::NotFound));
    // A bite out of the outer edge that leaves the ring closed.
    let mut bitten = one_ring([85.0, 85.0], 36.0);
    bitten.cover(0.8, |x, y| (x - 85.0).hypot(y - 67.0) < 5.0);
    assert_eq!(look(&bitten, Layout::GREY, &search), Err(Refusal::Outline));
    // White so far beyond full scale that little is left of the edges.
    let mut bright = whole;
    bright.values.iter_mut().for_each(|value| *value *= 4.5);
    assert_eq!(look(&bright, Layout::GREY, &search), Err(Refusal::Saturated));
}

#[test]
fn white_that_is_clipped_costs_neither_ring_nor_centre() {
    for brighter in [1.0, 1.3, 1.6, 2.5] {
        let centre = [84.3, 84.8];
        let mut picture = one_ring(centre, 36.0);
        picture.values.iter_mut().for_each(|value| *value *= brighter);
        let ring = look(&picture, Layout::GREY, &Search::round([84.0, 84.0], 36.0)).unwrap();
        // The drawing's own samples: 0.005 px with the whole edges, more with the third of them that is not
        // clipped.
        assert!(error(&ring, centre) < 0.015, "{brighter}: {}", error(&ring, centre));
    }
}

/// Centres of a target like a 5-CCC close by: rings of 29 px, 60 px and more apart.
const FIVE: [[f64; 2]; 5] = [[120.0, 120.0], [204.0, 118.0], [162.0, 163.0], [121.0, 206.0], [206.0, 205.0]];

fn five(moved: [f64; 2]) -> (Vec<[f64; 2]>, Picture) {
    let centres: Vec<_> = FIVE.iter().map(|c| [c[0] + moved[0], c[1] + moved[1]]).collect();
    let mut picture = Picture::new(330, 330, 0.8);
    centres.iter().for_each(|&centre| picture.ring(centre, 29.0, 0.12));
    picture.blur(0.6);
    (centres, picture)
}

fn searches() -> Vec<Search> {
    FIVE.iter().map(|&at| Search { reach_px: 30.0, ..Search::round(at, 29.0) }).collect()
}

fn track(picture: &Picture, searches: &[Search]) -> Vec<Result<Ring, Refusal>> {
    track_with(&mut tracker(), picture, searches)
}

/// As a first frame: nothing is known of the light.
fn track_with(tracker: &mut Tracker, picture: &Picture, searches: &[Search]) -> Vec<Result<Ring, Refusal>> {
    let bytes = picture.bytes(Layout::GREY);
    let mut rings = vec![Err(Refusal::Residual); searches.len()];
    let light = &mut Illumination::default();
    tracker.track(&picture.frame(&bytes, Layout::GREY), searches, light, &mut rings);
    rings
}

#[test]
fn a_jerk_of_more_than_a_diameter_loses_no_ring() {
    for moved in [[31.0, 0.0], [-20.0, 23.0], [0.0, -31.0]] {
        let (centres, picture) = five(moved);
        for (ring, centre) in track(&picture, &searches()).iter().zip(centres) {
            // The drawing's own samples.
            assert!(error(&ring.unwrap(), centre) < 0.02, "{moved:?} {ring:?}");
        }
    }
}

#[test]
fn a_neighbour_is_not_taken_for_a_covered_ring() {
    let (_, mut picture) = five([0.0; 2]);
    // The ring in the middle is covered, and its window shows another one whole.
    picture.cover(0.8, |x, y| (x - 162.0).hypot(y - 163.0) < 20.0);
    let mut searches = searches();
    searches[2].at = [140.0, 186.0];
    searches[2].reach_px = 20.0;
    searches[2].confident = false;
    let rings = track(&picture, &searches);
    assert_eq!(rings[2], Err(Refusal::Neighbour));
    assert!([0, 1, 3, 4].iter().all(|&i| rings[i].is_ok()), "{rings:?}");
}

#[test]
fn two_claims_on_a_ring_that_are_equally_good_are_both_refused() {
    let (_, picture) = five([0.0; 2]);
    let mut searches = searches();
    (searches[0].at, searches[1].at) = ([158.0, 163.0], [166.0, 163.0]);
    (searches[0].reach_px, searches[1].reach_px) = (10.0, 10.0);
    let rings = track(&picture, &searches[..2]);
    assert_eq!(rings, [Err(Refusal::Neighbour); 2]);
}

#[test]
fn a_covered_ring_is_found_again_where_its_target_went() {
    let (centres, mut picture) = five([26.0, -16.0]);
    picture.cover(0.3, |x, y| (x - centres[4][0]).hypot(y - centres[4][1]) < 20.0);
    let rings = track(&picture, &searches());
    assert!((0..4).all(|i| rings[i].is_ok()) && rings[4].is_err(), "{rings:?}");
    // Free to see again.
    let (centres, picture) = five([26.0, -16.0]);
    let rings = track(&picture, &searches());
    // The drawing's own samples.
    assert!((0..5).all(|i| error(&rings[i].unwrap(), centres[i]) < 0.02), "{rings:?}");
}

#[test]
fn the_same_picture_gives_the_same_bits_whatever_was_tracked_before() {
    let (_, first) = five([0.0; 2]);
    let (_, second) = five([3.3, -2.1]);
    let mut used = tracker();
    track_with(&mut used, &first, &searches());
    assert_eq!(track_with(&mut used, &second, &searches()), track(&second, &searches()));
}

#[test]
fn random_bytes_and_absurd_searches_never_panic_nor_give_a_ring_that_is_no_number() {
    let mut random = Random::new(5);
    let odd = [f64::NAN, f64::INFINITY, -1e300, 0.0, -3.0, 1e-12, 5.0, 40.0, 190.0, 1e9];
    let mut tracker = tracker();
    let mut light = Illumination::default();
    for round in 0..400 {
        let (width, height) = (1 + random.next() as usize % 90, 1 + random.next() as usize % 90);
        let layout =
            [Layout::GREY, Layout::Byte { step: 2, offset: 1 }, Layout::Word { bits: 12 }][round % 3];
        let stride = layout.row_bytes(width as u16).unwrap() + random.next() as usize % 4;
        let coarse = 1 + random.next() % 60;
        let bytes: Vec<u8> = (0..stride * height)
            .map(|i| if (i as u64 / coarse).is_multiple_of(2) { random.next() as u8 } else { 200 })
            .collect();
        let size = (width as u16, height as u16);
        let frame = Frame::new(&bytes, size, stride, layout, 0, 0).unwrap();
        let mut pick = |usual: f64| {
            let i = random.next() as usize % (2 * odd.len());
            odd.get(i).copied().unwrap_or(usual)
        };
        let search = Search {
            at: [pick(40.0), pick(40.0)],
            shape: [pick(50.0), pick(0.0), pick(50.0)],
            ratio: pick(2.0),
            reach_px: pick(30.0),
            target: 0,
            confident: true,
            uncertain_px: pick(0.0),
            bias: [pick(0.0), pick(0.0)],
        };
        let mut rings = [Err(Refusal::NotFound); 6];
        let near = |u| Search::round([u, 20.0], 14.0);
        let searches = [search, search, near(18.0), near(20.0), near(22.0), near(25.0)];
        tracker.track(&frame, &searches, &mut light, &mut rings);
        for ring in rings.iter().flatten() {
            assert!(ring.centre.at.iter().chain(&ring.centre.covariance).all(|x| x.is_finite()), "{ring:?}");
        }
    }
}
