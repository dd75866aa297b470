"""Motion-BIDS: the Brain Imaging Data Structure's form of motion recordings, as it is read and written."""
