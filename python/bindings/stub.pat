# what the stub of o80._core takes from the Python side of the package
_core.__prefix__:
    import numpy.typing
    import typing
    from o80.base.words import Reason, Status
    from o80.rows.record import Record, States

# public verbs of a frontend are declared in o80.frontend
^_core\.Frontend\.[a-z]\w*$:

