"""Motion-BIDS: the Brain Imaging Data Structure's form of motion recordings, its sidecars and numbers."""
