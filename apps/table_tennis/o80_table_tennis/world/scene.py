"""The model file of the scene."""

from pathlib import Path

MODEL = Path(__file__).with_name("table_tennis.xml")
