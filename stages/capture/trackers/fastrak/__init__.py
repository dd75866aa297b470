"""Polhemus FASTRAK: output items, records in binary and in ASCII."""
