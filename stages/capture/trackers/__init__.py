"""What trackers send and understand: a module or package a family, no input or output of its own.

settings (how a stream is to be read) -> a decoder (bytes in, records out); families: which has which.
"""
