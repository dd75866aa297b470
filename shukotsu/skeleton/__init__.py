"""Mathematics that stages share."""
