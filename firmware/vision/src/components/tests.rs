//! What must hold of components, against a naive flood fill.

use super::*;
use crate::synthetic::Random;
use std::boxed::Box;
use std::vec::Vec;

/// Components by flood fill: (area, sum x, sum y, touches the edge) of each, sorted.
fn flood(
    width: usize,
    height: usize,
    dark: impl Fn(usize, usize) -> bool,
    diagonal: bool,
) -> Vec<(u32, u32, u32, bool)> {
    let mut seen = std::vec![false; width * height];
    let mut out = Vec::new();
    for i in 0..width * height {
        if seen[i] || !dark(i % width, i / width) {
            continue;
        }
        let (mut stack, mut sums) = (std::vec![i], (0, 0, 0, false));
        seen[i] = true;
        while let Some(i) = stack.pop() {
            let (x, y) = (i % width, i / width);
            sums.0 += 1;
            sums.1 += x as u32;
            sums.2 += y as u32;
            sums.3 |= x == 0 || y == 0 || x == width - 1 || y == height - 1;
            for dy in -1isize..=1 {
                for dx in -1isize..=1 {
                    let (nx, ny) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
                    let near = diagonal || dx == 0 || dy == 0;
                    if near && nx < width && ny < height && dark(nx, ny) && !seen[ny * width + nx] {
                        seen[ny * width + nx] = true;
                        stack.push(ny * width + nx);
                    }
                }
            }
        }
        out.push(sums);
    }
    out.sort_unstable();
    out
}

/// Area and first moments.
type Sums = (u32, u32, u32);

/// Every ring's hole and dark component.
fn rings(bits: &Bits) -> Result<Vec<[Sums; 2]>, Clutter> {
    let mut components = Box::new(Components::new());
    components.find(bits)?;
    let mut out = Vec::new();
    while let Some((hole, filled)) = components.next_ring(bits, 0.0)? {
        out.push([hole, filled.without(&hole)].map(sums));
    }
    Ok(out)
}

fn sums(part: Part) -> Sums {
    (part.area, part.sums[0], part.sums[1])
}

fn check(bits: &Bits) {
    let (width, height) = (bits.width(), bits.height());
    let dark = flood(width, height, |x, y| bits.get(x, y), true);
    let bright = flood(width, height, |x, y| !bits.get(x, y), false);
    let mut holes: Vec<_> = bright.iter().filter(|c| !c.3).map(|&(a, x, y, _)| (a, x, y)).collect();
    let mut found = rings(bits).unwrap();
    for [_, around] in &found {
        assert!(dark.iter().any(|&(a, x, y, _)| (a, x, y) == *around), "{around:?}");
    }
    found.sort_unstable();
    holes.sort_unstable();
    assert_eq!(found.iter().map(|[hole, _]| *hole).collect::<Vec<_>>(), holes);

    let mut components = Box::new(Components::new());
    let mut rings_of = |is_dark: bool| -> Vec<_> {
        let pixels = (0..width * height).map(|i| (i % width, i / width));
        pixels
            .filter(|&(x, y)| bits.get(x, y) == is_dark)
            .filter_map(|(x, y)| components.ring_at(bits, [x as f64, y as f64]))
            .map(|(hole, filled)| [hole, filled.without(&hole)].map(sums))
            .collect()
    };
    assert!(rings_of(true).iter().all(|ring| found.contains(ring)));
    let mut about = rings_of(false);
    let holes: u32 = holes.iter().map(|hole| hole.0).sum();
    assert_eq!(about.len(), holes as usize, "every pixel of a hole tells its ring");
    about.sort_unstable();
    about.dedup();
    assert_eq!(about, found);

    components.find(bits).unwrap();
    let (mut all, mut count) = (Vec::new(), 0);
    components.each_dark(bits, |part| {
        all.push((part.area, part.sums[0], part.sums[1]));
        count += 1;
    });
    all.sort_unstable();
    let wanted: Vec<_> = dark.iter().map(|&(a, x, y, _)| (a, x, y)).collect();
    if wanted.len() <= MAX_HOLES {
        assert_eq!(all, wanted);
    }
}

#[test]
fn holes_and_what_is_around_them_are_those_of_a_flood_fill() {
    let mut random = Random::new(11);
    for (width, height) in
        [(1, 1), (1, 9), (9, 1), (30, 30), (63, 20), (64, 20), (65, 20), (128, 9), (192, 12)]
    {
        for share in [10u64, 30, 50, 70, 90] {
            let dark: Vec<bool> = (0..width * height).map(|_| random.next() % 100 < share).collect();
            check(&Bits::of(width, height, |x, y| dark[y * width + x]));
        }
    }
}

