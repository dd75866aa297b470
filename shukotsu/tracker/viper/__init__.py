"""Polhemus VIPER: frames with a checksum, and the set-up of the tracker."""
