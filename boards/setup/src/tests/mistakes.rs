//! Mistakes put into the example, one by one and together, and the sentences that must come of them.

use super::{said, with};

/// One mistake put into the example, and the one sentence that must come of it.
#[test]
fn every_kind_of_mistake_has_its_sentence() {
    let cases = [
        (
            "outer_diameter_mm = 42.0",
            "outer_diameter_mm = -42",
            "24: target[0].outer_diameter_mm is -42; it must be between 1 and 1000 mm",
        ),
        (
            "rate_hz = 50.0",
            "rate_hz = nan",
            "11: camera.rate_hz is nan; it must be finite and between 1 and 1000 Hz",
        ),
        (
            "rate_hz = 50.0",
            "rate_hz = -inf",
            "11: camera.rate_hz is -inf; it must be finite and between 1 and 1000 Hz",
        ),
        (
            "rate_hz = 50.0",
            "rate_hz = 1e999",
            "11: camera.rate_hz is 1e999; it must be finite and between 1 and 1000 Hz",
        ),
        (
            "rate_hz = 50.0",
            "rate_hz = \"50\"",
            "11: camera.rate_hz is \"50\"; it must be a number between 1 and 1000 Hz",
        ),
        (
            "width_px = 1920",
            "width_px = 1920.5",
            "9: camera.width_px is 1920.5; it must be a whole number between 64 and 4096 px",
        ),
        (
            "width_px = 1920",
            "width_px = 99999999999999999999999999",
            "9: camera.width_px is 99999999999999999999999999; it must be a whole number between 64 and 4096 px",
        ),
        (
            "width_px = 1920\n",
            "",
            "8: camera.width_px is missing; it must be a whole number between 64 and 4096 px",
        ),
        ("width_px = 1920", "widht_px = 1920", "9: camera.widht_px is not a setting; did you mean width_px?"),
        ("[camera]", "[kamera]", "8: kamera is not a setting; did you mean camera?"),
        ("[rest]", "[rest]\ngate_px = 1.0", "111: rest.gate_px is not a setting; it belongs below [solver]"),
        (
            "[rest]",
            "[rest]\ncolour = 1",
            "111: rest.colour is not a setting; known here: frames, excursion_px, drift_px, layout_mm",
        ),
        (
            "focal_px = [1468.0, 1467.2]",
            "focal_px = 1468.0",
            "12: camera.focal_px is 1468.0; it must be a list of 2 numbers, each between 10 and 200000 px",
        ),
        (
            "focal_px = [1468.0, 1467.2]",
            "focal_px = [1468.0,\n 0]",
            "13: camera.focal_px[1] is 0; it must be between 10 and 200000 px",
        ),
        (
            "name = \"middle\"",
            "name = \"\"",
            "22: target[0].name is \"\"; it must be a text of 1 to 32 bytes without control characters",
        ),
        (
            "name = \"ride\"",
            "name = \"a name of the box beyond 32 bytes\"",
            "6: name is \"a name of the box beyond 32 bytes\"; it must be a text of 1 to 32 bytes without control \
             characters",
        ),
        (
            "name = \"ride\"",
            "name = \"a\\nb\"",
            "6: name is \"a\\nb\"; it must be a text of 1 to 32 bytes without control characters",
        ),
        (
            "name = \"left\"",
            "name = \"middle\"",
            "46: target[1].name is \"middle\", as target[0] is already; no two names may be alike",
        ),
        (
            "# carbody = 2",
            "carbody = 3",
            "40: target[0].carbody is 3; it must be a whole number between 1 and 2",
        ),
        (
            "# kind = \"printed\"",
            "kind = \"led\"",
            "25: target[0].inner_diameter_mm is 21; a disc has no inner edge, leave it out",
        ),
        (
            "# lamps = \"on\"",
            "lamps = \"alternate\"",
            "139: board.lamps is \"alternate\", switched between two exposures; give camera.exposure_ms",
        ),
        (
            "# exposure = \"fixed\"",
            "exposure = \"auto\"",
            "131: capture.exposure is \"auto\", up to camera.exposure_ms; give camera.exposure_ms",
        ),
        (
            "# kind = \"printed\"",
            "kind = \"painted\"",
            "41: target[0].kind is \"painted\"; it must be \"printed\" or \"led\"",
        ),
        (
            "u = [-0.34202, -0.93969, 0.0]",
            "u = [-0.34202, -0.9, 0.0]",
            "72: target[2].u is 0.9628 long; it must be a unit vector, to within 0.001",
        ),
        (
            "# v = [0.0, 0.0, 1.0]",
            "v = [0.0, -0.6, 0.8]",
            "43: target[0].u and v are not at right angles: u.v is 0.6000; it must be 0, to within 0.001",
        ),
        (
            "inner_diameter_mm = 21.0",
            "inner_diameter_mm = 42",
            "25: target[0].inner_diameter_mm is 42; it must be below outer_diameter_mm, 42 mm",
        ),
        (
            "[0.0, 0.0],\n    [-60.0, -62.0],",
            "[0.0, 0.0],\n    [20.0, 21.0],",
            "30: target[0].circles_mm[3] overlaps circles_mm[2]: their centres are 29.0 mm apart; it must be more \
             than outer_diameter_mm, 42 mm",
        ),
        (
            "    [926.7, 261.6],\n",
            "",
            "33: target[0].seeds_px has 4 pairs for 5 circles; it must have one a circle, or be left out",
        ),
        (
            "[926.7, 261.6]",
            "[926.7, 1080.6]",
            "34: target[0].seeds_px[0] is [926.7, 1080.6]; it must be within the picture of 1920 x 1080 px",
        ),
        (
            "[926.7, 261.6]",
            "[926.7]",
            "34: target[0].seeds_px[0] is [926.7]; it must be a pair of numbers [u, v]",
        ),
        (
            "[926.7, 261.6]",
            "[926.7, true]",
            "34: target[0].seeds_px[0][1] is true; it must be a number between -0.5 and 4095.5 px",
        ),
        (
            "# window_diameters = 2.5",
            "window_diameters = 12",
            "96: tracker.window_diameters is 12; it must be between 2 and 3 diameters",
        ),
        ("# median = true", "median = 1", "97: tracker.median is 1; it must be true or false"),
        (
            "# method = \"auto\"",
            "method = \"p3p\"",
            "105: solver.method is \"p3p\"; it must be \"auto\" or \"dlt\" or \"epnp\"",
        ),
        (
            "# min_circles = 4",
            "min_circles = 20",
            "106: solver.min_circles is 20; it must be 19 at most, as there are no more circles",
        ),
        (
            "# x_mm = [-70.0, 60.0]",
            "x_mm = [60.0, -70.0]",
            "117: limits.x_mm is [60.0, -70.0]; it must be [least, greatest], two numbers between -5000 and 5000 mm, \
             the least below the greatest",
        ),
        (
            "# x_mm = [-70.0, 60.0]",
            "x_mm = [10.0, 60.0]",
            "117: limits.x_mm goes from 10 to 60 mm; 0, the rest pose, must be within",
        ),
        (
            "distortion = [-0.0684,",
            "distortion = [-2.0684,",
            "14: camera.distortion is not invertible at pixel [0, 0]; it must be everywhere in the picture: check \
             the order k1, k2, p1, p2, k3 and the signs",
        ),
        (
            "# line_time_us = 0.0",
            "line_time_us = 30",
            "16: camera.line_time_us is 30; 1080 rows then take 32.4 ms, longer than a frame; it must be at most \
             18.52 us",
        ),
        (
            "# exposure_ms = 0.0",
            "exposure_ms = 25",
            "17: camera.exposure_ms is 25, longer than a frame; it must be at most 20.00 ms",
        ),
        ("rate_hz = 50.0", "rate_hz = fifty", "11: this is not TOML at fifty: "),
        ("name = \"ride\"", "name = \"ride", "6: this is not TOML: "),
        ("rate_hz = 50.0", "rate_hz = [50.0", "12: this is not TOML: "),
        ("skew_px", "\nrate_hz = 2 #", "16: this is not TOML at rate_hz: duplicate key"),
    ];
    for (from, to, sentence) in cases {
        let said = said(&with(from, to));
        let expected = format!("ride.toml:{sentence}");
        // How the parser puts it may change; where it is and that it is one line must not.
        if sentence.contains("not TOML") {
            assert!(said.starts_with(&expected), "{said}");
            assert_eq!(said.lines().count(), 1, "{said}");
        } else {
            assert_eq!(said, expected);
        }
    }
}

