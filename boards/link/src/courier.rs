//! The body of the link thread, the same on every board: packets to the line, commands from it.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use gangway_device::{Link, LinkError, LinkErrorKind};
use gangway_engine::{Command, InboxProducer, OUTBOX_SLOTS, OutboxConsumer, Packet};
use gangway_wire::{EXPOSURE_TO_LINE_BITS, Histogram, kind};

use crate::{Commands, MAX_DATAGRAM};

/// Rest between two turns that found nothing to do: the latency of a packet is bounded by it.
pub const IDLE: Duration = Duration::from_millis(1);
/// Sends in one turn, so that commands are heard in between.
const SENDS_PER_TURN: usize = 64;
/// From so many waiting records on, a busy line is too narrow; poses then have the rest of the outbox to
/// themselves.
const NARROW: usize = OUTBOX_SLOTS / 2;
/// So many left out are told at once, or all of them when the line has caught up.
const TELL: u32 = 50;
/// How late poses are handed over is told to the loop so often, ns: twice for every `Health`.
const TELL_TIMES_NS: u64 = 500_000_000;
/// How long a host may take to close its end after everything was sent.
const GOODBYE: Duration = Duration::from_secs(2);

/// Who keeps every record.
type Keep<'q> = Box<dyn FnMut(&[u8]) + Send + 'q>;

/// What a courier has carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Carried {
    /// Records handed to the line.
    pub records: u64,
    /// Bytes handed to the line.
    pub bytes: u64,
    /// Records cut in the middle by the loss of a connection; their rest was dropped.
    pub cut: u64,
    /// Commands handed to the frame loop, announcements and refusals not among them.
    pub commands: u64,
    /// Commands that cannot be followed; the frame loop was told.
    pub refused: u64,
    /// Records left out on a line too narrow for all; the frame loop was told.
    pub thinned: u64,
}

/// Carries packets from the outbox to the link and commands from the link to the inbox.
///
/// Records go whole and in order: one that was begun is finished before the next. Where the connection is
/// lost in the middle of one, its rest is dropped, and what waits is sent to whoever connects next; the frame
/// loop is then asked to announce itself. While nobody is connected, packets stay in the outbox.
pub struct Courier<'q, L> {
    outbox: OutboxConsumer<'q>,
    inbox: InboxProducer<'q>,
    link: L,
    /// Whole records on their way, the first perhaps begun.
    batch: Vec<u8>,
    /// The first record of `batch` is on the line in part.
    is_begun: bool,
    connections: u32,
    is_connected: bool,
    announce: bool,
    /// Bytes that came and are not decoded yet.
    input: Vec<u8>,
    /// A command that found the inbox full.
    waiting: Option<Command>,
    commands: Commands,
    carried: Carried,
    /// Leaves markers out where the line cannot carry all.
    thins: bool,
    /// The line has not caught up since it last did not take everything.
    is_busy: bool,
    /// Left out and not told yet.
    untold: u32,
    clock: Option<fn() -> u64>,
    keep: Option<Keep<'q>>,
    /// Of the poses in `batch`: how many bytes of it end with them, and their exposures, ns.
    poses: VecDeque<(usize, u64)>,
    /// From exposure to line, not told yet.
    times: Histogram,
    told_ns: u64,
}

impl<'q, L: Link> Courier<'q, L> {
    /// A courier between the queues and the link.
    pub fn new(outbox: OutboxConsumer<'q>, inbox: InboxProducer<'q>, link: L) -> Self {
        Self {
            outbox,
            inbox,
            connections: link.connections(),
            link,
            batch: Vec::with_capacity(2 * MAX_DATAGRAM),
            is_begun: false,
            is_connected: true,
            announce: false,
            input: Vec::new(),
            waiting: None,
            commands: Commands::default(),
            carried: Carried::default(),
            thins: false,
            is_busy: false,
            untold: 0,
            clock: None,
            keep: None,
            poses: VecDeque::new(),
            times: Histogram::default(),
            told_ns: 0,
        }
    }

    /// Tells the frame loop how late poses are handed to the line, by the clock that stamps the frames, ns.
    pub fn timing(mut self, clock: fn() -> u64) -> Self {
        self.clock = Some(clock);
        self
    }

    /// Thins on a line too narrow for everything: `Markers` first. What the loop has no room for then, poses
    /// last, is lost to the full outbox. Both are recorded.
    pub fn thinning(mut self) -> Self {
        self.thins = true;
        self
    }

