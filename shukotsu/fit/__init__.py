"""A whole hand fitted at once: every joint, every receiver's place and its skin, weighed against anatomy.

On paper: docs/whole-hand.md, whose sections the modules name.
"""
