"""Exceptions of o80, by the name under which users import them."""

from o80.base.errors import *  # noqa: F403
