"""Run-length codes of Radiance pictures and Targa images, decoded into `out`; returns bytes read, or -1 where the
code ends early or runs past the end of `out`."""

from __future__ import annotations

import numba


@numba.njit(cache=True, nogil=True)
def decode_radiance(data, out):  # type: ignore[no-untyped-def]
    """data (n,) uint8 -> out (lines, length, 4) uint8. Each line by its own code: new, old, or none."""
    at = 0
    for line in range(out.shape[0]):
        length = out.shape[1]
        new = (
            8 <= length <= 32767 and at + 4 <= len(data) and data[at] == 2 and data[at + 1] == 2 and data[at + 2] < 128
        )
        if new:
            if int(data[at + 2]) * 256 + int(data[at + 3]) != length:
                return -1
            at += 4
            for channel in range(4):
                pixel = 0
                while pixel < length:
                    if at + 2 > len(data):
                        return -1
                    count = int(data[at])
                    run = count > 128
                    if run:
                        count -= 128
                    if count == 0 or pixel + count > length or (not run and at + 1 + count > len(data)):
                        return -1
                    for k in range(count):
                        out[line, pixel + k, channel] = data[at + 1] if run else data[at + 1 + k]
                    pixel += count
                    at += 2 if run else 1 + count
        else:
            pixel = 0
            shift = 0
            while pixel < length:
                if at + 4 > len(data):
                    return -1
                if data[at] == 1 and data[at + 1] == 1 and data[at + 2] == 1:
                    # Runs that follow one another are the digits of one count, lowest first.
                    if pixel == 0 or shift > 24:
                        return -1
                    count = int(data[at + 3]) << shift
                    if pixel + count > length:
                        return -1
                    for k in range(count):
                        for channel in range(4):
                            out[line, pixel + k, channel] = out[line, pixel - 1, channel]
                    pixel += count
                    shift += 8
                else:
                    for channel in range(4):
                        out[line, pixel, channel] = data[at + channel]
                    pixel += 1
                    shift = 0
                at += 4
    return at


@numba.njit(cache=True, nogil=True)
def decode_targa(data, out):  # type: ignore[no-untyped-def]
    """data (n,) uint8 -> out (pixels, bytes) uint8: packets of one pixel repeated, or of pixels as they are."""
    at = 0
    pixel = 0
    width = out.shape[1]
    while pixel < out.shape[0]:
        if at >= len(data):
            return -1
        run = data[at] >= 128
        count = int(data[at] & 127) + 1
        at += 1
        if at + (width if run else count * width) > len(data) or pixel + count > out.shape[0]:
            return -1
        for k in range(count):
            for byte in range(width):
                out[pixel + k, byte] = data[at + byte] if run else data[at + k * width + byte]
        pixel += count
        at += width if run else count * width
    return at
