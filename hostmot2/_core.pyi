"""The C core: every public name of csrc/hm2.h."""

from typing import Any

ffi: Any
lib: Any
