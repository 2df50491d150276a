//! A camera of libcamera (0.4 to 0.7): raw grey, a mosaic, or the luma of NV12, with everything automatic
//! off.
//!
//! What its `SensorTimestamp` is of, and by which clock, stands at [`sensor_time`].

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use ::libcamera::camera::{ActiveCamera, CameraConfiguration};
use ::libcamera::camera_manager::CameraManager;
use ::libcamera::control::{ControlInfoMap, ControlList};
use ::libcamera::control_value::ControlValue;
use ::libcamera::controls::{
    AeEnable, AfMode, AnalogueGain, AwbEnable, ControlId, ExposureTime, FrameDurationLimits, LensPosition,
    SensorTimestamp,
};
use ::libcamera::framebuffer::{AsFrameBuffer as _, FrameMetadataStatus};
use ::libcamera::framebuffer_allocator::{FrameBuffer, FrameBufferAllocator};
use ::libcamera::framebuffer_map::MemoryMappedFrameBuffer;
use ::libcamera::geometry::Size;
use ::libcamera::pixel_format::PixelFormat;
use ::libcamera::request::{Request, RequestStatus, ReuseFlag};
use ::libcamera::stream::{Stream as CameraStream, StreamRole};
use ::libcamera::utils::UniquePtr;
use gangway_linux::camera::{
    OpenError, Shape, Shutter, Source, Stamp, Stream, StreamError, TimeSource, sensor_time,
};
use gangway_linux::{Notices, both_clocks};
use gangway_setup::{Camera as CameraSettings, Capture, SampleFormat};

use super::controls::{self, exposure_us, frame_us, is_other_exposure, readout_ns};
use super::samples::{Samples, candidates};

/// Frames until a sensor has taken over what it was told.
const SETTLED: u32 = 16;

/// Bytes of the smallest page.
const PAGE: usize = 4096;

/// The format as libcamera names it.
fn format(samples: &Samples) -> PixelFormat {
    PixelFormat::new(samples.fourcc(), samples.modifier)
}

/// A camera of libcamera as the setup describes it.
pub(crate) struct Libcamera {
    /// Its name, or its place in libcamera's list.
    pub(crate) name: String,
    pub(crate) capture: Capture,
    pub(crate) camera: CameraSettings,
    pub(crate) size: (u16, u16),
    pub(crate) rate_hz: f64,
    pub(crate) notices: Notices,
}

