"""Which units sit in each other's place, while they are tracked."""
