"""How good each skeleton is: on recordings it was not made from, beside references, and against the truth."""