impl Libcamera {
    fn take(&self, manager: &CameraManager) -> Result<ActiveCamera<'static>, OpenError> {
        let all = manager.cameras();
        let by_place = self.name.parse().ok().and_then(|place: usize| all.get(place));
        let Some(camera) = by_place.or_else(|| manager.get(&self.name)) else {
            let names: Vec<String> =
                (0..all.len()).filter_map(|i| all.get(i)).map(|camera| camera.id().to_owned()).collect();
            let has = if names.is_empty() {
                "it knows none".to_owned()
            } else {
                format!("it knows {}", names.join(", "))
            };
            return Err(OpenError::absent(format!(
                "libcamera knows no camera {}; {has}; check its cable and name",
                self.name
            )));
        };
        camera.acquire().map_err(|error| {
            OpenError::absent(format!(
                "the camera {} is used by another program ({error}); end that first",
                self.name
            ))
        })
    }

    /// The first format that the camera takes in the size of the setup, configured.
    fn choose(&self, camera: &mut ActiveCamera<'_>) -> Result<(Samples, CameraConfiguration), OpenError> {
        let (width, height) = self.size;
        let mut refusals = Vec::new();
        for candidate in candidates(self.capture.format) {
            match self.try_format(camera, &candidate) {
                Ok(configuration) => return Ok((candidate, configuration)),
                Err(why) => refusals.push(format!("{:?}: {why}", candidate.named).to_lowercase()),
            }
        }
        Err(OpenError::unfit(format!(
            "the camera {} does not give {width} x {height} as the setup asks ({})",
            self.name,
            refusals.join("; ")
        )))
    }

    fn try_format(
        &self,
        camera: &mut ActiveCamera<'_>,
        candidate: &Samples,
    ) -> Result<CameraConfiguration, String> {
        let size = Size::new(self.size.0.into(), self.size.1.into());
        let role = if candidate.is_raw { StreamRole::Raw } else { StreamRole::VideoRecording };
        let mut configuration = camera.generate_configuration(&[role]).ok_or("it has no such stream")?;
        let mut stream = configuration.get_mut(0).ok_or("it has no such stream")?;
        let wanted = format(candidate);
        stream.set_pixel_format(wanted);
        stream.set_size(size);
        stream.set_buffer_count(self.capture.buffers.into());
        let is_valid = !configuration.validate().is_invalid();
        let stream = configuration.get(0).filter(|_| is_valid).ok_or("it is refused")?;
        let (format, given) = (stream.get_pixel_format(), stream.get_size());
        let is_same = format.fourcc() == wanted.fourcc()
            && format.modifier() == wanted.modifier()
            && (given.width, given.height) == (size.width, size.height);
        if !is_same {
            return Err(format!("it gives {} x {} {format:?}", given.width, given.height));
        }
        camera.configure(&mut configuration).map_err(|error| error.to_string())?;
        Ok(configuration)
    }

    /// Everything automatic off; exposure, gain, focus and rate as the setup says, each within what the
    /// camera takes. Gives the controls and their names.
    fn controls(&self, takes: &ControlInfoMap) -> Result<(UniquePtr<ControlList>, String), OpenError> {
        let mut list = ControlList::new();
        let mut put = |id: ControlId, value: ControlValue| list.set_raw(id as u32, value);
        let has = |id: ControlId| takes.find(id as u32).is_ok();
        let mut all = Vec::new();
        if has(ControlId::AeEnable) {
            all.push((ControlId::AeEnable, AeEnable(false).into()));
        }
        // Gains of colours that change by themselves change the luma made of them.
        if has(ControlId::AwbEnable) {
            all.push((ControlId::AwbEnable, AwbEnable(false).into()));
        }
        let wanted = &self.capture;
        if self.camera.exposure_ms > 0.0 && !has(ControlId::ExposureTime) {
            self.notices.mark("the camera cannot be told its exposure: the setup's is taken");
        } else if self.camera.exposure_ms > 0.0 {
            let us = exposure_us(self.camera.exposure_ms);
            self.within(takes, ControlId::ExposureTime, "camera.exposure_ms", us)?;
            all.push((ControlId::ExposureTime, ExposureTime(us as i32).into()));
        }
        if wanted.gain >= 0.0 {
            self.within(takes, ControlId::AnalogueGain, "capture.gain", wanted.gain)?;
            all.push((ControlId::AnalogueGain, AnalogueGain(wanted.gain as f32).into()));
        }
        if has(ControlId::AfMode) {
            all.push((ControlId::AfMode, AfMode::Manual.into()));
        }
        if wanted.focus >= 0.0 {
            self.within(takes, ControlId::LensPosition, "capture.focus", wanted.focus)?;
            all.push((ControlId::LensPosition, LensPosition(wanted.focus as f32).into()));
        }
        if has(ControlId::FrameDurationLimits) {
            let us = frame_us(self.rate_hz);
            self.within(takes, ControlId::FrameDurationLimits, "camera.rate_hz", us)?;
            all.push((ControlId::FrameDurationLimits, FrameDurationLimits([us as i64; 2]).into()));
        } else {
            self.notices.mark("the camera does not tell its rate");
        }
        let names: Vec<String> = all
            .iter()
            .map(|(id, value)| {
                format!("{} {}", id.name(), number(value).map_or("off".into(), |n| n.to_string()))
            })
            .collect();
        for (id, value) in all {
            put(id, value).map_err(|error| OpenError::unfit(format!("{}: {error}", self.name)))?;
        }
        Ok((list, names.join("; ")))
    }

    /// The camera has this control, and takes this value.
    fn within(&self, takes: &ControlInfoMap, id: ControlId, key: &str, value: f64) -> Result<(), OpenError> {
        let name = &self.name;
        let Ok(range) = takes.find(id as u32) else {
            return Err(OpenError::unfit(format!(
                "the camera {name} has no control for {key}; leave that key out of the setup"
            )));
        };
        let range = (number(&range.min()), number(&range.max()));
        controls::within(name, &id.name(), key, value, range).map_err(OpenError::unfit)
    }
}

/// The first number of a value.
fn number(value: &ControlValue) -> Option<f64> {
    match value {
        ControlValue::Int32(values) => values.first().map(|value| f64::from(*value)),
        ControlValue::Int64(values) => values.first().map(|value| *value as f64),
        ControlValue::Float(values) => values.first().map(|value| f64::from(*value)),
        _ => None,
    }
}

