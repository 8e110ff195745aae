"""Lists the GenICam cameras that answer: python -m o80_devices.cameras.list_cameras"""

from __future__ import annotations

import sys

import o80
from o80.base.descriptors import open_standard_streams
from o80_devices.cameras import aravis


def main() -> None:
    try:
        print("\n".join(aravis.found()) or "no camera answers")
    except o80.Error as error:
        sys.exit(f"o80: {error}")


if __name__ == "__main__":
    open_standard_streams()
    main()
