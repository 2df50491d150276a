//! Feeds raw pictures into a V4L2 output (v4l2loopback), so that a camera can be tried without one.
//!
//! `feed DEVICE FILE FORMAT WIDTH HEIGHT RATE GO`: pictures of FILE, which are of a V4L2 format (GREY, Y10P),
//! at RATE. The first one is repeated until the file GO exists, then every one is fed once, then the last one
//! until GO is gone.

use std::error::Error;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use v4l::video::Output;
use v4l::{Device, Format, FourCC};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [device, file, code, width, height, rate, go] = args.as_slice() else {
        return Err("feed DEVICE FILE FORMAT WIDTH HEIGHT RATE GO".into());
    };
    let code = FourCC::new(code.as_bytes().try_into()?);
    let (width, height): (u32, u32) = (width.parse()?, height.parse()?);
    let period = Duration::from_secs_f64(1.0 / rate.parse::<f64>()?);
    let mut output = Device::with_path(device)?;
    let format = Output::set_format(&output, &Format::new(width, height, code))?;
    if format.fourcc != code {
        return Err(format!("{device} does not take {code}").into());
    }
    let mut source = std::fs::File::open(file)?;
    let mut picture = vec![0; format.size as usize];
    source.read_exact(&mut picture)?;
    let mut due = Instant::now();
    let mut written = 0u32;
    let mut feed = |picture: &[u8]| -> Result<u32, Box<dyn Error>> {
        output.write_all(picture)?;
        written += 1;
        due += period;
        thread::sleep(due.saturating_duration_since(Instant::now()));
        // The number that the reading side sees.
        Ok(written - 1)
    };
    let is_on = || Path::new(go).exists();
    while !is_on() {
        feed(&picture)?;
    }
    let first = feed(&picture)?;
    while source.read_exact(&mut picture).is_ok() {
        feed(&picture)?;
    }
    println!("fed from {first}");
    while is_on() {
        feed(&picture)?;
    }
    Ok(())
}