#[test]
fn what_winds_is_followed_and_what_winds_without_end_is_clutter() {
    // Nested rectangles joined at one place.
    let nested = |side: usize| {
        Bits::of(side, side, |x, y| {
            let ring = x.min(y).min(side - 1 - x).min(side - 1 - y);
            ring % 2 == 0 || (x == side / 2 && y > side / 2)
        })
    };
    check(&nested(41));
    // A bright path that comes in at a corner and goes down and up over the whole window, between walls that
    // stop short in turn.
    let (width, height) = (121, 60);
    let wall = |x: usize, y: usize| {
        let edge = x == 0 || y == 0 || x == width - 1 || y == height - 1;
        let gap = if x % 4 == 2 { height - 2 } else { 1 };
        if edge { (x, y) != (1, 0) } else { x.is_multiple_of(2) && y != gap }
    };
    assert_eq!(rings(&Bits::of(width, height, wall)), Err(Clutter));
}

#[test]
fn a_ring_on_a_sheet_with_dark_around_it_is_found() {
    let radius = |x: usize, y: usize| (x as f64 - 20.0).hypot(y as f64 - 20.0);
    let dark = |x: usize, y: usize| radius(x, y) > 16.0 || (5.0..10.0).contains(&radius(x, y));
    let bits = Bits::of(41, 41, dark);
    let mut components = Box::new(Components::new());
    components.find(&bits).unwrap();
    let found: Vec<_> = core::iter::from_fn(|| components.next_ring(&bits, 1.0).unwrap()).collect();
    // The white of the sheet is a hole in the dark, and the ring's own disc is one in the ring.
    assert_eq!(found.len(), 2);
    assert!(found[0].1.touches_edge([41, 41]) && !found[1].1.touches_edge([41, 41]));
}

#[test]
fn moments_are_those_of_the_pixels() {
    let radius = |x: usize, y: usize| (x as f64 - 20.3).hypot(y as f64 - 17.8);
    let bits = Bits::of(40, 36, |x, y| (4.0..9.5).contains(&radius(x, y)));
    let mut components = Box::new(Components::new());
    components.find(&bits).unwrap();
    let (hole, filled) = components.next_ring(&bits, 1.0).unwrap().unwrap();
    assert_eq!((hole.low, hole.high), ([17, 14], [24, 21]));
    assert_eq!((filled.low, filled.high), ([11, 9], [29, 27]));
    let (area, centre, moments) = (f64::from(filled.area), filled.centroid(), filled.moments());
    let pixels = || (0..36 * 40).map(|i| (i % 40, i / 40)).filter(|&(x, y)| radius(x, y) < 9.5);
    let count = pixels().count() as f64;
    let mean =
        |of: &dyn Fn(f64, f64) -> f64| pixels().map(|(x, y)| of(x as f64, y as f64)).sum::<f64>() / count;
    let [cx, cy] = [mean(&|x, _| x), mean(&|_, y| y)];
    let naive = [
        mean(&|x, _| (x - cx) * (x - cx)),
        mean(&|x, y| (x - cx) * (y - cy)),
        mean(&|_, y| (y - cy) * (y - cy)),
    ];
    assert_eq!(area, count);
    assert!((centre[0] - cx).abs() < 1e-9 && (centre[1] - cy).abs() < 1e-9);
    // Differences of numbers some hundred times as large.
    assert!(moments.iter().zip(naive).all(|(a, b)| (a - b).abs() < 1e-9), "{moments:?} {naive:?}");
}

#[test]
fn a_pixel_of_the_dark_tells_the_ring_that_one_of_the_hole_tells() {
    let radius = |x: usize, y: usize| (x as f64 - 20.3).hypot(y as f64 - 17.6);
    let bits = Bits::of(40, 36, |x, y| (4.0..9.5).contains(&radius(x, y)));
    let mut components = Box::new(Components::new());
    let ring = components.ring_at(&bits, [20.0, 18.0]);
    assert!(ring.is_some());
    for at in [[14.0, 18.0], [26.0, 20.0], [20.0, 10.0], [16.0, 23.0]] {
        assert_eq!(components.ring_at(&bits, at), ring);
    }
    assert_eq!(components.ring_at(&bits, [3.0, 3.0]), None);
}
