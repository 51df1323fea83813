"""Covers with several needs or row sets."""
