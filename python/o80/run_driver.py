"""Runs a driver in Python as a process: python -m o80.run_driver module:Class FLAGS."""

import signal
import sys

signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the loop stops in order by it


def main() -> int:
    """Returns the exit code."""
    from o80.base.descriptors import open_standard_streams

    open_standard_streams()
    import o80._core as _core
    from o80.base.errors import Error
    from o80.base.screen import complain, keep_printing
    from o80.drivers.driver_class import found_to_run, library_of

    keep_printing()  # a driver that prints into a full device goes on
    place, *flags = sys.argv[1:]
    try:
        library = library_of(found_to_run(place), place)
    except Error as error:
        complain(str(error))
        return 1
    return _core.run_driver(library, [place, *flags])


if __name__ == "__main__":
    sys.exit(main())
