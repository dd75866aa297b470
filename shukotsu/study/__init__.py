"""A study and its configuration: sheets, layouts, models, mappings, plans, findings and verdicts."""

PROGRAM = "shukotsu"
VERSION = "0.2.0"
