"""What a maker states of an area-scanning system, measured on simulated artefacts."""
