"""What several formats require of a motion, refused in one sentence where it is not so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError
from stages.export.motion import SkeletonMotion


def require_whole(motion: SkeletonMotion, path: Path, name: str) -> None:
    """Raise InputError where the motion has no frame, or one without a pose of every joint.

    name : of the format, in the sentence.
    """
    if not len(motion.frame) or not motion.whole.all():
        raise InputError(
            f"{path}: {name} holds no frame without a pose and no file without a frame; choose --gaps hold, "
            "cut or interpolate"
        )


def require_times(motion: SkeletonMotion, times: npt.NDArray[Any], path: Path, name: str) -> None:
    """Raise InputError where the frames have no device time, or it does not grow.

    times : (T,) as the format holds them, from the motion's device time.
    """
    if len(times) < 2:
        return
    if not np.isfinite(motion.time_s).all():
        raise InputError(
            f"{path}: the recording has no device time, and {name} needs it; say its rate with --rate-hz"
        )
    still = np.flatnonzero(~(np.diff(times) > 0))
    if len(still):
        raise InputError(
            f"{path}: device time does not grow from frame {motion.frame[still[0]]} to the next, as in "
            f"{name} it must; choose --frames that leave this out"
        )
