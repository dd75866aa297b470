"""From the raw archive to records, in two passes over the file, so that memory does not grow with it."""
