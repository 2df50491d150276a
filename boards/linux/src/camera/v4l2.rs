//! A V4L2 device, memory-mapped: the loop reads the kernel's buffer in place and gives it back.

use std::io::{self, ErrorKind};
use std::os::raw::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Duration;

use gangway_device::Exposure;
use gangway_setup::{Camera as CameraSettings, Capture, SampleFormat};
use v4l::buffer::{Flags, Type};
use v4l::capability::Flags as Capability;
use v4l::control::{Control, Value};
use v4l::io::mmap::Stream as Mapped;
use v4l::io::traits::{CaptureStream, Stream as _};
use v4l::parameters::Capabilities;
use v4l::v4l_sys::{V4L2_CTRL_FLAG_DISABLED, V4L2_CTRL_FLAG_READ_ONLY, v4l2_query_ext_ctrl};
use v4l::video::Capture as _;
use v4l::video::capture::Parameters;
use v4l::{Device, Format, FourCC, Fraction};

use super::controls::{self, Controls, Range};
use super::find::{CLASS, find};
use super::format::{PixelFormat, candidates, letters};
use super::{OpenError, Shape, Shutter, Source, Stamp, Stream, StreamError, TimeSource, stamp};
use crate::clock::monotonic_ns;
use crate::notice::Notices;

/// A rate that is off by less than this share is the one asked for.
const RATE_TOLERANCE: f64 = 0.01;

/// A V4L2 camera as the setup describes it.
#[derive(Debug)]
pub struct V4l2 {
    capture: Capture,
    camera: CameraSettings,
    size: (u16, u16),
    rate_hz: f64,
    notices: Notices,
}

impl V4l2 {
    /// A camera that is to give pictures of this size at this rate; remarks go to `notices`.
    pub fn new(
        capture: Capture,
        camera: CameraSettings,
        size: (u16, u16),
        rate_hz: f64,
        notices: Notices,
    ) -> Self {
        Self { capture, camera, size, rate_hz, notices }
    }

    /// The first format that the device takes in the size and at the rate of the setup.
    fn choose(&self, device: &Device, name: &str) -> Result<(PixelFormat, Format), OpenError> {
        let described = device.enum_formats().map_err(|error| failed(name, &error))?;
        let codes: Vec<[u8; 4]> = described.iter().map(|format| format.fourcc.repr).collect();
        let has = codes.iter().map(|code| letters(*code)).collect::<Vec<_>>().join(", ");
        let formats = candidates(&codes, self.capture.format);
        if formats.is_empty() {
            let what = match self.capture.format {
                SampleFormat::Auto => "no format that grey can be read from".to_owned(),
                wanted => format!("no format {wanted:?}").to_lowercase(),
            };
            return Err(OpenError::unfit(format!("{name} has {what}; it has {has}")));
        }
        let mut refusals = Vec::new();
        for format in formats {
            match self.try_format(device, format) {
                Ok(set) => return Ok((format, set)),
                Err(why) if why.kind() == ErrorKind::ResourceBusy => {
                    return Err(OpenError::absent(format!(
                        "{name} is used by another program; end that first"
                    )));
                }
                Err(why) => refusals.push(format!("{format}: {why}")),
            }
        }
        let ((width, height), rate) = (self.size, self.rate_hz);
        Err(OpenError::unfit(format!(
            "{name} does not give {width} x {height} at {rate} Hz as the setup asks ({})",
            refusals.join("; ")
        )))
    }

    /// Sets a format and the rate, and compares with what the driver made of them.
    fn try_format(&self, device: &Device, format: PixelFormat) -> io::Result<Format> {
        let (width, height) = (u32::from(self.size.0), u32::from(self.size.1));
        let set = device.set_format(&Format::new(width, height, FourCC::new(&format.code)))?;
        if (set.width, set.height, set.fourcc.repr) != (width, height, format.code) {
            let code = letters(set.fourcc.repr);
            return Err(io::Error::other(format!("it gives {} x {} {code}", set.width, set.height)));
        }
        let asked = device.params().and_then(|_| device.set_params(&Parameters::new(interval(self.rate_hz))));
        match asked {
            Ok(read)
                if read.capabilities.contains(Capabilities::TIME_PER_FRAME) || is_rate(read.interval) =>
            {
                let rate = f64::from(read.interval.denominator) / f64::from(read.interval.numerator.max(1));
                if (rate / self.rate_hz - 1.0).abs() > RATE_TOLERANCE {
                    return Err(io::Error::other(format!("it gives {rate:.3} frames/s")));
                }
            }
            // A driver without rates delivers as its source does; gaps show in the numbers.
            _ => self.notices.mark("the camera does not tell its rate"),
        }
        Ok(set)
    }
}

fn is_rate(interval: Fraction) -> bool {
    interval.numerator > 0 && interval.denominator > 0
}

/// A period as a fraction of a second, exact to a millionth of a Hz.
fn interval(rate_hz: f64) -> Fraction {
    if rate_hz.fract() == 0.0 {
        Fraction::new(1, rate_hz as u32)
    } else {
        Fraction::new(1_000_000, (rate_hz * 1e6).round() as u32)
    }
}

