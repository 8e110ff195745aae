"""``o80 view``: robots and recordings in the browser."""

from o80.view.view import View

__all__ = ["View"]
