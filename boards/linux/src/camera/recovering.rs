//! A camera that comes back: what stalls, fails or is unplugged is closed and opened again, ever more slowly,
//! without holding up the loop for longer than a tenth of a second.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread;
use std::time::{Duration, Instant};

use gangway_device::{Camera, CameraErrorKind, Exposure, Frame};

use super::numbering::Numbering;
use super::{OpenError, OpenErrorKind, Source, Stamp, Stream, StreamError};
use crate::notice::Notices;

/// Wait after the second failure; doubled after each further one. The first try comes at once.
const FIRST_WAIT: Duration = Duration::from_millis(100);
/// Longest wait between two tries.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// Longest time away from the loop while there is no camera.
const SLICE: Duration = Duration::from_millis(100);
/// A device may take so long from its start to its first picture.
const START: Duration = Duration::from_secs(2);
/// Periods without a picture that are a stall.
const STALL_PERIODS: u32 = 3;

/// A source of frames that is opened again when it fails.
pub struct Recovering<S: Source> {
    source: S,
    stream: Option<S::Stream>,
    notices: Notices,
    numbering: Numbering,
    period: Duration,
    /// A picture came since the device was opened.
    delivers: bool,
    /// The loop was told that the camera is away.
    is_missed: bool,
    next_try: Instant,
    wait: Duration,
    /// The last sentence that was logged: the same one is not logged at every try.
    said: String,
}

impl<S: Source> Recovering<S> {
    /// A camera of this nominal rate; nothing is opened yet.
    pub fn new(source: S, rate_hz: f64, notices: Notices) -> Self {
        let period = Duration::from_secs_f64(1.0 / rate_hz.clamp(0.001, 1e6));
        Self {
            source,
            stream: None,
            notices,
            numbering: Numbering::new(period.as_nanos() as u64),
            period,
            delivers: false,
            is_missed: false,
            next_try: Instant::now(),
            wait: Duration::ZERO,
            said: String::new(),
        }
    }

