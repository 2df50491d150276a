//! Formats, sizes and rates of a real device, as `gangway-pi check` tells of them.

use e2e::guest::Guest;

use crate::show::{RATE_HZ, Show};

/// A vivid device of 1280 x 720 makes so many pictures a second.
const VIVID_HZ: u32 = 10;

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn every_format_is_read_from_a_real_device_and_what_it_does_not_have_is_refused() {
    let setup = Show::setup_of_size(1280, 720)
        .replace(&format!("rate_hz = {RATE_HZ}.0"), &format!("rate_hz = {VIVID_HZ}.0"));
    let wanted = [
        ("auto", "Y12, 12 bits"),
        ("grey", "GREY, 8 bits"),
        ("y10", "Y10, 10 bits"),
        ("y16", "Y16, 16 bits"),
        ("yuyv", "YUYV, 8 bits"),
        ("uyvy", "UYVY, 8 bits"),
        ("nv12", "NV12, 8 bits"),
        ("bayer", "RGGB, 8 bits"),
    ];
    let mut setups: Vec<(String, String)> = wanted
        .iter()
        .map(|(format, _)| (format!("{format}.toml"), format!("{setup}\n[capture]\nformat = \"{format}\"\n")))
        .collect();
    let refused = [
        (
            "packed",
            format!("{setup}\n[capture]\nformat = \"y12p\"\n"),
            "/dev/video0 has no format y12p; it has ",
        ),
        (
            "size",
            setup.replace("width_px = 1280", "width_px = 1000"),
            "does not give 1000 x 720 at 10 Hz as the setup asks",
        ),
        ("rate", setup.replace("rate_hz = 10.0", "rate_hz = 7.0"), " frames/s"),
    ];
    setups.extend(refused.iter().map(|(name, setup, _)| (format!("{name}.toml"), setup.clone())));
    let mut job = "insmod /modules/vivid.ko n_devs=1 node_types=0x0001\n".to_owned();
    for (file, _) in &setups {
        job += &format!("gangway-pi check --setup /{file} --to file:/tmp/no.gw\necho 'board: {file}'\n");
    }
    let files: Vec<(&str, &[u8])> =
        setups.iter().map(|(file, setup)| (file.as_str(), setup.as_bytes())).collect();
    let mut board = Guest::boot(&job, &files);
    for (format, told) in wanted {
        let camera = board.expect("camera: ");
        println!("{format}: {camera}");
        assert!(camera.starts_with("ok    camera: /dev/video0, 1280 x 720 "), "{format}: {camera}");
        assert!(camera.contains(told), "{format}: {camera}");
        println!("{}", board.expect("controls: "));
        println!("{}", board.expect("frames: "));
        if format == "bayer" {
            board.expect("note  the camera's Bayer mosaic is taken as grey");
        }
        board.expect(&format!("board: {format}.toml"));
    }
    for (name, _, told) in &refused {
        let camera = board.expect("camera: ");
        println!("{name}: {camera}");
        assert!(camera.starts_with("no    camera: ") && camera.contains(told), "{name}: {camera}");
    }
    board.wait();
}
