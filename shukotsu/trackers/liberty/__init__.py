"""Polhemus LIBERTY and PATRIOT: items, records, commands and replies, the set-up, and an emulated device."""
