"""The report: one self-contained page that says what a study found and how far to trust it."""