impl Source for Libcamera {
    type Stream = LibcameraStream;

    fn open(&mut self) -> Result<LibcameraStream, OpenError> {
        let failed = |what: &str, error: &dyn std::fmt::Display| {
            OpenError::absent(format!("the camera {}: {what}: {error}", self.name))
        };
        // A new one every time: it looks for cameras when it starts.
        let manager = CameraManager::new().map_err(|error| failed("libcamera does not start", &error))?;
        let mut camera = self.take(&manager)?;
        let (candidate, configuration) = self.choose(&mut camera)?;
        if candidate.named == SampleFormat::Bayer {
            self.notices.mark("the camera's Bayer mosaic is taken as grey");
        }
        let (controls, told) = self.controls(camera.controls())?;
        let Some(set) = configuration.get(0) else {
            return Err(OpenError::absent(format!("the camera {} lost its configuration", self.name)));
        };
        let Some(stream) = set.stream() else {
            return Err(OpenError::absent(format!("the camera {} has no stream", self.name)));
        };
        let stride = candidate.stride(self.size.0, set.get_stride());
        let shape = Shape { size: self.size, stride, layout: candidate.layout };
        drop(set);

        let mut allocator = FrameBufferAllocator::new(&camera);
        let buffers = allocator.alloc(&stream).map_err(|error| failed("no memory for pictures", &error))?;
        let (mut requests, mut places) = (Vec::new(), Vec::new());
        for (buffer, cookie) in buffers.into_iter().zip(0..) {
            let buffer = MemoryMappedFrameBuffer::new(buffer)
                .map_err(|error| failed("its pictures cannot be read", &error))?;
            let picture = *buffer.data().first().unwrap_or(&[].as_slice());
            // Locking does not fetch the pages of such a buffer: each one is touched before the loop needs
            // it.
            picture.iter().step_by(PAGE).for_each(|byte| _ = std::hint::black_box(*byte));
            places.push((picture.as_ptr(), picture.len()));
            let mut request = camera
                .create_request(Some(cookie))
                .ok_or_else(|| failed("it takes no requests", &"out of memory"))?;
            request.add_buffer(&stream, buffer).map_err(|error| failed("it takes no buffer", &error))?;
            requests.push(request);
        }
        // Room for all: the callback never waits.
        let (give, done) = sync_channel(requests.len().max(1));
        camera.on_request_completed(move |request| {
            let _ = give.try_send(request);
        });
        let is_gone = Arc::new(AtomicBool::new(false));
        let gone = Arc::clone(&is_gone);
        camera.on_disconnected(move || gone.store(true, Ordering::Release));
        camera.start(Some(&controls)).map_err(|error| failed("it does not start", &error))?;
        for request in requests {
            camera.queue_request(request).map_err(|(_, error)| failed("it takes no request", &error))?;
        }
        let readout_ns = readout_ns(self.size.1, self.camera.line_time_us);
        Ok(LibcameraStream {
            current: None,
            done,
            camera,
            _allocator: allocator,
            _manager: manager,
            stream,
            shape,
            places,
            named: candidate.named,
            told,
            shutter: Shutter { exposure_ns: (self.camera.exposure_ms * 1e6) as u64, readout_ns },
            wanted_us: 1e3 * self.camera.exposure_ms,
            frames: 0,
            has_said_clock: false,
            has_said_exposure: false,
            is_gone,
            notices: self.notices.clone(),
        })
    }
}

/// A camera of libcamera that delivers. Fields are dropped in this order: pictures, camera, manager.
pub(crate) struct LibcameraStream {
    /// The picture that the loop reads.
    current: Option<Request>,
    done: Receiver<Request>,
    camera: ActiveCamera<'static>,
    _allocator: FrameBufferAllocator,
    _manager: CameraManager,
    stream: CameraStream,
    shape: Shape,
    /// Start and length of each buffer's first plane, by the cookie of its request.
    places: Vec<(*const u8, usize)>,
    named: SampleFormat,
    /// Controls and their values as they were asked for.
    told: String,
    shutter: Shutter,
    wanted_us: f64,
    frames: u32,
    has_said_clock: bool,
    has_said_exposure: bool,
    is_gone: Arc<AtomicBool>,
    notices: Notices,
}

// SAFETY: libcamera's camera and manager may be used by any thread, one at a time, and this stream is used
// exclusively. The places are in memory that its buffers keep mapped.
unsafe impl Send for LibcameraStream {}

