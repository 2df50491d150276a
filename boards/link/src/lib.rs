//! TCP, UDP, serial and file behind the Link contract.
