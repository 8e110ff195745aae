"""Process of an `o80.View`: prints the address of the page, or an error, as a line of JSON."""

import json
import sys

from o80.base.errors import Error
from o80.base.finite import json_text
from o80.base.screen import keep_printing
from o80.view.serve import page_server, wait_for_end


def main() -> int:
    """Serves a page; the program's argument holds the options of `page_server`, as JSON."""
    keep_printing()
    try:
        with page_server(**json.loads(sys.argv[1])) as server:
            print(json_text({"url": server.url, "port": server.port}), flush=True)
            wait_for_end(until_eof=True)
    except Error as error:
        print(json_text({"error": str(error)}), flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
