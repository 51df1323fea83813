"""Claims about devices, zones and housings."""
