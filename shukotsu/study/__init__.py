"""The one place where tables and configuration files are defined, read and written."""

PROGRAM = "shukotsu"
VERSION = "0.2.0"
