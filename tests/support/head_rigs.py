"""A rig whose projector and camera stand in one head, as tables of a file."""

LENS = {"resolution_px": [1000, 800], "focal_px": [1000.0, 1000.0]}
SHARP = {"range_mm": [300.0, 900.0]}
HEAD = {
    "name": "head",
    "working_mm": 500.0,
    "near_mm": 400.0,
    "far_mm": 600.0,
    "near_size_mm": [200.0, 150.0],
    "far_size_mm": [300.0, 225.0],
    "projector": [
        {"name": "p", "position_mm": [0.0, 0.0, 0.0], "aim_mm": [0.0, 0.0, 500.0]}
    ],
    "camera": [
        {"name": "c", "position_mm": [150.0, 0.0, 0.0], "aim_mm": [0.0, 0.0, 500.0]}
    ],
}
RIG = {
    "name": "rig",
    "projector": {"name": "lamp", **LENS, **SHARP},
    "camera": {"name": "eye", **LENS, **SHARP},
    "head": HEAD,
}
