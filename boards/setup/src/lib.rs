//! The setup file and the firmware's validated settings.
