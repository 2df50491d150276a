//! What an evaluation must hold, by numbers that are worked out by hand.

use std::path::Path;

use gangway_wire::PoseFlags;
use resvg::{tiny_skia, usvg};

use crate::testing::ride;
use crate::{Measured, Page, Reference, Sample, evaluate, html, plots};

/// A pose whose x and yaw are given; sigma is 0.11 mm and 0.011 degrees.
fn sample(frame: u32, x: f64, yaw: f64) -> Sample {
    let measured = Measured {
        values: [x, 0.0, 0.0, 0.0, 0.0, yaw],
        sigmas: [0.11, 0.11, 0.11, 0.011, 0.011, 0.011],
        residual_px: 0.02,
    };
    Sample {
        frame,
        time_ns: u64::from(frame) * 20_000_000,
        measured: Some(measured),
        markers: 15,
        flags: PoseFlags::default(),
    }
}

/// The deviations of x are 0.1, -0.2, 0.3 and 0.2 mm, and frame 3 stands 0.9 degrees beyond the half circle.
fn four() -> (Vec<Sample>, Reference) {
    let samples = [sample(1, 1.1, 0.0), sample(2, 1.8, 0.0), sample(3, 3.3, -179.6), sample(4, 4.2, 0.0)];
    let truth = [(1, 1.0, 0.0), (2, 2.0, 0.0), (3, 3.0, 179.5), (4, 4.0, 0.0)];
    let truth = truth.map(|(frame, x, yaw)| (frame, [x, 0.0, 0.0, 0.0, 0.0, yaw]));
    (samples.to_vec(), Reference::new("truth.csv", truth).unwrap())
}

/// Numbers as 0.1 are not exact in binary: half a dozen operations on them differ in the last few bits.
const ROUNDING: f64 = 1e-12;

fn assert_close(computed: f64, by_hand: f64) {
    assert!((computed - by_hand).abs() < ROUNDING, "{computed} is not {by_hand}");
}

#[test]
fn statistics_are_those_worked_out_by_hand() {
    let (samples, reference) = four();
    let evaluation = evaluate("ride", &samples, Some(&reference)).unwrap();
    let [x, y, .., yaw] = evaluation.deviation.unwrap();

    // Sum 0.4, so MEAN 0.1; squares 0.01 + 0.04 + 0.09 + 0.04 = 0.18, so RMSE = sqrt(0.045);
    // about the mean 0, 0.09, 0.04, 0.01 = 0.14, so STD = sqrt(0.035).
    assert_close(x.max, 0.3);
    assert_eq!(x.max_frame, 3);
    assert_close(x.mean, 0.1);
    assert_close(x.rmse, 0.045f64.sqrt());
    assert_close(x.std, 0.035f64.sqrt());
    assert!(x.within_limit);

    // -179.6 less 179.5 is 0.9 the short way round, over the 0.6 degrees of R(a).
    assert_close(yaw.max, 0.9);
    assert!(!yaw.within_limit);

    assert_eq!((y.max, y.rmse, y.std), (0.0, 0.0, 0.0));
}

#[test]
fn shares_count_frames_within_their_own_sigma() {
    let (mut samples, reference) = four();
    // |e| / sigma of x: 0.1 / 0.11, 0.2 / 0.11, 0.3 / 0.11, 0.2 / 0.5.
    for (sample, sigma) in samples.iter_mut().zip([0.11, 0.11, 0.11, 0.5]) {
        sample.measured.as_mut().unwrap().sigmas[0] = sigma;
    }
    let x = &evaluate("ride", &samples, Some(&reference)).unwrap().deviation.unwrap()[0];
    assert_eq!(x.within_sigma, Some([0.5, 0.75, 1.0]));

    for sample in &mut samples {
        sample.measured.as_mut().unwrap().sigmas[0] = 0.0;
    }
    let x = &evaluate("ride", &samples, Some(&reference)).unwrap().deviation.unwrap()[0];
    assert_eq!(x.within_sigma, None, "no frame states a sigma");
}

#[test]
fn the_table_is_the_one_on_paper() {
    let (samples, reference) = four();
    let table = evaluate("rides/monday", &samples, Some(&reference)).unwrap().table();
    let expected = "\
Deviations of monday from truth.csv

              MAX   RMSE   MEAN    STD  at frame   R(a)            1 sigma  2 sigma  3 sigma
x      mm   0.300  0.212  0.100  0.187         3   +-10      kept   25.0 %   75.0 %  100.0 %
";
    assert!(table.starts_with(expected), "{table}");
    let yaw =
        "yaw    deg  0.900  0.450  0.225  0.390         3  +-0.6  NOT kept   75.0 %   75.0 %   75.0 %\n";
    assert!(table.contains(yaw), "{table}");
    assert!(table.contains("Frames: 4 in all, 4 compared, 0 waiting"), "{table}");
    assert!(table.contains("50.00 frames/s (R(a) asks for 25 or more: kept)"), "{table}");
}

