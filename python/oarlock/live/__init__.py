"""From sensors that send to joint angles, while the athlete moves."""
