"""Side view and front view of a model in one posture, as text for terminals and as SVG for pages."""
