"""Which sensor fault explains a recording best: each fault is a hypothesis, tracked for one second."""
