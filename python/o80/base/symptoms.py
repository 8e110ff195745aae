"""The pages of docs/symptoms, as errors and programs name them."""

import re

PAGES = {
    "attach_times_out": r"has no running backend",
    "late_loop": r"late or missed their tick|no iteration for|no row for",
    "lost_packet_halts": r"\bpackets?\b|ticks of the robot came in",
    "replay_differs": r"replay differs",
    "arm_does_not_move": r"^(NotReached|NotCompleted|BackendHalted):",
}
"""Name of each page, and a pattern of the texts that it explains. The first match counts."""


def see(page: str) -> str:
    """Returns a reference to one of the pages."""
    assert page in PAGES
    return f"See docs/symptoms/{page}.md."


def page_about(text: str) -> str:
    """Returns a reference to the page about a text, or an error ("CLASS: TEXT"); empty if none."""
    return next((see(page) for page, said in PAGES.items() if re.search(said, text)), "")
