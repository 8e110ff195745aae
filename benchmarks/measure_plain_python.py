"""A plain loop without o80, by which absolute budgets are scaled: calls that do nothing."""

from o80 import _core
from sampling import rounds, sample, seconds, take_priority

CALLS = 20_000


def calling() -> None:
    nothing = _core.version
    for _ in range(CALLS):
        nothing()


def main() -> None:
    take_priority()
    calling()
    for _ in range(rounds()):
        sample("plain_python", "ns", seconds(calling) / CALLS * 1e9)


if __name__ == "__main__":
    main()
