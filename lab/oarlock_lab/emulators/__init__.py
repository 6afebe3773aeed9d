"""Devices that are not there, to develop against: the bytes of real ones, by UDP, TCP, serial line, Bluetooth."""
