"""Rigs for other programs: one file a format, all listed in `export_formats`."""
