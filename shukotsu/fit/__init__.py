"""Fit of a whole hand: joints, bones, receiver placement and skin motion together, with anatomy as a prior.

On paper: docs/whole-hand.md, whose sections are named in each module.
"""
