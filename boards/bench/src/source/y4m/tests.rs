//! Tiny files of every kind, and what is wrong with the others.

use super::*;

/// The pictures of a file, and how it ended.
fn read(bytes: &[u8]) -> (Vec<Vec<u8>>, Result<(), String>) {
    let mut source = match Y4m::stream("ride.y4m", Box::new(io::Cursor::new(bytes.to_vec()))) {
        Ok(source) => source,
        Err(error) => return (Vec::new(), Err(error.to_string())),
    };
    let mut pictures = Vec::new();
    let mut picture = Vec::new();
    loop {
        match source.read(&mut picture) {
            Ok(true) => pictures.push(picture.clone()),
            Ok(false) => return (pictures, Ok(())),
            Err(error) => return (pictures, Err(error.to_string())),
        }
    }
}

fn file(parameters: &str, frames: &[&[u8]]) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 {parameters}\n").into_bytes();
    for frame in frames {
        bytes.extend_from_slice(b"FRAME\n");
        bytes.extend_from_slice(frame);
    }
    bytes
}

#[test]
fn luma_is_kept_whatever_chroma_follows() {
    // 3 x 3: odd sizes round chroma up.
    let luma: Vec<u8> = (1..=9).collect();
    for (colour, chroma) in [
        ("", 8),
        ("C420", 8),
        ("C420jpeg", 8),
        ("C420mpeg2", 8),
        ("C420paldv", 8),
        ("C422", 12),
        ("C444", 18),
        ("C444alpha", 27),
        ("C411", 6),
        ("Cmono", 0),
    ] {
        let frame = [luma.clone(), vec![200; chroma]].concat();
        let (pictures, end) = read(&file(&format!("W3 H3 F25:1 Ip {colour}"), &[&frame, &frame]));
        assert_eq!(pictures, [luma.clone(), luma.clone()], "{colour}");
        assert_eq!(end, Ok(()), "{colour}");
    }
}

#[test]
fn deep_samples_are_words_of_their_depth() {
    let luma: Vec<u8> = (1..=18).collect();
    for (colour, bits, chroma) in [
        ("Cmono9", 9, 0),
        ("Cmono10", 10, 0),
        ("Cmono16", 16, 0),
        ("C420p10", 10, 16),
        ("C422p12", 12, 24),
        ("C444p14", 14, 36),
        ("C420p16", 16, 16),
    ] {
        let bytes = file(&format!("W3 H3 {colour}"), &[&[luma.clone(), vec![200; chroma]].concat()]);
        let source = Y4m::stream("", Box::new(io::Cursor::new(bytes.clone()))).unwrap();
        assert_eq!(source.shape().layout, Layout::Word { bits });
        assert_eq!(source.shape().stride(), 6);
        assert_eq!(read(&bytes), (vec![luma.clone()], Ok(())), "{colour}");
    }
}

#[test]
fn rates_are_read_and_unknown_ones_left_open() {
    for (text, rate) in
        [("F50:1", Some(50.0)), ("F30000:1001", Some(30_000.0 / 1_001.0)), ("F0:0", None), ("", None)]
    {
        let bytes = file(&format!("W1 H1 {text} Cmono XCOLORRANGE=FULL"), &[]);
        assert_eq!(Y4m::stream("", Box::new(io::Cursor::new(bytes))).unwrap().rate_hz(), rate);
    }
}

#[test]
fn parameters_of_a_frame_are_passed_over() {
    let bytes = b"YUV4MPEG2 W1 H1 Cmono\nFRAME Ip XA=1\n\x05FRAME\n\x06";
    assert_eq!(read(bytes), (vec![vec![5], vec![6]], Ok(())));
}

#[test]
fn a_file_cut_off_anywhere_names_the_frame_and_keeps_those_before() {
    let whole = file("W2 H2 C420", &[&[1, 2, 3, 4, 9, 9], &[5, 6, 7, 8, 9, 9]]);
    let second = whole.len() - 12;
    for end in second + 1..whole.len() {
        let (pictures, said) = read(&whole[..end]);
        assert_eq!(pictures, [vec![1, 2, 3, 4]]);
        let said = said.unwrap_err();
        assert_eq!(
            said, "ride.y4m is cut off: it ends within frame 1; the 1 frames before it are good",
            "cut at {end}"
        );
    }
    assert_eq!(read(&whole[..second]), (vec![vec![1, 2, 3, 4]], Ok(())));
}

#[test]
fn rubbish_is_refused_in_one_sentence() {
    for (bytes, says) in [
        (&b""[..], "its first line does not end"),
        (b"RIFF....\n", "does not begin with YUV4MPEG2"),
        (b"YUV4MPEG2 H2\n", "its width (W) is missing"),
        (b"YUV4MPEG2 W0 H2\n", "its width (W) is missing"),
        (b"YUV4MPEG2 W2 H99999\n", "its height (H) is missing"),
        (b"YUV4MPEG2 W2 H2 C440\n", "colour space '440'"),
        (b"YUV4MPEG2 W2 H2 C420p17\n", "colour space '420p17'"),
        (b"YUV4MPEG2 W2 H2 C\xc3\xa4\xc3\xb6\n", "colour space"),
        (b"YUV4MPEG2 W2 H2 It\n", "interlaced"),
        (b"YUV4MPEG2 W2 H2 \xff\n", "no text"),
        (b"YUV4MPEG2 W1 H1 Cmono\n", "holds no frame"),
        (b"YUV4MPEG2 W1 H1 Cmono\nFRAMES\n1", "no frame begins behind frame 0"),
    ] {
        let (_, said) = read(bytes);
        let said = said.unwrap_err();
        assert!(said.contains(says) && said.starts_with("ride.y4m ") && !said.contains('\n'), "{said}");
    }
    let long = [b"YUV4MPEG2 X".to_vec(), vec![b'a'; 5_000]].concat();
    assert!(read(&long).1.unwrap_err().contains("its first line does not end"));
}

#[test]
fn a_file_can_be_played_again_and_a_stream_cannot() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("ride.y4m");
    std::fs::write(&path, file("W1 H1 Cmono", &[&[1], &[2]])).unwrap();
    assert!(is_y4m(&path));
    let mut source = Y4m::open(&path).unwrap();
    let mut picture = Vec::new();
    for _ in 0..2 {
        for value in [1, 2] {
            assert!(source.read(&mut picture).unwrap());
            assert_eq!(picture, [value]);
        }
        assert!(!source.read(&mut picture).unwrap());
        source.rewind().unwrap();
    }
    let mut stream = Y4m::stream("standard input", Box::new(io::Cursor::new(b"YUV4MPEG2 W1 H1\n"))).unwrap();
    let said = stream.rewind().unwrap_err().to_string();
    assert_eq!(said, "standard input can be read once only; to repeat it, give a file");
}
