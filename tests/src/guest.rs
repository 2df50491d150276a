//! A Raspberry Pi 3 under emulation: Debian's kernel, the box's programs, and a job that a test gives it.
//!
//! `tests/board/prepare` puts kernel, modules and programs into `$GANGWAY_CACHE`.

use std::env;
use std::fs;
use std::io::{BufRead, BufReader, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// A boot takes some 10 s; a machine that does other things may need many times that.
const PATIENCE: Duration = Duration::from_secs(300);

/// Where prepared things are kept.
pub fn cache() -> PathBuf {
    let cache = env::var_os("GANGWAY_CACHE").map(PathBuf::from);
    let home = || PathBuf::from(env::var_os("HOME").unwrap_or_default()).join(".cache/gangway");
    cache.unwrap_or_else(home).join("board")
}

/// A running board.
pub struct Guest {
    machine: Child,
    lines: Receiver<String>,
    /// Everything that its console said.
    pub log: Vec<String>,
    folder: tempfile::TempDir,
}

impl Guest {
    /// Boots a board that has `files` at its root and runs the shell script `job`.
    pub fn boot(job: &str, files: &[(&str, &[u8])]) -> Self {
        Self::boot_with_card(job, files, None)
    }

    /// The same with the image of an SD card in its slot; its size is a power of two.
    pub fn boot_with_card(job: &str, files: &[(&str, &[u8])], card: Option<&Path>) -> Self {
        let cache = cache();
        let folder = tempfile::tempdir().expect("a folder");
        let mut archive = Archive::default();
        for place in ["bin", "lib", "modules"] {
            archive.folder(place);
            for file in fs::read_dir(cache.join("fs").join(place)).expect("run tests/board/prepare first") {
                let file = file.expect("a file").path();
                archive.file(&format!("{place}/{}", name(&file)), &fs::read(&file).expect("it can be read"));
            }
        }
        for file in fs::read_dir(cache.join("programs")).expect("run tests/board/prepare first") {
            let file = file.expect("a file").path();
            archive.file(&format!("bin/{}", name(&file)), &fs::read(&file).expect("it can be read"));
        }
        archive.file("init", include_bytes!("../board/init"));
        archive.file("job", job.as_bytes());
        for (name, bytes) in files {
            archive.file(name, bytes);
        }
        fs::write(folder.path().join("root.cpio"), archive.end()).expect("the first file system");

        let mut machine =
            Command::new("qemu-system-aarch64")
                .current_dir(folder.path())
                .args(["-M", "raspi3b", "-display", "none", "-initrd", "root.cpio", "-no-reboot"])
                .arg("-kernel")
                .arg(cache.join("vmlinuz"))
                .arg("-dtb")
                .arg(cache.join("pi3.dtb"))
                .args(["-append", "console=ttyS1,115200 iomem=relaxed loglevel=3 panic=-1"])
                .args(["-serial", "file:uart", "-serial", "stdio"])
                .args(["-monitor", "unix:monitor,server=on,wait=off"])
                .args(["-usb", "-device", "usb-net,netdev=net", "-netdev", "user,id=net"])
                .args(card.iter().flat_map(|card| {
                    ["-drive".to_owned(), format!("if=sd,format=raw,file={}", card.display())]
                }))
                .stdin(Stdio::piped())
                .stdout(Stdio::piped())
                .stderr(Stdio::inherit())
                .spawn()
                .expect("qemu-system-aarch64 starts");
        let console = machine.stdout.take().expect("its console");
        let (give, lines) = channel();
        thread::spawn(move || {
            let mut console = BufReader::new(console);
            let mut line = Vec::new();
            while console.read_until(b'\n', &mut line).is_ok_and(|count| count > 0) {
                if give.send(String::from_utf8_lossy(&line).trim_end().to_owned()).is_err() {
                    return;
                }
                line.clear();
            }
        });
        Self { machine, lines, log: Vec::new(), folder }
    }

    /// The file of everything that the board sends over its UART (ttyAMA0 there).
    pub fn uart(&self) -> PathBuf {
        self.folder.path().join("uart")
    }

    /// Waits for a line of the console that contains `text`.
    pub fn expect(&mut self, text: &str) -> String {
        let until = Instant::now() + PATIENCE;
        loop {
            match self.lines.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(line) => {
                    self.log.push(line.clone());
                    if line.contains(text) {
                        return line;
                    }
                }
                Err(RecvTimeoutError::Timeout) => self.fail(&format!("no line with '{text}' came")),
                Err(RecvTimeoutError::Disconnected) => self.fail(&format!("it ended without '{text}'")),
            }
        }
    }

    /// Takes the supply away, in the middle of whatever it does.
    pub fn cut(&mut self) {
        self.machine.kill().expect("it runs");
        self.machine.wait().expect("it is gone");
    }

    fn fail(&mut self, why: &str) -> ! {
        let _ = self.machine.kill();
        panic!("{why}; the console said:\n{}", self.log.join("\n"));
    }

    /// Sends a line to the job, which waits for it by `read`.
    pub fn go(&mut self) {
        let console = self.machine.stdin.as_mut().expect("its console");
        console.write_all(b"\n").expect("the console takes it");
        console.flush().expect("the console takes it");
    }

    /// The 32 bits at a physical address, by QEMU's monitor.
    pub fn word(&self, address: u32) -> u32 {
        let mut monitor = UnixStream::connect(self.folder.path().join("monitor")).expect("the monitor");
        monitor.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        writeln!(monitor, "xp /1wx {address:#x}").expect("the monitor takes it");
        let mut heard = Vec::new();
        let mut portion = [0; 256];
        // "0000000003f200034: 0x00020000"
        loop {
            let count = monitor.read(&mut portion).expect("the monitor answers");
            heard.extend_from_slice(&portion[..count]);
            let text = String::from_utf8_lossy(&heard).into_owned();
            if let Some((_, word)) = text.rsplit_once(": 0x")
                && let Some(word) = word.get(..8)
            {
                return u32::from_str_radix(word, 16).expect("a word");
            }
        }
    }

    /// Waits until the board has switched itself off.
    pub fn wait(&mut self) {
        self.expect("board: job ended");
        let until = Instant::now() + PATIENCE;
        while self.machine.try_wait().expect("the machine").is_none() {
            if Instant::now() > until {
                self.fail("it does not switch itself off");
            }
            thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        let _ = self.machine.kill();
        let _ = self.machine.wait();
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A file system as the kernel unpacks it at start (cpio, "newc").
#[derive(Default)]
struct Archive {
    bytes: Vec<u8>,
    count: u32,
}

impl Archive {
    fn folder(&mut self, name: &str) {
        self.entry(name, 0o040_755, &[]);
    }

    fn file(&mut self, name: &str, bytes: &[u8]) {
        self.entry(name, 0o100_755, bytes);
    }

    fn entry(&mut self, name: &str, mode: u32, bytes: &[u8]) {
        self.count += 1;
        let fields = [
            self.count,
            mode,
            0,
            0,
            1,
            0,
            u32::try_from(bytes.len()).expect("a file below 4 GiB"),
            0,
            0,
            0,
            0,
            name.len() as u32 + 1,
            0,
        ];
        self.bytes.extend_from_slice(b"070701");
        for field in fields {
            self.bytes.extend_from_slice(format!("{field:08x}").as_bytes());
        }
        self.bytes.extend_from_slice(name.as_bytes());
        self.bytes.push(0);
        self.pad();
        self.bytes.extend_from_slice(bytes);
        self.pad();
    }

    fn pad(&mut self) {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
    }

    fn end(mut self) -> Vec<u8> {
        self.entry("TRAILER!!!", 0, &[]);
        self.bytes
    }
}
