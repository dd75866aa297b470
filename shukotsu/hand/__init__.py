"""Anatomy, rotations, joint angles, and the one reader of posed bones."""
