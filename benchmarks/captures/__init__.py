"""Captures that other people took."""
