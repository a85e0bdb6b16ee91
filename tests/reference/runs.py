"""Run-length codes, straight from their descriptions: Radiance's two (Ward) and Targa's packets."""


def radiance(data: bytes, lines: int, length: int) -> list[list[tuple[int, ...]]]:
    """Lines of pixels of four bytes; IndexError where the data end early."""
    stream = iter(data)

    def take(count):
        got = [next(stream, None) for _ in range(count)]
        if None in got:
            raise IndexError
        return got

    picture = []
    for _ in range(lines):
        first = take(4)
        line: list[tuple[int, ...]] = []
        if first[:2] == [2, 2] and first[2] * 256 + first[3] == length and length >= 8:
            channels = []
            for _ in range(4):
                channel: list[int] = []
                while len(channel) < length:
                    (code,) = take(1)
                    channel += take(1) * (code - 128) if code > 128 else take(code)
                channels.append(channel)
            line = list(zip(*channels, strict=True))
        else:
            shift = 0
            pixel = first
            while True:
                if pixel[:3] == [1, 1, 1]:
                    line += [line[-1]] * (pixel[3] << shift)
                    shift += 8
                else:
                    line.append(tuple(pixel))
                    shift = 0
                if len(line) >= length:
                    break
                pixel = take(4)
        picture.append(line)
    return picture


def targa(data: bytes, pixels: int, size: int) -> list[bytes]:
    out: list[bytes] = []
    at = 0
    while len(out) < pixels:
        head, at = data[at], at + 1
        count = (head & 127) + 1
        if head & 128:
            out += [data[at : at + size]] * count
            at += size
        else:
            out += [data[at + k * size : at + (k + 1) * size] for k in range(count)]
            at += count * size
    return out
