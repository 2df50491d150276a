//! What tracking costs: rings of 17 and 36 px in windows of 2.5 diameters, sub-pixel step included. Criterion
//! prints the time a frame of `RINGS` rings and the window pixels a second; ns a window pixel and us a ring
//! follow them.

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gangway_device::{Frame, Layout};
use gangway_vision::{Illumination, Refusal, Search, Settings, Tracker};

const SIZE: usize = 640;
const RINGS: usize = 16;

/// Rings on a square of places, with soft edges and a little noise.
fn picture(diameter: f64) -> (Vec<u8>, Vec<Search>) {
    let centres: Vec<[f64; 2]> =
        (0..RINGS).map(|i| [100.3 + 140.2 * (i % 4) as f64, 100.7 + 140.1 * (i / 4) as f64]).collect();
    let mut noise = 1u32;
    let bytes = (0..SIZE * SIZE).map(|i| {
        let (x, y) = ((i % SIZE) as f64, (i / SIZE) as f64);
        let radius = centres.iter().map(|c| (x - c[0]).hypot(y - c[1])).fold(f64::MAX, f64::min);
        let edge = |r: f64| ((r - radius) / 1.5 + 0.5).clamp(0.0, 1.0);
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let grain = f64::from(noise >> 24) / 32.0 - 4.0;
        (205.0 - 175.0 * (edge(0.5 * diameter) - edge(0.25 * diameter)) + grain) as u8
    });
    let searches = centres.iter().map(|c| Search::round([c[0] + 2.3, c[1] - 1.6], diameter)).collect();
    (bytes.collect(), searches)
}

fn tracking(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("tracking");
    for diameter in [17.0, 36.0] {
        let (bytes, searches) = picture(diameter);
        let frame =
            Frame::new(&bytes, (SIZE as u16, SIZE as u16), SIZE, Layout::GREY, 0, 0).expect("a whole frame");
        let mut tracker = Box::new(Tracker::new(Settings::default()));
        let mut light = Illumination::default();
        let mut rings = [Err(Refusal::NotFound); RINGS];
        tracker.track(&frame, &searches, &mut light, &mut rings);
        assert!(rings.iter().all(Result::is_ok), "every ring is there to be measured: {rings:?}");

        let side = (Settings::default().window_diameters * diameter).ceil();
        let pixels = side * side * RINGS as f64;
        group.throughput(Throughput::Elements(pixels as u64));
        group.bench_function(format!("{RINGS} rings of {diameter} px"), |bencher| {
            bencher.iter(|| tracker.track(black_box(&frame), &searches, &mut light, &mut rings));
        });
        // The median, so that what else the machine does counts little.
        let mut rounds = [(); 501].map(|()| {
            let start = Instant::now();
            tracker.track(black_box(&frame), &searches, &mut light, &mut rings);
            start.elapsed().as_secs_f64() * 1e9
        });
        rounds.sort_by(f64::total_cmp);
        let ns = rounds[rounds.len() / 2];
        println!("  {:.2} ns per window pixel, {:.2} us per ring", ns / pixels, ns / 1e3 / RINGS as f64);
    }
    group.finish();
}

criterion_group!(benches, tracking);
criterion_main!(benches);
