"""Which parameters the readings can tell apart, and in words why the others are left out."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.design.assumptions import FAINT_SHARE, STRUCTURAL_ZERO_SHARE
from planner.design.observability.information import r_factor


@dataclass(frozen=True)
class DroppedParameter:
    """One parameter that is held at its nominal value, with the sentence that says why.

    ``direction`` is the unseen direction as ((name, coefficient), ...), in m and rad, unit length, this parameter's
    coefficient positive and no other dropped parameter in it.
    """

    name: str
    because: str
    direction: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class WeakParameter:
    """A kept parameter whose predicted standard deviation exceeds its prior sigma [m or rad]: it is hardly learnt."""

    name: str
    std: float
    prior: float


@dataclass(frozen=True)
class Identifiability:
    """What can be seen.

    ``kept`` column indices, ascending; ``names`` of those; ``dropped`` and ``weak`` as said there; ``rank``;
    ``spectrum`` (P,) singular values of the rms reading per prior sigma, descending; ``gap`` the ratio of the smallest
    seen to the largest unseen singular value (inf when nothing is unseen).
    """

    kept: tuple[int, ...]
    names: tuple[str, ...]
    dropped: tuple[DroppedParameter, ...]
    weak: tuple[WeakParameter, ...]
    spectrum: Array
    gap: float

    @property
    def rank(self) -> int:
        """The number of parameters that can be told apart."""
        return len(self.kept)


def _split_spectrum(scaled: Array, faint: float) -> tuple[Array, Array]:
    """Singular values (P,) of a scaled triangular factor and an orthonormal basis (P, k) of what is not seen."""
    _, mu, axes = np.linalg.svd(scaled)
    seen = (mu > STRUCTURAL_ZERO_SHARE * mu[0]) & (mu > faint) & (mu > 0)
    return mu, axes[~seen].T


def find_identifiable(
    rows: Array,
    names: Sequence[str],
    prior: Array | None = None,
    prefer: Sequence[int] | None = None,
    noise: float | None = None,
    readings: int | None = None,
) -> Identifiability:
    """Split the parameters into those the readings of ``rows`` (n, r, P) can tell apart and the rest.

    ``prior`` (P,) is the 1-sigma size of each parameter before measuring [m or rad]; ``prefer`` lists column indices in
    the order in which to keep them (default: as listed). With ``noise`` [m or rad], the standard deviation of a
    reading, and ``readings``, how many will be taken (default: all rows), a direction far fainter than its prior
    sigma is left out as well (:data:`FAINT_SHARE`), and parameters whose predicted standard deviation exceeds their
    prior sigma are listed in ``weak``.

    Raises:
        InputError: counts do not match, a prior is not positive, or no parameter is seen at all.
    """
    count = rows.shape[-1]
    size = np.ones(count) if prior is None else np.asarray(prior, dtype=float)
    order = list(range(count)) if prefer is None else list(prefer)
    _check_arguments(count, names, size, order)
    factor, stock = r_factor(rows), rows[..., 0].size
    total = readings or stock
    mu, null = _split_spectrum(
        factor * (size / np.sqrt(stock)), 0.0 if noise is None else FAINT_SHARE * noise / np.sqrt(total)
    )
    if null.shape[1] == count:
        raise InputError("no reading depends on any parameter: nothing can be identified from these poses")
    # of the largest share, from which a parameter may stand for an unseen direction: less if a preference is
    # named
    out = _choose_dropped_parameters(null, order, 0.5 if prefer is None else 0.1)
    out = _ensure_full_rank(factor * size, out)
    kept = tuple(k for k in range(count) if k not in out)
    seen = len(kept)
    faint = seen < count and bool(mu[seen] > STRUCTURAL_ZERO_SHARE * mu[0])
    dropped = _explain_dropped_parameters(null, out, names, size, faint)
    weak = () if noise is None else _find_weak(factor / np.sqrt(stock / total), names, size, kept, noise)
    gap = float(mu[seen - 1] / mu[seen]) if seen < count and mu[seen] > 0 else float("inf")
    return Identifiability(kept, tuple(names[k] for k in kept), dropped, weak, read_only(mu), gap)


def _check_arguments(count: int, names: Sequence[str], size: Array, order: list[int]) -> None:
    if len(names) != count or size.shape != (count,):
        raise InputError(f"{count} columns, but {len(names)} names and {size.size} prior sigmas")
    if np.any(size <= 0) or not np.all(np.isfinite(size)):
        bad = names[int(np.flatnonzero(~(size > 0) | ~np.isfinite(size))[0])]
        raise InputError(f"the prior sigma of {bad} must be a number above zero")
    if sorted(order) != list(range(count)):
        raise InputError("the order of preference must name every parameter once")


def _choose_dropped_parameters(null: Array, order: list[int], share: float) -> list[int]:
    """Pick one parameter for each unseen direction: the least preferred with a fair share in what is still unseen."""
    rest, out = null, list[int]()
    while rest.shape[1]:
        part = np.linalg.norm(rest, axis=1)
        part[out] = 0.0
        pick = next(k for k in reversed(order) if part[k] >= share * part.max())
        out.append(pick)
        toward = rest[pick] / np.linalg.norm(rest[pick])
        others = np.linalg.svd(toward[None])[2][1:].T  # the directions that leave the picked parameter alone
        rest = rest @ others
    return out


def _ensure_full_rank(scaled: Array, out: list[int]) -> list[int]:
    """Check that the kept columns have full rank; if not, choose afresh by QR with column pivoting."""
    kept = [k for k in range(scaled.shape[1]) if k not in out]
    mu = np.linalg.svd(scaled[:, kept], compute_uv=False)
    if mu[-1] > STRUCTURAL_ZERO_SHARE * mu[0]:
        return out
    pivots = qr(scaled, mode="r", pivoting=True)[1]
    return [int(k) for k in pivots[len(kept) :]]


def _explain_dropped_parameters(
    null: Array, out: list[int], names: Sequence[str], size: Array, faint: bool
) -> tuple[DroppedParameter, ...]:
    """Give each dropped parameter the one unseen direction that holds no other dropped one, and its sentence."""
    if not out:
        return ()
    echelon = null @ np.linalg.inv(null[out])
    found = []
    for column, pick in enumerate(out):
        vector = np.where(np.abs(echelon[:, column]) > 1e-6, echelon[:, column], 0.0) * size
        vector = vector / np.linalg.norm(vector)
        shares = vector.tolist()
        support = [k for k in range(len(names)) if shares[k] != 0.0]
        support.sort(key=lambda k: (k != pick, -round(abs(shares[k]), 9), k))
        direction = tuple((names[k], shares[k]) for k in support)
        found.append((pick, DroppedParameter(names[pick], explain_direction(direction, faint=faint), direction)))
    return tuple(each for _, each in sorted(found, key=lambda item: item[0]))


def _find_weak(
    factor: Array, names: Sequence[str], size: Array, kept: tuple[int, ...], noise: float
) -> tuple[WeakParameter, ...]:
    inverse = np.linalg.inv(np.linalg.qr(factor[:, list(kept)], mode="r"))
    std = noise * np.linalg.norm(inverse, axis=1)
    return tuple(
        WeakParameter(names[k], float(s), float(size[k])) for k, s in zip(kept, std, strict=True) if s > size[k]
    )


Direction = Sequence[tuple[str, float]]

_JOINT = re.compile(r"^(theta|alpha|a|d|beta|rx|ry|rz|x|y|z)_?(\d+)$")
_TURNING = {"theta", "alpha", "beta", "rx", "ry", "rz"}
SHOWN_TERMS = 4  # of a direction that are written out


@dataclass(frozen=True)
class _Term:
    """A name taken apart: what kind of parameter, of which joint (0: none), and its share in the direction."""

    name: str
    kind: str
    joint: int
    share: float


def _parse_name(name: str, share: float) -> _Term:
    match = _JOINT.match(name)
    if match:
        return _Term(name, match[1], int(match[2]), share)
    for prefix in ("fixture", "map", "tool", "base", "zero"):
        if name == prefix or name.startswith((prefix + "_", prefix + ".")):
            return _Term(name, prefix, 0, share)
    return _Term(name, "other", 0, share)


def explain_direction(direction: Direction, faint: bool = False) -> str:
    """Return why the first parameter of the unseen ``direction`` ((name, coefficient), ...) is held fixed.

    ``faint``: the direction does move the readings, but by less than noise and prior allow to see.
    """
    terms = [_parse_name(name, share) for name, share in direction]
    if faint:
        return (
            f"{_describe_coupling(terms)}: over all these poses the readings hardly change along"
            f" {format_direction(direction)}"
        )
    if len(terms) == 1:
        return _explain_single(terms[0])
    reason = _reason(terms)
    if reason:
        return f"{_describe_coupling(terms)}: {reason}{_format_mixture(direction)}"
    return f"{_describe_coupling(terms)}: no reading changes along {format_direction(direction)}"


def join_names(names: Sequence[str]) -> str:
    """Return names as a list in words, such as ``a, b and c``."""
    return ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else names[0]


def format_direction(direction: Direction) -> str:
    """Return a direction as text, such as ``0.95 theta6 + 0.32 alpha6``."""
    text = ""
    for name, share in direction[:SHOWN_TERMS]:
        sign = ("- " if share < 0 else "+ ") if text else ("-" if share < 0 else "")
        text += f"{' ' if text else ''}{sign}{abs(share):.2g} {name}"
    more = len(direction) - SHOWN_TERMS
    return text + (f" + {more} smaller" if more > 0 else "")


def _describe_coupling(terms: Sequence[_Term]) -> str:
    others = [t.name for t in terms[1:]]
    if not others:
        return f"{terms[0].name} is too faint"
    if len(others) > SHOWN_TERMS:
        others = [*others[: SHOWN_TERMS - 1], f"{len(others) - SHOWN_TERMS + 1} more"]
    return f"{terms[0].name} moves with {join_names(others)}"


def _format_mixture(direction: Direction) -> str:
    """Write the direction out unless it is a plain sum or difference of two."""
    shares = [abs(share) for _, share in direction]
    plain = len(shares) == 2 and abs(shares[0] - shares[1]) < 1e-3
    return "" if plain else f" (unseen: {format_direction(direction)})"


def _explain_single(term: _Term) -> str:
    if term.kind in ("theta", "rz") and term.joint:
        return f"{term.name} moves no reading: it only turns about axis {term.joint} what lies on that axis"
    if joint := re.fullmatch(r"compliance(\d+)", term.name):
        return f"{term.name} moves no reading: no weight turns joint {joint[1]}, at any of these poses"
    if term.kind == "zero":
        return f"{term.name} moves no reading: this gauge has no zero to find"
    return f"{term.name} moves no reading at any of these poses"


def _reason(terms: Sequence[_Term]) -> str:
    """Why no reading tells several parameters apart; empty where there is no simple reason."""
    kinds, joints, sizes = {t.kind for t in terms}, {t.joint for t in terms}, [abs(t.share) for t in terms]
    fixed, tool, first, last = kinds & {"fixture", "base"}, kinds & {"map", "tool"}, min(joints), max(joints)
    if kinds <= {"d", "z"} and 0 not in joints and max(sizes) - min(sizes) < 1e-3 * max(sizes):
        return f"axes {join_names([str(t.joint) for t in sorted(terms, key=lambda t: t.joint)])} are parallel"
    if kinds <= _TURNING and len(joints) == 1 and first:
        return f"with this tool offset both only turn the tool point about axis {first}"
    if fixed and not tool:
        return _fixture_reason(terms)
    if tool and not fixed and len(joints - {0}) == 1:
        return f"only where the tool point sits from axis {last} counts, not how the flange frame is drawn"
    if first and first == last:
        return f"within joint {first} they move the tool point the same way"
    if first and last - first == 1:
        return f"joints {first} and {last} share a motion that no reading can divide between them"
    return ""


def _fixture_reason(terms: Sequence[_Term]) -> str:
    """The arm as a whole and the fixture move together."""
    arm, kinds = {t.joint for t in terms if t.joint}, {t.kind for t in terms if t.joint}
    if any(t.kind == "base" for t in terms):
        return "only how the arm stands to the gauge's own frame counts, not what of that is the base's"
    if not arm:
        return "only the place of the fixture from the base counts"
    if len(arm) > 1:
        return "shifting these links together carries the tool point as moving the fixture does"
    joint = arm.pop()
    if kinds <= _TURNING:
        return f"turning the arm from joint {joint} on is the same as carrying the fixture round the other way"
    return f"shifting the arm at joint {joint} is the same as moving the fixture the other way"
