"""Counterparts of the devices that speak their wire protocols."""
