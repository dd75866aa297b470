"""What the decoders of all families share: settings and bytes in, records out; no I/O here."""
