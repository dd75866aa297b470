"""Shared by the report's tests: a synthetic study, and a reader of pages."""
