"""Names that a typed module of `o80 stub` imports."""

from o80.base.words import IdleWord as IdleWord
from o80.base.words import LateWord as LateWord
from o80.base.words import ModeWord as ModeWord
from o80.base.words import OnErrorWord as OnErrorWord
from o80.base.words import ProfileWord as ProfileWord
from o80.base.words import RowsWord as RowsWord
from o80.base.words import StartWord as StartWord
from o80.frontend.chunks import Chunks as Chunks
from o80.frontend.commander import Tolerance as Tolerance
from o80.frontend.robot_stub import check as check
from o80.rows.enumerations import EnumerationArray as EnumerationArray
from o80.rows.history import Range as Range