#[test]
fn waiting_frames_are_left_out_and_counted() {
    let (mut samples, reference) = four();
    samples[2].flags = PoseFlags::WAITING;
    let evaluation = evaluate("ride", &samples, Some(&reference)).unwrap();
    assert_eq!((evaluation.frames.all, evaluation.frames.waiting, evaluation.frames.compared), (4, 1, 3));
    assert_close(evaluation.deviation.unwrap()[0].max, 0.2);
}

#[test]
fn frames_without_a_pose_are_counted_and_so_is_the_longest_stretch_of_them() {
    let samples: Vec<Sample> = [1, 2, 3, 4, 5, 8, 9]
        .map(|frame| {
            let mut sample = sample(frame, 0.0, 0.0);
            if [3, 4].contains(&frame) {
                (sample.measured, sample.flags) = (None, PoseFlags::FEW_MARKERS);
            }
            if frame >= 4 {
                sample.flags |= PoseFlags::DARK;
            }
            sample
        })
        .to_vec();
    // The reference lacks frame 9, and has 6 and 7, which the session lost, and 0 and 20, which lie outside
    // of it.
    let reference =
        Reference::new("truth.csv", [0, 1, 2, 3, 4, 5, 6, 7, 8, 20].map(|f| (f, [0.0; 6]))).unwrap();
    let evaluation = evaluate("ride", &samples, Some(&reference)).unwrap();
    let frames = evaluation.frames;
    assert_eq!((frames.all, frames.compared, frames.without_pose, frames.unlit), (7, 4, 2, 1));
    let said = "2 without a pose (1 of them while the lamps were dark or switched), 1 not in the truth.";
    assert!(evaluation.table().contains(said), "{}", evaluation.table());
    assert_eq!((frames.not_in_reference, frames.not_in_session), (1, 2));
    assert_eq!(evaluate("ride", &samples, None).unwrap().longest_gap_frames, 2);
    assert_eq!(evaluate("ride", &samples[..4], None).unwrap().longest_gap_frames, 2, "the gap is at the end");
}

#[test]
fn a_pose_that_is_not_a_number_counts_as_none() {
    let (mut samples, reference) = four();
    samples[1].measured.as_mut().unwrap().values[4] = f64::NAN;
    let evaluation = evaluate("ride", &samples, Some(&reference)).unwrap();
    assert_eq!((evaluation.frames.compared, evaluation.frames.without_pose), (3, 1));
}

#[test]
fn without_a_reference_the_motion_is_described() {
    let (samples, _) = four();
    let evaluation = evaluate("rides/monday", &samples, None).unwrap();
    let x = &evaluation.motion[0];
    // 1.1, 1.8, 3.3, 4.2: mean 2.6; about it 2.25 + 0.64 + 0.49 + 2.56 = 5.94.
    assert_close(x.mean, 2.6);
    assert_close(x.std, (5.94f64 / 4.0).sqrt());
    assert_eq!((x.min, x.max, x.sigma_median), (1.1, 4.2, Some(0.11)));
    assert!(evaluation.deviation.is_none() && plots::deviations(&evaluation).is_none());
    assert!(evaluation.table().starts_with("Motions of monday, without a reference\n"));
}

#[test]
fn nothing_to_evaluate_is_one_sentence() {
    let (samples, reference) = four();
    let message = |samples: &[Sample]| evaluate("ride", samples, Some(&reference)).unwrap_err().to_string();
    assert_eq!(message(&[]), "ride: there are no frames in it, so there is nothing to evaluate");

    let waiting: Vec<Sample> = samples.iter().map(|s| Sample { flags: PoseFlags::WAITING, ..*s }).collect();
    assert_eq!(
        message(&waiting),
        "ride: none of its 4 frames has a pose (4 waited for the rest pose, which takes at least 10 frames at rest \
         with the targets in sight); its events say what was lost"
    );

    let later: Vec<Sample> = samples.iter().map(|s| Sample { frame: s.frame + 100, ..*s }).collect();
    assert_eq!(
        message(&later),
        "no frame of ride that has a pose is in truth.csv: measured are frames 101 to 104, \
         truth.csv has 1 to 4; are both of the same ride?"
    );
}

#[test]
fn the_json_is_the_golden_one() {
    let (samples, reference) = four();
    let evaluation = evaluate("rides/monday", &samples, Some(&reference)).unwrap();
    assert_eq!(shape(&evaluation.to_json()), include_str!("tests/evaluation.shape.json"));
    let alone = evaluate("rides/monday", &samples, None).unwrap();
    assert!(
        alone.to_json().contains("\"reference\": null") && alone.to_json().contains("\"deviation\": null")
    );
}

