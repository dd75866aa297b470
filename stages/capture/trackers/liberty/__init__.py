"""Polhemus LIBERTY and PATRIOT: output items, records in binary and in ASCII, commands and replies."""
