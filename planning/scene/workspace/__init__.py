"""Where devices may stand: shell, zones, tiles, candidate viewpoints."""
