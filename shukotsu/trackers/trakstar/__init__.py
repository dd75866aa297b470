"""trakSTAR and Flock of Birds on a serial line: records, and the set-up of the tracker."""
