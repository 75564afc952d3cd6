"""What a folder, or a file and those that belong to it, hold."""

import hashlib
from pathlib import Path


def state_of(out: Path) -> dict[str, str]:
    """Return the hash of every file of a folder; of a file and those beside it whose names begin alike."""
    root = out if out.is_dir() else out.parent
    files = (p for p in root.rglob("*") if p.is_file() and not any(q.startswith(".edbb-") for q in p.parts))
    return {
        str(p.relative_to(root)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(files)
        if root == out or p.name.startswith(out.stem)
    }