#[test]
fn lamps_that_alternate_need_a_gap_between_two_exposures() {
    let text = |exposure: &str, line_time: &str| {
        with("# lamps = \"on\"", "lamps = \"alternate\"")
            .replace("# exposure_ms = 0.0", exposure)
            .replace("# line_time_us = 0.0", line_time)
    };
    assert_eq!(said(&text("exposure_ms = 18.9", "")), "good");
    assert_eq!(
        said(&text("exposure_ms = 19.0", "")),
        "ride.toml:139: board.lamps is \"alternate\", but camera.exposure_ms is 19; it must be below 19.00 ms, so that 1 \
         ms are left between two exposures"
    );
    assert_eq!(said(&text("exposure_ms = 3.0", "line_time_us = 14.0")), "good");
    assert_eq!(
        said(&text("exposure_ms = 3.0", "line_time_us = 18.0")),
        "ride.toml:139: board.lamps is \"alternate\", but the rows of a frame take 19.4 of its 20.0 ms; 1 ms must be left \
         between two exposures: take fewer frames a second or \"on\""
    );
}

#[test]
fn all_mistakes_of_a_file_are_told_at_once() {
    let text = with("rate_hz = 50.0", "rate_hz = 0")
        .replace("inner_diameter_mm = 21.0", "inner_diameter_mm = 84.0")
        .replace("[rest]\nframes = 25", "[rest]\nframse = 25");
    let said = said(&text);
    let lines: Vec<&str> = said.lines().map(|line| line.split(' ').next().unwrap()).collect();
    assert_eq!(
        lines,
        ["ride.toml:11:", "ride.toml:25:", "ride.toml:49:", "ride.toml:75:", "ride.toml:111:"],
        "{said}"
    );
}

