"""Polhemus FASTRAK: items, records in binary and in ASCII, the set-up, and an emulated device."""
