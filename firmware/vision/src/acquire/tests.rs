use std::boxed::Box;
use std::vec::Vec;

use gangway_device::Layout;

use super::*;
use crate::synthetic::{Picture, Random};

fn swept(picture: &Picture, layout: Layout) -> Vec<Sighting> {
    let bytes = picture.bytes(layout);
    let mut acquisition = Box::new(Acquisition::new(&Settings::default(), [2.0; 2]));
    let mut work = i32::MAX;
    assert!(acquisition.advance(&picture.frame(&bytes, layout), &mut work), "there is work enough for all");
    acquisition.sightings().to_vec()
}

/// Rings of rising diameter in a row, on white, with blur and noise.
fn rings(diameters: &[f64], random: &mut Random) -> (Picture, Vec<[f64; 2]>) {
    let mut picture = Picture::new(96 * diameters.len(), 120, 0.8);
    let centres: Vec<[f64; 2]> = (0..diameters.len())
        .map(|i| [96.0 * i as f64 + random.between(45.0, 51.0), random.between(55.0, 65.0)])
        .collect();
    for (centre, diameter) in centres.iter().zip(diameters) {
        picture.ring(*centre, *diameter, 0.1);
    }
    picture.light(1e-4);
    picture.blur(0.8);
    picture.noise(0.008, random);
    (picture, centres)
}

#[test]
fn every_ring_of_12_to_64_px_is_found_once_and_measured() {
    let diameters = [12.0, 14.0, 16.0, 20.0, 26.0, 34.0, 48.0, 64.0];
    let mut random = Random::new(3);
    for _ in 0..3 {
        let (picture, centres) = rings(&diameters, &mut random);
        for layout in [Layout::GREY, Layout::Byte { step: 2, offset: 1 }, Layout::Word { bits: 12 }] {
            let found = swept(&picture, layout);
            assert_eq!(found.len(), diameters.len(), "{found:?}");
            for (centre, diameter) in centres.iter().zip(diameters) {
                let off = |ring: &&Sighting| (ring.at[0] - centre[0]).hypot(ring.at[1] - centre[1]);
                let ring = found.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
                // Eight rays with an edge to 0.1 px each, and rounding of the grey levels at the smallest.
                assert!(off(&ring) < 0.25, "{diameter} px: {} px off", off(&ring));
                assert!((ring.diameter_px() / diameter - 1.0).abs() < 0.12, "{diameter}: {ring:?}");
            }
        }
    }
}

#[test]
fn discs_of_6_to_64_px_are_found_in_darkness_and_beside_rings() {
    let diameters = [6.0, 9.0, 14.0, 22.0, 40.0, 64.0];
    for (dark, ratios) in [(0.0, [f64::INFINITY, 0.0]), (0.05, [f64::INFINITY, 0.0]), (0.05, [2.0; 2])] {
        let mut random = Random::new(21);
        let mut picture = Picture::new(170 * diameters.len(), 200, dark);
        let centres: Vec<[f64; 2]> = (0..diameters.len())
            .map(|i| [170.0 * i as f64 + random.between(80.0, 90.0), random.between(95.0, 105.0)])
            .collect();
        for (centre, diameter) in centres.iter().zip(&diameters) {
            picture.disc(*centre, *diameter, 0.6);
        }
        // The white in the middle of a ring on white is no disc of a target.
        picture.cover(0.8, |x, y| x > 1000.0 && y < 50.0);
        picture.blur(0.7);
        picture.noise(0.004, &mut random);
        let bytes = picture.bytes(Layout::GREY);
        let mut acquisition = Box::new(Acquisition::new(&Settings::default(), ratios).with_discs());
        assert!(acquisition.advance(&picture.frame(&bytes, Layout::GREY), &mut i32::MAX.clone()));
        let found = acquisition.sightings();
        assert_eq!(found.len(), diameters.len(), "{found:?}");
        for (centre, diameter) in centres.iter().zip(diameters) {
            let off = |disc: &&Sighting| (disc.at[0] - centre[0]).hypot(disc.at[1] - centre[1]);
            let disc = found.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
            assert!(off(&disc) < 0.3, "{diameter} px: {} px off", off(&disc));
            assert!((disc.diameter_px() / diameter - 1.0).abs() < 0.15, "{diameter}: {disc:?}");
        }
    }
}

#[test]
fn the_white_within_a_ring_is_no_disc() {
    let (picture, _) = rings(&[16.0, 30.0, 50.0], &mut Random::new(3));
    let bytes = picture.bytes(Layout::GREY);
    let mut acquisition = Box::new(Acquisition::new(&Settings::default(), [2.0; 2]).with_discs());
    assert!(acquisition.advance(&picture.frame(&bytes, Layout::GREY), &mut i32::MAX.clone()));
    assert!(acquisition.sightings().iter().all(|ring| ring.ratio < 3.0), "{:?}", acquisition.sightings());
    assert_eq!(acquisition.sightings().len(), 3);
}

