"""Section 6 of the paper: replay the skeleton and measure how far its tips are from the distal receivers."""
