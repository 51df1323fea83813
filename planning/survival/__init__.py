"""Devices of which any one may be lost, and samples that several pairs measure."""