#[test]
fn a_slanted_ring_is_measured_as_an_ellipse() {
    let mut picture = Picture::new(96, 96, 0.8);
    // Axes 40 and 30 px, turned by 30 degrees.
    let (sin, cos) = (0.5, 0.75f64.sqrt());
    picture.cover(0.1, |x, y| {
        let (u, v) = (x - 48.3, y - 47.6);
        let square = ((u * cos + v * sin) / 20.0).powi(2) + ((v * cos - u * sin) / 15.0).powi(2);
        (0.25..1.0).contains(&square)
    });
    picture.blur(0.7);
    let found = swept(&picture, Layout::GREY);
    let [ring] = found.as_slice() else { panic!("one ring, not {found:?}") };
    let expected =
        [100.0 * cos * cos + 56.25 * sin * sin, 43.75 * sin * cos, 100.0 * sin * sin + 56.25 * cos * cos];
    for (moment, expected) in ring.shape.iter().zip(expected) {
        assert!((moment - expected).abs() < 4.0, "{:?} instead of {expected:?}", ring.shape);
    }
}

#[test]
fn discs_frames_stripes_and_noise_are_no_rings() {
    let mut random = Random::new(5);
    let mut picture = Picture::new(400, 200, 0.8);
    // A disc, a square ring, two stripes, and a ring of which a fifth is covered.
    picture.cover(0.1, |x, y| (x - 60.0).hypot(y - 60.0) < 18.0);
    picture.cover(0.1, |x, y| (10.0..20.0).contains(&(x - 150.0_f64).abs().max((y - 60.0).abs())));
    picture.cover(0.1, |x, _| (220.0..230.0).contains(&x) || (240.0..250.0).contains(&x));
    picture.ring([320.0, 60.0], 40.0, 0.1);
    picture.cover(0.8, |x, y| (x - 338.0).abs() < 8.0 && (y - 60.0).abs() < 14.0);
    picture.blur(0.8);
    picture.noise(0.03, &mut random);
    assert_eq!(swept(&picture, Layout::GREY), []);
}

#[test]
fn a_sweep_in_slices_finds_what_a_sweep_at_once_finds() {
    let (picture, _) = rings(&[14.0, 30.0, 50.0], &mut Random::new(9));
    let bytes = picture.bytes(Layout::GREY);
    let frame = picture.frame(&bytes, Layout::GREY);
    let mut acquisition = Box::new(Acquisition::new(&Settings::default(), [2.0; 2]));
    let mut slices = 0;
    loop {
        let mut work = 5_000;
        slices += 1;
        if acquisition.advance(&frame, &mut work) {
            break;
        }
        assert!(acquisition.is_going());
    }
    assert!(slices > 5, "{slices} slices");
    assert_eq!(acquisition.sightings(), swept(&picture, Layout::GREY));
}

#[test]
fn faint_rings_are_found_and_fainter_than_the_settings_allow_are_not() {
    for (black, expected) in [(0.06, 1), (0.09, 0)] {
        // A tenth of the light, and a contrast below three hundredths of full scale.
        let mut picture = Picture::new(96, 96, 0.11);
        picture.ring([48.0, 48.0], 30.0, black);
        picture.blur(0.8);
        picture.noise(0.002, &mut Random::new(1));
        assert_eq!(swept(&picture, Layout::GREY).len(), expected, "black {black}");
    }
}

#[test]
fn a_part_of_a_picture_shows_its_own_rings_and_leaves_the_sweep_alone() {
    let (picture, centres) = rings(&[16.0, 20.0, 26.0], &mut Random::new(5));
    let bytes = picture.bytes(Layout::GREY);
    let frame = picture.frame(&bytes, Layout::GREY);
    let mut acquisition = Box::new(Acquisition::new(&Settings::default(), [2.0; 2]));
    let (mut found, mut work) = (heapless::Vec::new(), i32::MAX);
    let part = Part { columns: 96..192, rows: 20..500 };
    assert!(acquisition.look_in(&frame, &part, &mut found, &mut work));
    let [ring] = &found[..] else { panic!("{found:?}") };
    assert!((ring.at[0] - centres[1][0]).hypot(ring.at[1] - centres[1][1]) < 0.25, "{ring:?}");
    assert!(!acquisition.is_going() && acquisition.sightings().is_empty());
    assert!(!acquisition.look_in(&frame, &part, &mut found, &mut 0), "no work, no answer");
}
