"""Not in the paper: events of recordings, on the recording's own clock."""
