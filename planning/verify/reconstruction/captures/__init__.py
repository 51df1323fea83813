"""Images and calibrations from outside."""