    /// Opens the device for the first time; one that is not there yet is waited for in the loop.
    ///
    /// # Errors
    /// The device is there and cannot do what the setup asks.
    pub fn start(&mut self) -> Result<(), OpenError> {
        match self.open() {
            Err(error) if error.kind == OpenErrorKind::Unfit => Err(error),
            Err(error) => {
                self.say(error.sentence);
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    fn open(&mut self) -> Result<(), OpenError> {
        // The crate below panics on devices that answer what it does not expect.
        let opened = catch_unwind(AssertUnwindSafe(|| self.source.open()));
        let stream = opened.unwrap_or_else(|_| {
            Err(OpenError::absent("the camera answered something that cannot be understood".to_owned()))
        })?;
        self.stream = Some(stream);
        self.delivers = false;
        self.numbering.reopened();
        Ok(())
    }

    fn close(&mut self) {
        let stream = self.stream.take();
        let _ = catch_unwind(AssertUnwindSafe(|| drop(stream)));
    }

    fn say(&mut self, sentence: String) {
        if sentence != self.said {
            self.notices.log(sentence.clone());
            self.said = sentence;
        }
    }

    /// One try to open the device, if it is time for one.
    fn reopen(&mut self) -> CameraErrorKind {
        let now = Instant::now();
        if now < self.next_try {
            thread::sleep(SLICE.min(self.next_try - now));
            return CameraErrorKind::Waiting;
        }
        self.wait = if self.wait.is_zero() { FIRST_WAIT } else { (self.wait * 2).min(LONGEST_WAIT) };
        self.next_try = now + self.wait;
        match self.open() {
            Ok(()) if std::mem::take(&mut self.is_missed) => CameraErrorKind::Reopened,
            Ok(()) => CameraErrorKind::Waiting,
            Err(error) => {
                self.say(error.sentence);
                if std::mem::replace(&mut self.is_missed, true) {
                    CameraErrorKind::Waiting
                } else {
                    CameraErrorKind::Lost
                }
            }
        }
    }

    /// The next picture's stamp, or what the loop is to be told.
    fn wait(&mut self) -> Result<Stamp, CameraErrorKind> {
        let patience = STALL_PERIODS * self.period;
        let patience = if self.delivers { patience } else { patience.max(START) };
        let Some(stream) = &mut self.stream else { return Err(self.reopen()) };
        let waited = catch_unwind(AssertUnwindSafe(|| stream.wait(patience)));
        match waited
            .unwrap_or_else(|_| Err(StreamError::Lost("its driver's answer is not understood".into())))
        {
            Ok(stamp) => {
                if !std::mem::replace(&mut self.delivers, true) {
                    self.wait = Duration::ZERO;
                    self.said.clear();
                }
                Ok(stamp)
            }
            Err(error) => {
                self.close();
                self.is_missed = true;
                Err(match error {
                    StreamError::Stalled => CameraErrorKind::Stalled,
                    StreamError::Lost(why) => {
                        self.say(format!("the camera is lost: {why}"));
                        CameraErrorKind::Lost
                    }
                })
            }
        }
    }
}

impl<S: Source> Camera for Recovering<S> {
    type Error = CameraErrorKind;

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        let stamp = self.wait()?;
        let number = self.numbering.number(stamp.sequence, stamp.time_ns);
        if stamp.is_damaged {
            return Err(CameraErrorKind::Corrupt);
        }
        let Some(stream) = &self.stream else { return Err(CameraErrorKind::Waiting) };
        let shape = stream.shape();
        Frame::new(stream.picture(), shape.size, shape.stride, shape.layout, number, stamp.time_ns)
            .map(|frame| frame.complete_at(stamp.complete_ns))
            .map_err(|_| CameraErrorKind::Corrupt)
    }

    /// A device that is opened again begins as the setup says.
    fn set_exposure(&mut self, wanted: Exposure) -> Option<Exposure> {
        let stream = self.stream.as_mut()?;
        catch_unwind(AssertUnwindSafe(|| stream.set_exposure(wanted))).ok().flatten()
    }
}

impl<S: Source> Drop for Recovering<S> {
    fn drop(&mut self) {
        self.close();
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use gangway_device::Layout;

    use super::super::{Shape, TimeSource};
    use super::*;

    /// What a fake device does, one entry an attempt to open it.
    type Life = Result<Vec<Result<(u32, u64), StreamError>>, OpenErrorKind>;

    struct Fake(VecDeque<Life>);

    struct FakeStream(VecDeque<Result<(u32, u64), StreamError>>);

    impl Source for Fake {
        type Stream = FakeStream;

        fn open(&mut self) -> Result<FakeStream, OpenError> {
            match self.0.pop_front().expect("no more attempts were expected") {
                Ok(pictures) => Ok(FakeStream(pictures.into())),
                Err(kind) => Err(OpenError { kind, sentence: "it is away".to_owned() }),
            }
        }
    }

    impl Stream for FakeStream {
        fn wait(&mut self, _patience: Duration) -> Result<Stamp, StreamError> {
            let picture = self.0.pop_front().unwrap_or_else(|| panic!("a driver that breaks its word"));
            picture.map(|(sequence, time_ns)| Stamp {
                sequence,
                time_ns,
                complete_ns: Some(time_ns),
                source: TimeSource::EndOfFrame,
                is_damaged: sequence == 99,
            })
        }

        fn picture(&self) -> &[u8] {
            &[1, 2, 3, 4]
        }

        fn shape(&self) -> Shape {
            Shape { size: (2, 2), stride: 2, layout: Layout::GREY }
        }
    }

    impl Drop for FakeStream {
        fn drop(&mut self) {
            // As the crate's stream does when its device has vanished.
            assert!(!self.0.is_empty(), "a drop that panics");
        }
    }

    const MS: u64 = 1_000_000;

    /// Plays so many frames and errors, waiting left out.
    fn play(lives: Vec<Life>, count: usize) -> Vec<Result<u32, CameraErrorKind>> {
        let (notices, _taken) = Notices::channel();
        let mut camera = Recovering::new(Fake(lives.into()), 50.0, notices);
        camera.start().unwrap();
        let mut seen = Vec::new();
        while seen.len() < count {
            match camera.next_frame() {
                Err(CameraErrorKind::Waiting) => {}
                other => seen.push(other.map(|frame| frame.number())),
            }
        }
        seen
    }

    #[test]
    fn a_stall_is_told_once_and_the_gap_is_in_the_numbers() {
        let lives: Vec<Life> = vec![
            Ok(vec![Ok((0, 0)), Ok((1, 20 * MS)), Err(StreamError::Stalled), Ok((0, 0))]),
            Err(OpenErrorKind::Absent),
            Err(OpenErrorKind::Unfit),
            Ok(vec![Ok((0, 520 * MS)), Ok((1, 540 * MS)), Ok((9, 0))]),
        ];
        use CameraErrorKind::{Reopened, Stalled};
        assert_eq!(play(lives, 6), [Ok(0), Ok(1), Err(Stalled), Err(Reopened), Ok(26), Ok(27)]);
    }

    #[test]
    fn a_driver_that_panics_even_when_it_is_dropped_is_only_lost() {
        let lives: Vec<Life> = vec![Ok(vec![Ok((0, 0))]), Ok(vec![Ok((0, 100 * MS)), Ok((9, 0))])];
        use CameraErrorKind::{Lost, Reopened};
        assert_eq!(play(lives, 4), [Ok(0), Err(Lost), Err(Reopened), Ok(5)]);
    }

    #[test]
    fn a_camera_that_comes_late_is_missed_once() {
        let lives: Vec<Life> = vec![
            Err(OpenErrorKind::Absent),
            Err(OpenErrorKind::Absent),
            Ok(vec![Ok((0, 0)), Ok((99, 20 * MS)), Ok((2, 40 * MS)), Ok((3, 0))]),
        ];
        use CameraErrorKind::{Corrupt, Lost, Reopened};
        let seen = play(lives, 5);
        assert_eq!(seen, [Err(Lost), Err(Reopened), Ok(0), Err(Corrupt), Ok(2)]);
    }

    #[test]
    fn a_camera_that_cannot_do_what_is_asked_is_refused_at_the_start() {
        let (notices, _taken) = Notices::channel();
        let mut camera = Recovering::new(Fake([Err(OpenErrorKind::Unfit)].into()), 50.0, notices);
        assert_eq!(camera.start().unwrap_err().sentence, "it is away");
    }

    /// Notes how long each picture was waited for.
    struct Patient(std::sync::mpsc::Sender<Duration>);

    impl Source for Patient {
        type Stream = Patient;

        fn open(&mut self) -> Result<Patient, OpenError> {
            Ok(Patient(self.0.clone()))
        }
    }

    impl Stream for Patient {
        fn wait(&mut self, patience: Duration) -> Result<Stamp, StreamError> {
            self.0.send(patience).unwrap();
            let (time_ns, source) = (0, TimeSource::EndOfFrame);
            Ok(Stamp { sequence: 0, time_ns, complete_ns: None, source, is_damaged: false })
        }

        fn picture(&self) -> &[u8] {
            &[1, 2, 3, 4]
        }

        fn shape(&self) -> Shape {
            Shape { size: (2, 2), stride: 2, layout: Layout::GREY }
        }
    }

    #[test]
    fn three_periods_without_a_picture_are_a_stall_but_a_start_may_take_longer() {
        let (give, waited) = std::sync::mpsc::channel();
        let mut camera = Recovering::new(Patient(give), 50.0, Notices::channel().0);
        camera.start().unwrap();
        for _ in 0..3 {
            camera.next_frame().unwrap();
        }
        let stalled = Duration::from_millis(60);
        assert_eq!(waited.try_iter().collect::<Vec<_>>(), [Duration::from_secs(2), stalled, stalled]);
    }
}