fn failed(name: &str, error: &io::Error) -> OpenError {
    match error.kind() {
        ErrorKind::NotFound => {
            OpenError::absent(format!("there is no camera {name}; check its plug and name"))
        }
        ErrorKind::PermissionDenied => {
            OpenError::unfit(format!("this user may not use {name}; add the user to the group 'video'"))
        }
        ErrorKind::ResourceBusy => {
            OpenError::absent(format!("{name} is used by another program; end that first"))
        }
        _ if error.raw_os_error() == Some(libc::ENOTTY) => {
            OpenError::unfit(format!("{name} is no camera; give the path of a video device"))
        }
        _ => OpenError::absent(format!("{name} cannot be opened: {error}")),
    }
}

impl Source for V4l2 {
    type Stream = V4l2Stream;

    fn open(&mut self) -> Result<V4l2Stream, OpenError> {
        let path = find(&self.capture.device, Path::new(CLASS))?;
        let name = path.display().to_string();
        let device = Device::with_path(&path).map_err(|error| failed(&name, &error))?;
        let can = device.query_caps().map_err(|error| failed(&name, &error))?.capabilities;
        if !can.contains(Capability::VIDEO_CAPTURE | Capability::STREAMING) {
            return Err(OpenError::unfit(format!(
                "{name} does not stream pictures; give the camera's first node, as v4l2-ctl --list-devices shows"
            )));
        }
        let (format, set) = self.choose(&device, &name)?;
        if format.is_mosaic() {
            self.notices.mark("the camera's Bayer mosaic is taken as grey");
        }
        let exposure_ns = controls::apply(&Driver(&device), &self.capture, self.camera.exposure_ms)
            .map_err(|why| OpenError::unfit(format!("{name}: {why}")))?;
        if self.camera.exposure_ms > 0.0 && !controls::has_exposure(&Driver(&device)) {
            self.notices.mark("the camera cannot be told its exposure: the setup's is taken");
        }
        let lines = f64::from(self.size.1) - 1.0;
        let readout_ns = (lines * self.camera.line_time_us.abs() * 1e3).round() as u64;
        let row = format.layout.row_bytes(self.size.0).unwrap_or(usize::from(self.size.0));
        let shape = Shape { size: self.size, stride: (set.stride as usize).max(row), layout: format.layout };
        let mapped = Mapped::with_buffers(&device, Type::VideoCapture, u32::from(self.capture.buffers))
            .map_err(|error| failed(&name, &error))?;
        Ok(V4l2Stream {
            mapped: Some(mapped),
            device,
            shape,
            format,
            shutter: Shutter { exposure_ns, readout_ns },
            picture: (std::ptr::null(), 0),
            has_said_clock: false,
            notices: self.notices.clone(),
        })
    }
}

/// The device's controls through the kernel's calls.
struct Driver<'d>(&'d Device);

impl Controls for Driver<'_> {
    fn range(&self, id: u32) -> Option<Range> {
        // SAFETY: a structure of numbers, for which zeros are valid.
        let mut query: v4l2_query_ext_ctrl = unsafe { std::mem::zeroed() };
        query.id = id;
        let place: *mut v4l2_query_ext_ctrl = &raw mut query;
        // SAFETY: the call fills the structure that it is made for, which lives until it returns.
        let asked = unsafe {
            v4l::v4l2::ioctl(
                self.0.handle().fd(),
                v4l::v4l2::vidioc::VIDIOC_QUERY_EXT_CTRL,
                place.cast::<c_void>(),
            )
        };
        let refused = V4L2_CTRL_FLAG_DISABLED | V4L2_CTRL_FLAG_READ_ONLY;
        if asked.is_err() || query.flags & refused != 0 {
            return None;
        }
        let name: Vec<u8> =
            query.name.iter().map(|letter| *letter as u8).take_while(|letter| *letter != 0).collect();
        Some(Range {
            name: String::from_utf8_lossy(&name).into_owned(),
            least: query.minimum,
            greatest: query.maximum,
            step: query.step,
        })
    }

    fn get(&self, id: u32) -> Result<i64, String> {
        match self.0.control(id).map_err(|error| error.to_string())?.value {
            Value::Integer(value) => Ok(value),
            Value::Boolean(value) => Ok(i64::from(value)),
            _ => Err("it is no number".to_owned()),
        }
    }

    fn set(&self, id: u32, value: i64) -> Result<(), String> {
        let control = Control { id, value: Value::Integer(value) };
        self.0.set_control(control).map_err(|error| error.to_string())
    }
}

/// A V4L2 device that delivers.
pub struct V4l2Stream {
    /// `None` only while it is dropped.
    mapped: Option<Mapped<'static>>,
    /// For its controls.
    device: Device,
    shape: Shape,
    format: PixelFormat,
    shutter: Shutter,
    /// Start and length of the picture in the kernel's buffer.
    picture: (*const u8, usize),
    has_said_clock: bool,
    notices: Notices,
}

