"""Compiled loops over frames, a chapter a module: forward, derivatives, elimination, posing.

Every array has its frames last, so that the inner loops run over neighbours in memory and become vector
instructions. Names are those of `operations` and `normal_equations`, which say what is computed. m : rows of
a branch's residuals, six of each receiver; columns of derivatives : root, then unknowns.

On paper: docs/whole-hand.md, sections 4 to 6.
"""
