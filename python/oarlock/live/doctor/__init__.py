"""Says why nothing comes: checks of this machine and of a rig, for `oarlock live doctor`."""
