"""Polhemus LIBERTY and PATRIOT: items, records, commands and replies, and the set-up."""
