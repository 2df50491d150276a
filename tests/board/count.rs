//! A plugin of QEMU's user emulation that counts instructions by the crate that they are of: the same program
//! gives the same counts in every run. Built by itself with `rustc --crate-type cdylib`; QEMU's plugin
//! interface, version 1.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::sync::atomic::{AtomicU64, Ordering};

/// Version of the interface that this is written for.
#[unsafe(no_mangle)]
pub static qemu_plugin_version: c_int = 1;

unsafe extern "C" {
    fn qemu_plugin_register_vcpu_tb_trans_cb(id: u64, translated: extern "C" fn(u64, *mut c_void));
    fn qemu_plugin_register_atexit_cb(id: u64, ended: extern "C" fn(u64, *mut c_void), data: *mut c_void);
    fn qemu_plugin_tb_n_insns(block: *const c_void) -> usize;
    fn qemu_plugin_tb_get_insn(block: *const c_void, index: usize) -> *mut c_void;
    fn qemu_plugin_insn_symbol(instruction: *const c_void) -> *const c_char;
    fn qemu_plugin_register_vcpu_tb_exec_inline(block: *mut c_void, operation: c_int, place: *mut c_void, add: u64);
    fn qemu_plugin_outs(text: *const c_char);
}

/// Steps, and the crates that do them. The first crate that a symbol names decides.
const STEPS: [(&str, &[&str]); 5] = [
    ("tracking", &["gangway_vision"]),
    ("pose", &["gangway_pose", "nalgebra", "simba"]),
    ("functions", &["libm"]),
    ("records", &["gangway_wire", "postcard", "serde", "crc"]),
    ("loop", &["gangway_engine", "heapless", "gangway_device"]),
];
const OTHER: usize = STEPS.len();
static COUNTS: [AtomicU64; STEPS.len() + 1] = [const { AtomicU64::new(0) }; STEPS.len() + 1];

fn step(symbol: &str) -> usize {
    let at = |names: &[&str]| names.iter().filter_map(|name| symbol.find(name)).min();
    let found = STEPS.iter().enumerate().filter_map(|(step, (_, names))| Some((at(names)?, step))).min();
    found.map_or(OTHER, |(_, step)| step)
}

extern "C" fn translated(_id: u64, block: *mut c_void) {
    // SAFETY: QEMU gives a block that is valid during this call, and every block has an instruction. The
    // place that it adds to is static; one thread counts, others would only blur the count.
    unsafe {
        let symbol = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(block, 0));
        let symbol = if symbol.is_null() { "".into() } else { CStr::from_ptr(symbol).to_string_lossy() };
        let place = COUNTS[step(&symbol)].as_ptr().cast::<c_void>();
        qemu_plugin_register_vcpu_tb_exec_inline(block, 0, place, qemu_plugin_tb_n_insns(block) as u64);
    }
}

extern "C" fn ended(_id: u64, _data: *mut c_void) {
    let names = STEPS.iter().map(|(name, _)| *name).chain(["other"]);
    for (name, count) in names.zip(&COUNTS) {
        let text = CString::new(format!("count {name} {}\n", count.load(Ordering::Relaxed))).expect("no zero in it");
        // SAFETY: the text lives through the call.
        unsafe { qemu_plugin_outs(text.as_ptr()) };
    }
}

/// Called by QEMU when it loads the plugin.
#[unsafe(no_mangle)]
pub extern "C" fn qemu_plugin_install(id: u64, _info: *const c_void, _argc: c_int, _argv: *const *const c_char) -> c_int {
    // SAFETY: both functions stay loaded as long as QEMU runs.
    unsafe {
        qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
        qemu_plugin_register_atexit_cb(id, ended, std::ptr::null_mut());
    }
    0
}
