"""Compiled loops over frames: forward kinematics, derivatives, elimination and posing.

All arrays have frames as their last dimension, so that inner loops access contiguous memory and are
vectorised. Names are those of `operations` and `normal_equations`, which document the quantities. A branch
has m rows of residuals, six per receiver; columns of derivatives are in the order root, unknowns.

On paper: docs/whole-hand.md, sections 4 to 6.
"""
