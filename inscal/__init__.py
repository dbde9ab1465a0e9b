"""Statistical proof for inertial calibration: physics, filter and statistics."""