    /// Shows every record to `keep` when it leaves the outbox, also those that the line is too narrow for.
    /// While nobody is connected the outbox is kept half empty by it: the line then leaves the oldest records
    /// out, and this is recorded.
    pub fn keeping(mut self, keep: impl FnMut(&[u8]) + Send + 'q) -> Self {
        self.keep = Some(Box::new(keep));
        self
    }

    /// One turn, never waiting. Tells whether anything moved.
    ///
    /// # Errors
    /// The link's, but for [`LinkErrorKind::NotConnected`], which is no more than a reason to wait.
    pub fn turn(&mut self) -> Result<bool, L::Error> {
        let heard = self.hear();
        let heard = self.connected(heard)?;
        let sent = self.send();
        let sent = self.connected(sent)?;
        while self.keep.is_some() && !self.is_connected && self.outbox.len() > NARROW {
            self.leave_out();
        }
        Ok(sent | heard)
    }

    /// Hands a command of the board itself - a button, a mark - to the frame loop.
    ///
    /// # Errors
    /// The inbox is full: the command comes back, to be tried again.
    pub fn command(&mut self, command: Command) -> Result<(), Command> {
        self.inbox.enqueue(command)
    }

    /// Turns until `stop` is set. `trouble` decides for every error of the link whether to go on.
    pub fn run(&mut self, stop: &AtomicBool, mut trouble: impl FnMut(L::Error) -> ControlFlow<()>) {
        while !stop.load(Ordering::Acquire) {
            let moved = match self.turn() {
                Ok(moved) => moved,
                Err(error) => match trouble(error) {
                    ControlFlow::Break(()) => return,
                    ControlFlow::Continue(()) => false,
                },
            };
            if !moved {
                thread::sleep(IDLE);
            }
        }
    }

    /// Sends what is left and ends the line, within `patience`. Gives back the records that could not be
    /// sent.
    ///
    /// # Errors
    /// The link's.
    pub fn drain(&mut self, patience: Duration) -> Result<usize, L::Error> {
        let until = Instant::now() + patience;
        while self.left() > 0 && Instant::now() < until {
            if !self.turn()? {
                thread::sleep(IDLE);
            }
        }
        let left = self.left();
        while self.keep.is_some() && self.take().is_some() {}
        self.finish()?;
        Ok(left)
    }

    /// Ends the line once everything is sent: two seconds at most.
    ///
    /// # Errors
    /// The link's, where the end of the line cannot be trusted (a file that could not be synced).
    pub fn finish(&mut self) -> Result<(), L::Error> {
        let until = Instant::now() + GOODBYE;
        loop {
            let finished = self.link.finish();
            match finished {
                Err(error) if error.kind() != LinkErrorKind::NotConnected => return Err(error),
                Ok(false) if Instant::now() < until => thread::sleep(IDLE),
                _ => return Ok(()),
            }
        }
    }

    /// Records that are not on the line yet.
    pub fn left(&self) -> usize {
        self.outbox.len() + delimiters(&self.batch)
    }

    /// What was carried so far.
    pub fn carried(&self) -> Carried {
        self.carried
    }

    /// What the host has sent, damage among it.
    pub fn heard(&self) -> &gangway_wire::Counts {
        self.commands.counts()
    }

    /// Whether somebody was there in the last turn, as far as the line knows.
    pub fn is_connected(&self) -> bool {
        self.is_connected
    }

    /// The link.
    pub fn link(&self) -> &L {
        &self.link
    }

    /// Notes new connections and lost ones.
    fn connected(&mut self, outcome: Result<bool, L::Error>) -> Result<bool, L::Error> {
        if self.link.connections() != self.connections {
            self.connections = self.link.connections();
            self.announce = true;
            self.is_busy = false;
        }
        self.is_connected = true;
        match outcome {
            Err(error) if error.kind() == LinkErrorKind::NotConnected => {
                self.is_connected = false;
                if std::mem::take(&mut self.is_begun) {
                    let end =
                        self.batch.iter().position(|&byte| byte == 0).map_or(self.batch.len(), |at| at + 1);
                    // What is cut was never handed over.
                    self.forget(end, None);
                    self.carried.cut += 1;
                }
                Ok(false)
            }
            other => other,
        }
    }

