"""Streams of LabStreamingLayer: recorded as they come, decoded afterwards, and sent."""
