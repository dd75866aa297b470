"""Devices: what trackers send and understand, recording them, and the emulator that stands in for one."""