impl V4l2Stream {
    /// Size, format, rate and exposure as the driver has taken them, for a person.
    pub fn describe(&self) -> String {
        let (width, height) = self.shape.size;
        let exposure = match self.shutter.exposure_ns {
            0 => "exposure not told".to_owned(),
            ns => format!("exposure {:.1} ms", ns as f64 / 1e6),
        };
        let bits = self.shape.layout.bits();
        format!("{width} x {height} {}, {bits} bits, {exposure}", self.format)
    }

    /// Its controls as they stand, for a person.
    pub fn describe_controls(&self) -> String {
        controls::describe(&Driver(&self.device))
    }
}

// SAFETY: the pointer is into memory that `mapped` keeps mapped, and used through this stream only.
unsafe impl Send for V4l2Stream {}

impl Stream for V4l2Stream {
    fn wait(&mut self, patience: Duration) -> Result<Stamp, StreamError> {
        self.picture = (std::ptr::null(), 0);
        let Some(mapped) = &mut self.mapped else {
            return Err(StreamError::Lost("it was closed".to_owned()));
        };
        mapped.set_timeout(patience);
        let (bytes, meta) = mapped.next().map_err(|error| match error.kind() {
            ErrorKind::TimedOut => StreamError::Stalled,
            _ => StreamError::Lost(error.to_string()),
        })?;
        let used = bytes.get(..meta.bytesused as usize).unwrap_or(bytes);
        self.picture = (used.as_ptr(), used.len());
        let noted_ns = (meta.timestamp.sec as u64)
            .saturating_mul(1_000_000_000)
            .saturating_add((meta.timestamp.usec as u64).saturating_mul(1_000));
        let (sequence, flags) = (meta.sequence, meta.flags);
        let is_damaged = flags.contains(Flags::ERROR);
        let now_ns = monotonic_ns();
        let source = stamp::source(flags, noted_ns, now_ns);
        let noted_ns = if source == TimeSource::Arrival { now_ns } else { noted_ns };
        if source == TimeSource::Arrival && !std::mem::replace(&mut self.has_said_clock, true) {
            self.notices.mark("the camera's clock is not monotonic: times are of arrival");
        }
        let (time_ns, complete_ns) =
            (self.shutter.middle(source, noted_ns), self.shutter.end(source, noted_ns));
        Ok(Stamp { sequence, time_ns, complete_ns, source, is_damaged })
    }

    fn picture(&self) -> &[u8] {
        let (start, length) = self.picture;
        if start.is_null() {
            return &[];
        }
        // SAFETY: `wait` noted a part of a buffer that stays mapped as long as `mapped` lives, and that the
        // kernel does not write before the next `wait`, which needs this stream exclusively.
        unsafe { std::slice::from_raw_parts(start, length) }
    }

    fn shape(&self) -> Shape {
        self.shape
    }

    fn set_exposure(&mut self, wanted: Exposure) -> Option<Exposure> {
        let taken = controls::expose(&Driver(&self.device), wanted)?;
        // Times of the frames until it shows are off by half the difference.
        self.shutter.exposure_ns = (taken.time_s * 1e9).round() as u64;
        Some(taken)
    }
}

impl Drop for V4l2Stream {
    /// The crate's own drop panics where the device refuses to stop, and once more, which would end the
    /// program, where it then refuses to give its buffers back. So it is asked first.
    fn drop(&mut self) {
        let Some(mut mapped) = self.mapped.take() else { return };
        match mapped.stop() {
            Err(error) if error.raw_os_error() != Some(libc::ENODEV) => {
                let fd = mapped.handle().fd();
                std::mem::forget(mapped);
                // SAFETY: whoever else had the descriptor is forgotten, so nobody closes or uses it again.
                unsafe { libc::close(fd) };
            }
            // A panic while another one unwinds would end the program: then the mapping is left to the
            // system.
            _ if std::thread::panicking() => std::mem::forget(mapped),
            _ => {
                let _ = catch_unwind(AssertUnwindSafe(|| drop(mapped)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(device: &str) -> OpenError {
        let capture = Capture { device: device.into(), ..Capture::default() };
        let notices = Notices::channel().0;
        V4l2::new(capture, CameraSettings::default(), (640, 480), 50.0, notices)
            .open()
            .err()
            .expect("no camera there")
    }

    #[test]
    fn a_camera_that_is_not_there_may_come() {
        let error = open("/dev/no-such-camera");
        assert_eq!(error.kind, super::super::OpenErrorKind::Absent);
        assert_eq!(error.sentence, "there is no camera /dev/no-such-camera; check its plug and name");
    }

    #[test]
    fn what_is_no_camera_is_refused() {
        let error = open("/dev/null");
        assert_eq!(error.kind, super::super::OpenErrorKind::Unfit);
        assert_eq!(error.sentence, "/dev/null is no camera; give the path of a video device");
    }

    #[test]
    fn periods_are_exact_fractions() {
        let of = |rate: f64| (interval(rate).numerator, interval(rate).denominator);
        assert_eq!(of(50.0), (1, 50));
        assert_eq!(of(29.97), (1_000_000, 29_970_000));
    }
}
