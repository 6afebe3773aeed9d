"""Devices that are not there: virtual peripherals to develop against, by bumble (`oarlock[emulate]`)."""
