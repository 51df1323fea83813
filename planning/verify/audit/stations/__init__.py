"""Claims about heads, stations and steps of a turntable."""
