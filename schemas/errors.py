"""What a person can put right: bad input or bad configuration."""


class InputError(Exception):
    """Bad input or configuration, told in one sentence that names the place and says what to do.

    Command lines print the sentence and end with exit code 2; nothing else does.
    """
