"""Files by their bytes: written whole or not at all, read within limits, checked before they are used."""
