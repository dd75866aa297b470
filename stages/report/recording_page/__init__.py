"""The page of one recording: the moving hand, plots that follow it, and the numbers behind."""