/// The document with every number that has a fraction written to nine places: the last bits are not pinned.
fn shape(json: &str) -> String {
    let line = |line: &str| match line.trim_end_matches(',').rsplit_once(' ') {
        Some((before, number)) if number.contains('.') && number.parse::<f64>().is_ok() => {
            let comma = if line.ends_with(',') { "," } else { "" };
            format!("{before} {:.9}{comma}\n", number.parse::<f64>().unwrap())
        }
        _ => format!("{line}\n"),
    };
    json.lines().map(line).collect()
}

#[test]
fn pictures_are_well_formed_and_of_their_size() {
    let (mut samples, reference) = ride(250);
    for sample in &mut samples[100..130] {
        (sample.measured, sample.flags) = (None, PoseFlags::FEW_MARKERS);
    }
    samples[140].flags |= PoseFlags::OUTLIERS;
    let evaluation = evaluate("a < b & \"c\"", &samples, Some(&reference)).unwrap();
    for picture in [plots::motions(&evaluation), plots::deviations(&evaluation).unwrap()] {
        let document = usvg::roxmltree::Document::parse(picture.svg()).unwrap();
        let texts: Vec<&str> = document.descendants().filter_map(|n| n.text()).collect();
        for text in ["x / mm", "yaw / °", "time since the first frame / s", "no pose", "outliers"] {
            assert!(texts.contains(&text), "{text} is missing");
        }
        assert!(texts.iter().any(|t| t.starts_with("a < b & \"c\"")));

        let png = tiny_skia::Pixmap::decode_png(&picture.png().unwrap()).unwrap();
        assert_eq!((png.width(), png.height()), (plots::WIDTH_PX, picture.height_px()));
        let ink = png.pixels().iter().filter(|p| p.red() < 200).count();
        assert!(ink > 10_000, "next to nothing is drawn: {ink} px");
    }
}

#[test]
fn the_picture_of_a_long_ride_stays_small() {
    let (samples, reference) = ride(120_000);
    let evaluation = evaluate("forty minutes", &samples, Some(&reference)).unwrap();
    for picture in [plots::motions(&evaluation), plots::deviations(&evaluation).unwrap()] {
        // Two points a column, 1,400 columns, four series at most, six panels, 8 to 10 bytes a point, and the
        // fonts.
        assert!(picture.svg().len() < 800_000, "{} bytes", picture.svg().len());
    }
}

#[test]
fn a_single_frame_and_a_clock_that_stands_still_give_pictures() {
    let (samples, reference) = four();
    let stopped: Vec<Sample> = samples.iter().map(|s| Sample { time_ns: 7, ..*s }).collect();
    for samples in [&samples[..1], &stopped] {
        let evaluation = evaluate("ride", samples, Some(&reference)).unwrap();
        for picture in [plots::motions(&evaluation), plots::deviations(&evaluation).unwrap()] {
            assert!(!picture.svg().contains("NaN") && !picture.svg().contains("inf"));
            picture.png().unwrap();
        }
    }
}

#[test]
fn the_report_is_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let (samples, reference) = four();
    let evaluation = evaluate("ride", &samples, Some(&reference)).unwrap();
    let out = folder.path().join("made/for/it");
    let written = evaluation.write_all(&out).unwrap();
    let mut names: Vec<_> = std::fs::read_dir(&out).unwrap().map(|f| f.unwrap().path()).collect();
    names.sort();
    let mut expected = written.clone();
    expected.sort();
    assert_eq!(names, expected, "temporary files are gone");
    assert_eq!(written.len(), 6);
    assert_eq!(std::fs::read_to_string(out.join("evaluation.txt")).unwrap(), evaluation.table());

    // A file stands where the folder should be.
    let error = evaluation.write_all(&out.join("evaluation.txt")).unwrap_err().to_string();
    assert!(error.contains("cannot be written") && error.contains("--out"), "{error}");
}

#[test]
fn the_page_shows_table_and_pictures_without_scripts() {
    let (samples, reference) = four();
    let evaluation = evaluate("ride", &samples, Some(&reference)).unwrap();
    let page = Page {
        title: "Ride <1>".to_owned(),
        about: "A & B".to_owned(),
        made: vec![("Scene".to_owned(), "ride".to_owned())],
        files: vec![("truth.csv".to_owned(), "the exact motion".to_owned())],
        pictures: "evaluation".to_owned(),
    };
    let text = html(&evaluation, &page);
    for part in
        ["Ride &lt;1&gt;", "A &amp; B", "src=\"evaluation/motions.svg\"", "src=\"evaluation/deviations.svg\""]
    {
        assert!(text.contains(part), "{part} is missing");
    }
    assert!(text.contains("<td class=\"bad\">NOT kept</td>"));
    assert!(!text.contains("<script") && !text.contains("http"));
    let alone = html(&evaluate("ride", &samples, None).unwrap(), &page);
    assert!(!alone.contains("deviations.svg") && alone.contains("motions.svg"));
}

