# what the stub of o80._core takes from the Python side of the package
_core.__prefix__:
    from o80.words import Reason, Status
