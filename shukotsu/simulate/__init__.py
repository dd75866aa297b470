"""Stage: a simulated hand, recorded as a lab would record it, with the exact truth beside it."""
