"""Share code between the decoders of all families: settings and bytes in, records out; no I/O here."""
