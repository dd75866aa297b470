"""Trackers: their protocols, the recorder, the raw archive and its decoders, and an emulated tracker."""
