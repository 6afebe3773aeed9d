"""A model in one posture: as text for a terminal, as SVG for a page. Side view and front view."""
