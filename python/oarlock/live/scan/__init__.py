"""What is in the air and on the wires: for `oarlock live scan`, `init` and `doctor`."""
