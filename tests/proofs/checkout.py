"""Where the checkout lies that the proofs are about."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
