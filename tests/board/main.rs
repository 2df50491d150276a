//! The box on an emulated Raspberry Pi 3: frames through a real V4L2 device, records over a real network and
//! a real UART, pins in real registers. `tests/board/prepare` makes what these tests boot; without it they
//! are left out.

mod camera_faults;
mod card;
mod cost;
mod formats;
mod packed;
mod pins;
mod receiver;
mod said;
mod same_bytes;
mod show;
mod uart;
