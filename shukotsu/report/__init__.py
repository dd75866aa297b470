"""The report: pages of the study, its subjects and recordings, with figures, viewer and translation."""
