"""Measure what fingers do at a keystroke: contact, angles, and how far the other fingers go along."""
