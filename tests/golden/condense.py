"""What is kept of a file that a command wrote: enough to see any change, small enough for the repository.

Lists of numbers keep their length, their first and last value and weighted sums; the weights differ from place to
place, so that two values cannot be exchanged unseen. Tables keep that for each column, and some rows.
"""

import hashlib
import json
import math
import re
import tomllib

LONG = 24  # entries of a list; longer ones are summed up
ROWS = 6  # of a table or of a list of objects that are kept whole
LINES = 12  # of a program
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
VOLATILE = {"timings.json"}
MADE_OF_OTHERS = {"robot_sha256": "of what robot.toml says"}  # whose last digit is another on another processor


def condense(path):
    """Return what is kept of one file."""
    suffix = path.suffix.lower()
    if path.name in VOLATILE:
        return {"there": True}
    if suffix in (".png", ".svg", ".pdf"):
        return {"picture": path.stat().st_size > 1000}
    if suffix == ".html":
        return {"page": path.stat().st_size > 1000}
    if suffix == ".json":
        return {"json": short(json.loads(path.read_text()))}
    if suffix == ".toml":
        return {"toml": short(tomllib.loads(path.read_text()))}
    if suffix == ".csv":
        return table(path.read_text())
    return text(path.read_bytes())


def text(data):
    """A hash over the bytes, and some lines by which a difference is understood."""
    lines = data.decode("latin-1").splitlines()
    step = max(1, len(lines) // LINES)
    some = {str(k + 1): lines[k] for k in range(0, len(lines), step)}
    return {"sha256": hashlib.sha256(data).hexdigest(), "lines": len(lines), "some": some}


def short(value):
    """The value with long lists summed up, and numbers with fifteen digits."""
    if isinstance(value, dict):
        return {k: MADE_OF_OTHERS[k] if k in MADE_OF_OTHERS and v else short(v) for k, v in value.items()}
    if isinstance(value, list):
        return _list(value)
    return float(f"{value:.14g}") if isinstance(value, float) and math.isfinite(value) else value


def _list(values):
    numbers = list(_numbers(values))
    if len(numbers) > LONG and not any(isinstance(v, (dict, str)) for v in values):
        return {"length": len(values), **sums(numbers)}
    if len(values) <= ROWS or not all(isinstance(v, (dict, list)) for v in values):
        return [short(v) for v in values]
    rest = [json.dumps(short(v), sort_keys=True, ensure_ascii=False) for v in values[ROWS // 2 : -ROWS // 2]]
    numbers = [float(n) for line in rest for n in NUMBER.findall(NAMES.sub("", line))]
    words = hashlib.sha256("\n".join(NUMBER.sub("", line) for line in rest).encode()).hexdigest()[:16]
    first, last = ([short(v) for v in part] for part in (values[: ROWS // 2], values[-ROWS // 2 :]))
    return {"length": len(values), "first": first, "between": {"words": words, **sums(numbers)}, "last": last}


NAMES = re.compile(r'"[^"]*":?')


def _numbers(value):
    if isinstance(value, list):
        for v in value:
            yield from _numbers(v)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield float(value)


def sums(numbers):
    """Count, ends and weighted sums of numbers; what is no number counts by itself."""
    finite = [v for v in numbers if math.isfinite(v)]
    out = {"count": len(numbers), "odd": len(numbers) - len(finite)}
    if not finite:
        return out
    weighted = sum(v * _weight(k) for k, v in enumerate(finite))
    size = sum(abs(v) for v in finite)
    return out | {
        "ends": [finite[0], finite[-1]],
        "size": float(f"{size:.14g}"),
        "weighted": {"sum": float(f"{weighted:.14g}"), "scale": float(f"{size:.6g}")},
    }


def _weight(k):
    return 1.0 + 0.5 * math.sin(1.0 + 2.3998277 * k)


def table(content):
    """Comments, columns, and a few rows of a table; each column's numbers in sums, its words in a hash."""
    lines = content.splitlines()
    comments = [line for line in lines if line.startswith("#")]
    rows = [line.split(",") for line in lines if line and not line.startswith("#")]
    head, body = rows[0], rows[1:]
    columns = {}
    for k, name in enumerate(head):
        cells = [row[k] if k < len(row) else "" for row in body]
        values = [_float(c) for c in cells]
        words = [c for c, v in zip(cells, values, strict=True) if v is None]
        columns[name] = sums([v for v in values if v is not None])
        if words:
            columns[name]["words"] = hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]
    step = max(1, len(body) // ROWS)
    return {
        "comments": comments,
        "rows": len(body),
        "columns": columns,
        "some": {str(k): body[k] for k in range(0, len(body), step)},
    }


def _float(cell):
    try:
        return float(cell)
    except ValueError:
        return None
