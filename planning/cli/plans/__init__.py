"""What `plan` does: one plan, a front of them, or again whenever the rig changes."""
