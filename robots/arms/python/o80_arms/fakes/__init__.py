"""Counterparts of the arms that speak their wire protocols."""
