"""Clean streams and files of every tracker and format, and what must hold for damaged ones."""
