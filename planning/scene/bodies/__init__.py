"""Devices that take room: existing ones, housings, and where one has clearance."""