    fn send(&mut self) -> Result<bool, L::Error> {
        for turn in 0..SENDS_PER_TURN {
            if self.batch.is_empty() {
                self.fill();
            }
            let count = if self.batch.is_empty() { 0 } else { self.link.send(&self.batch)? };
            // A line that once did not take everything is busy until nothing waits any more.
            self.is_busy = count < self.batch.len() || (self.is_busy && !self.outbox.is_empty());
            let Some(sent) = self.batch.get(..count).filter(|sent| !sent.is_empty()) else {
                return Ok(turn > 0);
            };
            self.is_begun = sent.last() != Some(&0);
            self.carried.records += delimiters(sent) as u64;
            self.carried.bytes += count as u64;
            let now_ns = if self.poses.is_empty() { None } else { self.clock.map(|clock| clock()) };
            self.forget(count, now_ns);
        }
        Ok(true)
    }

    /// Takes bytes out of the batch; the poses that end with them were handed over at this time.
    fn forget(&mut self, count: usize, handed_ns: Option<u64>) {
        self.batch.drain(..count);
        while let Some(&(_, exposed_ns)) = self.poses.front().filter(|(end, _)| *end <= count) {
            self.poses.pop_front();
            if let Some(handed_ns) = handed_ns {
                self.times.note(handed_ns.saturating_sub(exposed_ns), EXPOSURE_TO_LINE_BITS);
            }
        }
        self.poses.iter_mut().for_each(|(end, _)| *end -= count);
    }

    /// Takes as many packets as a datagram carries.
    fn fill(&mut self) {
        while let Some(packet) = self.outbox.peek() {
            let is_narrow = self.thins && self.is_busy && self.outbox.len() > NARROW;
            if is_narrow && packet.kind == kind::MARKERS {
                self.leave_out();
                continue;
            }
            if !self.batch.is_empty() && self.batch.len() + packet.bytes.len() > MAX_DATAGRAM {
                return;
            }
            let Some(packet) = self.take() else { return };
            self.batch.extend_from_slice(&packet.bytes);
            if self.clock.is_some() && packet.kind == kind::POSE {
                self.poses.push_back((self.batch.len(), packet.exposed_ns));
            }
        }
    }

    /// The next packet, shown to who keeps all of them.
    fn take(&mut self) -> Option<Packet> {
        let packet = self.outbox.dequeue()?;
        if let Some(keep) = &mut self.keep {
            keep(&packet.bytes);
        }
        Some(packet)
    }

    /// The line does without the next packet.
    fn leave_out(&mut self) {
        if self.take().is_some() {
            self.carried.thinned += 1;
            self.untold += 1;
        }
    }

    /// Tells the loop now and then how late poses were.
    fn tell_times(&mut self) {
        let Some(now_ns) = self.clock.filter(|_| self.times.total() > 0).map(|clock| clock()) else { return };
        if now_ns.saturating_sub(self.told_ns) >= TELL_TIMES_NS {
            let told = self.inbox.enqueue(Command::Delivered(self.times));
            if told.is_ok() {
                (self.times, self.told_ns) = (Histogram::default(), now_ns);
            }
        }
    }

    fn hear(&mut self) -> Result<bool, L::Error> {
        if std::mem::take(&mut self.announce) {
            self.announce = self.inbox.enqueue(Command::Announce).is_err();
        }
        let has_caught_up = self.outbox.len() < NARROW / 2;
        // Told when somebody is there again: until then only the log would hear it, which has everything.
        if self.is_connected && (self.untold >= TELL || (self.untold > 0 && has_caught_up)) {
            let told = self.inbox.enqueue(Command::Thinned { count: self.untold });
            self.untold = if told.is_ok() { 0 } else { self.untold };
        }
        self.tell_times();
        if let Some(command) = self.waiting.take() {
            self.waiting = self.inbox.enqueue(command).err();
        }
        if self.input.is_empty() {
            let mut portion = [0; 4096];
            let count = self.link.receive(&mut portion)?;
            self.input.extend_from_slice(portion.get(..count).unwrap_or_default());
        }
        let before = self.input.len();
        while self.waiting.is_none() && !self.input.is_empty() {
            let (command, rest) = self.commands.feed(&self.input);
            let rest = rest.len();
            self.input.drain(..self.input.len() - rest);
            if let Some(command) = command {
                match command {
                    Command::Refused { .. } => self.carried.refused += 1,
                    _ => self.carried.commands += 1,
                }
                self.waiting = self.inbox.enqueue(command).err();
            }
        }
        Ok(self.input.len() != before)
    }
}

fn delimiters(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&byte| byte == 0).count()
}

#[cfg(test)]
mod tests;
