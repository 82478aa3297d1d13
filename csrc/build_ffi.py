"""Build hostmot2._core: hm2.h is the interface, every C file below csrc/ is the core."""

import os
import re
import sysconfig
from pathlib import Path

from cffi import FFI

CSRC = Path(__file__).parent
ROOT = CSRC.parent


def declarations(header: str) -> str:
    """The C header as cffi wants it: no comments, no preprocessor but integer constants."""
    text = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    text = re.sub(r"^#define\s+HM2_H\s*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"^#(?!define).*$", "", text, flags=re.MULTILINE)
    return re.sub(r"^#define\s+(\w+)\s+.+$", r"#define \1 ...", text, flags=re.MULTILINE)


def files(pattern: str) -> list[str]:
    """Files below csrc/, relative to the project as setuptools wants them."""
    return sorted(str(path.relative_to(ROOT)) for path in CSRC.rglob(pattern))


def across_files() -> list[str]:
    """gcc optimizes over file borders: the emulated card answers a tenth sooner.

    Not for sanitizers and coverage, which look at files, nor with clang, which may lack the linker for it.
    """
    compiler = os.environ.get("CC") or str(sysconfig.get_config_var("CC"))
    instrumented = re.search(r"sanitize|coverage", f"{compiler} {os.environ.get('CFLAGS')}")
    return ["-flto=auto"] if "gcc" in compiler and not instrumented else []


ffibuilder = FFI()
ffibuilder.cdef(declarations((CSRC / "hm2.h").read_text()))
# the table parser asks Python for the memory of a remote behind a serial line
ffibuilder.cdef(
    'extern "Python" int hm2_toc_fetch_python(void *self, uint32_t address, uint32_t size, uint8_t *bytes,'
    " hm2_error *error);"
)
ffibuilder.set_source(
    "hostmot2._core",
    '#include "hm2.h"',
    sources=files("*.c"),
    depends=files("*.h"),
    include_dirs=["csrc"],
    libraries=["m"],
    extra_compile_args=[
        "-std=c11",
        "-O3",
        "-g",
        "-D_GNU_SOURCE",
        "-pthread",
        "-Wall",
        "-Wextra",
        "-fvisibility=hidden",
        *across_files(),
    ],
    extra_link_args=["-pthread", *across_files()],
    py_limited_api=True,
)
