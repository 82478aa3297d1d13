"""Process data the slow and obvious way: one big integer per channel, formulas as written in sserial.md 6."""

import math
import struct

INT31 = 2147483647


def get_bits(words, offset, bits):
    image = sum(word << (32 * i) for i, word in enumerate(words))
    return image >> offset & (1 << bits) - 1


def put_bits(words, offset, bits, raw):
    image = sum(word << (32 * i) for i, word in enumerate(words))
    mask = (1 << bits) - 1
    image = image & ~(mask << offset) | (raw & mask) << offset
    return [image >> (32 * i) & 0xFFFFFFFF for i in range(len(words))]


def signed(raw, bits):
    return raw - (1 << bits) if raw >> (bits - 1) else raw


def clamp(value, low, high):
    return low if value < low else high if value > high else value


def saturate(value, low, high):
    """Truncated toward zero and limited; rest for what is no number."""
    return 0 if math.isnan(value) else math.trunc(clamp(value, float(low), float(high)))


def portion(value, scale):
    """value / scale as IEEE 754 divides, rest for what cannot be."""
    if scale == 0 or math.isnan(scale) or math.isnan(value) or (math.isinf(value) and math.isinf(scale)):
        return 0.0
    return value / scale


def single(value):
    """As a 32-bit float; infinite where none is so large."""
    try:
        return struct.pack("<f", value)
    except OverflowError:
        return struct.pack("<f", math.copysign(math.inf, value))


def write(kind, bits, value, scale, low, high):
    """The raw bits for a value in user units."""
    full = (1 << bits) - 1
    if kind == "BOOLEAN":
        return full if value else 0
    value = clamp(value, low, high)
    if kind == "FLOAT":
        return int.from_bytes(single(value) if bits == 32 else struct.pack("<d", value), "little")
    if kind == "UNSIGNED":
        return min(saturate(portion(value, scale) * full, 0, full), full)
    if bits > 32:  # the same formula in 64 bits
        aligned = min(saturate(portion(value, scale) * 2.0**63, -(2**63), 2**63), 2**63 - 1)
        return (aligned >> (64 - bits)) & full
    aligned = saturate(portion(value, scale) * INT31, -INT31 - 1, INT31)
    return (aligned >> (32 - bits)) & full


def read(kind, bits, raw, scale):
    """The value in user units for raw bits."""
    if kind == "BOOLEAN":
        return raw != 0
    if kind == "FLOAT":
        return struct.unpack("<f" if bits == 32 else "<d", raw.to_bytes(bits // 8, "little"))[0]
    if kind == "UNSIGNED":
        return float(raw) * scale / float((1 << bits) - 1)
    if bits > 32:
        return float(signed(raw, bits) << (64 - bits)) / 2.0**63 * scale
    return (signed(raw, bits) << (32 - bits)) / INT31 * scale


def count(readings, bits):
    """The counter after each reading: movements are less than half the range."""
    total, previous = 0, 0
    for reading in readings:
        total += signed((reading - previous) % (1 << bits), bits)
        previous = reading
        yield signed(total % (1 << 64), 64)