mod reference {
    use super::*;

    const HEADER: &str = "frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n";

    fn parse(text: &str) -> Result<Reference, String> {
        Reference::parse(text.as_bytes(), "truth.csv").map_err(|e| e.to_string())
    }

    fn refused(rows: &str) -> String {
        parse(&format!("{HEADER}{rows}")).unwrap_err()
    }

    #[test]
    fn columns_are_found_by_name_in_any_order_and_style() {
        let values = [1.5, -2.0, 3.0, 0.1, 0.2, 0.3];
        let files = [
            "frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n7,1.5,-2,3,0.1,0.2,0.3\n",
            "\u{feff}time_ns;yaw_deg;Frame;X [mm];y_mm;z_mm;Roll (°);Pitch [deg]\r\n20;0.3;7;1.5;-2;3;.1;2e-1\r\n",
            "frame\tx_mm\ty_mm\tz_mm\troll_deg\tpitch_deg\tyaw_deg\tx_sigma_mm\n7\t1.5\t-2\t3\t0.1\t0.2\t0.3\t9\n",
            "\n\"frame\", dx_mm , dy_mm, dz_mm, roll_deg, pitch_deg, yaw_deg\n\n7, 1.5, -2, 3, 0.1, 0.2, 0.3",
        ];
        for file in files {
            let reference = parse(file).unwrap();
            assert_eq!(reference.at(7), Some(values), "{file}");
            assert_eq!(reference.frames(), (7, 7));
        }
    }

    #[test]
    fn a_row_without_values_says_that_the_frame_has_no_truth() {
        let reference = parse(&format!("{HEADER}0,,,,,,\n1,0,0,0,0,0,0\n")).unwrap();
        assert_eq!((reference.at(0), reference.at(1)), (None, Some([0.0; 6])));
    }

    #[test]
    fn a_header_that_lacks_or_doubles_a_column_is_refused() {
        assert_eq!(
            parse("frame,dx_m,dy_m,dz_m,roll_rad,pitch_rad,yaw_rad\n0,0,0,0,0,0,0\n").unwrap_err(),
            "truth.csv, line 1: the column dx_mm or x_mm is missing; \
             the header has: frame, dx_m, dy_m, dz_m, roll_rad, pitch_rad, yaw_rad"
        );
        assert_eq!(
            parse("frame,dx_mm,x_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n").unwrap_err(),
            "truth.csv, line 1: the columns dx_mm and x_mm mean the same; take one out"
        );
        assert!(parse("0,0,0,0,0,0,0\n").unwrap_err().contains("the column frame is missing"));
    }

    #[test]
    fn a_wrong_cell_is_named_by_line_and_column() {
        let good = "0,0,0,0,0,0,0\n";
        assert_eq!(
            refused(&format!("{good}1,0,0,zero,0,0,0\n")),
            "truth.csv, line 3, column dz_mm: \"zero\" is not a number in mm; expected is one such as -12.5"
        );
        assert_eq!(
            // Empty lines count as lines.
            refused(&format!("{good}\n\r\n1,0,0,0,0,0,nan\n")),
            "truth.csv, line 5, column yaw_deg: \"nan\" is not a number in deg; expected is one such as -12.5"
        );
        assert_eq!(
            refused("1.5,0,0,0,0,0,0\n"),
            "truth.csv, line 2, column frame: \"1.5\" is not a frame number; expected is a whole number from 0"
        );
        assert_eq!(
            refused(&format!("{good}1,0,0\n")),
            "truth.csv, line 3, column dz_mm: the line ends before it, after 3 of its cells"
        );
        assert_eq!(
            refused(&format!("{good}1,0,,0,0,0,0\n")),
            "truth.csv, line 3, column dy_mm: the cell is empty; a row has all six values or none of them"
        );
        assert_eq!(
            refused(&format!("{good}{good}")),
            "truth.csv, line 3, column frame: frame 0 is given on line 2 already; each frame has one row"
        );
    }

    #[test]
    fn rubbish_is_refused_and_never_panics() {
        for rubbish in [&b""[..], b"\n\n", b"\xff\xfe\x00", b"\"", b"frame", b"\x89PNG\r\n\x1a\n\x00\x00"] {
            Reference::parse(rubbish, "truth.csv").unwrap_err();
        }
        assert_eq!(
            refused(""),
            "truth.csv: there is no truth in it, only a header; expected is one row a frame"
        );
        let error = Reference::read(Path::new("no/such/truth.csv")).unwrap_err().to_string();
        assert!(error.starts_with("no/such/truth.csv: cannot be read: "), "{error}");
    }
}
