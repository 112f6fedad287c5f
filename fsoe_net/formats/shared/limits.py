"""Maximum sizes of files in bytes; a larger file is rejected before it is read."""

from __future__ import annotations

_MIB = 1024 * 1024

MAX_FILE_BYTES = 32 * _MIB  # if a format has no limit of its own
MAX_LARGE_BYTES = 256 * _MIB  # ESI files, standard input, files to compare with
MAX_RECORD_BYTES = 128 * _MIB  # an acceptance record, with its plan as text
MAX_PLAN_BYTES = 64 * _MIB  # the limit of fsn-master
MAX_PROJECT_BYTES = 64 * _MIB  # all files of a TwinCAT project together
MAX_PASTED_BYTES = 8 * _MIB
MAX_ALIAS_BYTES = 4 * _MIB  # an alias device of TwinSAFE
MAX_LOGO_BYTES = _MIB  # a picture that each report contains
MAX_SII_BYTES = 4 * _MIB  # an image, also as text
MAX_EEPROM_BYTES = _MIB
MAX_CACHED_BYTES = 64 * _MIB  # a list of the devices of an ESI
