"""A study and its configuration: sheets, layouts, models, mappings, plans, findings and verdicts."""
