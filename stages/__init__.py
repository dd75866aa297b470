"""The pipeline's stages, one module or package each: a section of the paper, its maths and its command."""

import sys

from schemas.limits import too_little_to_start

_too_little = too_little_to_start()
if _too_little:  # before the first library is loaded that would end in a traceback, or worse
    print(f"error: {_too_little}", file=sys.stderr)
    sys.exit(2)
