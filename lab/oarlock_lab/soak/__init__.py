"""Long runs of live sessions with devices that misbehave; how long packets take to become estimates and pictures."""