#[test]
fn what_is_missing_as_a_whole_is_named() {
    assert_eq!(said(" \n\n"), "ride.toml: is empty; a setup says at least name, [camera] and one [[target]]");
    let said = said("# nothing here\n");
    assert!(
        said.contains("name is missing")
            && said.contains("[camera] is missing; it must say width_px, height_px")
    );
    assert!(said.contains("[[target]] is missing; at least one is needed"), "{said}");
    assert_eq!(said.lines().count(), 3, "{said}");
}

#[test]
fn tables_of_the_wrong_shape_are_refused() {
    let camera = with("name = \"ride\"", "tracker = 3\nname = \"ride\"").replace("[tracker]\n", "");
    assert_eq!(said(&camera), "ride.toml:6: tracker is 3; it must be a table, [tracker]");
    let head = "name = \"ride\"\ntarget = [1]\n[camera]\nwidth_px=640\nheight_px=480\nrate_hz=25\n\
                focal_px=[900,900]\nprincipal_px=[320,240]\n";
    assert_eq!(said(head), "ride.toml:2: target[0] is 1; it must be a table, [[target]]");
    let one = head.replace("target = [1]", "target = {}");
    assert_eq!(
        said(&one),
        "ride.toml:2: target is a table; it must be a list of tables: each target below its own [[target]]"
    );
}
