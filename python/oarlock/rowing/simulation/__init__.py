"""Simulated rowing: stroke shapes, sculling, sweep and ergometer motion, the boat, and the published experiment."""
