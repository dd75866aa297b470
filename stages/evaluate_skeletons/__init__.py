"""Score each skeleton: on recordings it was not made from, beside references, and against the truth."""