impl LibcameraStream {
    /// Size, format and exposure, for a person.
    pub(crate) fn describe(&self) -> String {
        let (width, height) = self.shape.size;
        let exposure = match self.shutter.exposure_ns {
            0 => "exposure not told".to_owned(),
            ns => format!("exposure {:.1} ms", ns as f64 / 1e6),
        };
        let format = format!("{:?}", self.named).to_uppercase();
        format!("{width} x {height} {format}, {} bits, {exposure}", self.shape.layout.bits())
    }

    /// The controls that the camera was told, for a person; what it makes of them comes with the frames.
    pub(crate) fn describe_controls(&self) -> String {
        if self.told.is_empty() {
            "it takes none of those that matter here".into()
        } else {
            self.told.clone()
        }
    }

    /// The exposure that the frame tells; after the first ones it must be the one asked for.
    fn note_exposure(&mut self, told: Option<i32>) {
        let Some(us) = told.filter(|us| *us > 0) else { return };
        self.shutter.exposure_ns = us as u64 * 1_000;
        self.frames = self.frames.saturating_add(1);
        let is_other = is_other_exposure(us, self.wanted_us);
        if is_other && self.frames > SETTLED && !self.has_said_exposure {
            self.has_said_exposure = true;
            self.notices.mark("the camera exposes otherwise than the setup says");
            let wanted_us = self.wanted_us;
            self.notices.log(format!("the camera exposes for {us} us; the setup says {wanted_us} us"));
        }
    }

    /// The time that the frame tells, by the monotonic clock, and what it is of.
    fn time(&mut self, told: Option<i64>) -> (u64, TimeSource) {
        let (monotonic_ns, boottime_ns) = both_clocks();
        let (ns, source) = sensor_time(told, monotonic_ns, boottime_ns);
        if source == TimeSource::Arrival && !std::mem::replace(&mut self.has_said_clock, true) {
            self.notices.mark("the camera tells no time: times are of arrival");
        }
        (ns, source)
    }
}

impl Stream for LibcameraStream {
    fn wait(&mut self, patience: Duration) -> Result<Stamp, StreamError> {
        let lost = |why: String| StreamError::Lost(why);
        if let Some(mut request) = self.current.take() {
            request.reuse(ReuseFlag::REUSE_BUFFERS);
            self.camera.queue_request(request).map_err(|(_, error)| lost(error.to_string()))?;
        }
        let request = self.done.recv_timeout(patience).map_err(|error| match error {
            RecvTimeoutError::Timeout if self.is_gone.load(Ordering::Acquire) => {
                lost("it is unplugged".into())
            }
            RecvTimeoutError::Timeout => StreamError::Stalled,
            RecvTimeoutError::Disconnected => lost("libcamera has ended it".into()),
        })?;
        if request.status() == RequestStatus::Cancelled {
            return Err(lost("libcamera has cancelled a picture".into()));
        }
        let buffer: Option<&MemoryMappedFrameBuffer<FrameBuffer>> = request.buffer(&self.stream);
        // Not every pipeline tells of the buffer (the virtual one of 0.4 does not): then the request's number
        // is the frame's.
        let (sequence, is_damaged) = match buffer.and_then(|buffer| buffer.metadata()) {
            Some(frame) => (frame.sequence(), frame.status() == FrameMetadataStatus::Error),
            None => (request.sequence(), false),
        };
        let told = request.metadata();
        let exposure = told.get::<ExposureTime>().ok().map(|time| *time);
        let time = told.get::<SensorTimestamp>().ok().map(|time| *time);
        self.note_exposure(exposure);
        let (noted_ns, source) = self.time(time);
        self.current = Some(request);
        let (time_ns, complete_ns) =
            (self.shutter.middle(source, noted_ns), self.shutter.end(source, noted_ns));
        Ok(Stamp { sequence, time_ns, complete_ns, source, is_damaged })
    }

    fn picture(&self) -> &[u8] {
        let place = self.current.as_ref().and_then(|request| self.places.get(request.cookie() as usize));
        match place {
            // SAFETY: the request has its buffer, which stays mapped as long as the request lives, and the
            // camera does not write into it before the next `wait`, which needs this stream exclusively.
            Some(&(start, length)) => unsafe { std::slice::from_raw_parts(start, length) },
            None => &[],
        }
    }

    fn shape(&self) -> Shape {
        self.shape
    }
}
