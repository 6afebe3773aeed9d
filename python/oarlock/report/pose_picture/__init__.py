"""Side view and front view of a model in one posture, as SVG."""
