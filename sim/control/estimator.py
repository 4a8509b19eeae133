"""What sensors and wheels err by, from measurements while contacts are closed.

With closed contacts object i stands at its place X_i on the plate, and what is measured of it at t is

    z_i(t) = C P(t - tau; s_v, c, s_w) X_i B_i + noise,

P the pose that the plate has been told to go to (or odometry says), its motions scaled by 1 + s_v along, 1 + s_w in
turns and drifting aside by c of the way; C where the plate really started; B_i the error of what is measured of
object i. All are constants without process noise, so that a slip is none of them; the most likely ones are found by
Gauss-Newton, with priors and Student's t for outliers. What has no information stays at its prior, and is told as not
observable yet.

Scales and drift are those of the wheels' frame (`Pusher.wheels_pose`). In a frame at a distance d aside of that, a
turn by theta would seem to go s_v d theta farther: 6 mm for 3 %, 0.2 m and 1 rad, which no constant explains.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pushplan.geometry.se2 import between, chained, compose, exp, inverse, log, relative, rotate, twist_of, wrap_angle
from pushplan.sim.control.sensing import NOISY, noise_between
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.values import COMMON, DELAY, NAMES, OWN, START_THETA, WHEELS, errors_in_words
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

ROOM = 320
"""Samples kept; when there are more, every second one of the older half goes."""
HOLD = 0.4
"""Age that a sample has to have before it is learned from, s: what happens is noticed before it can be explained."""
FREEDOM = 4.0
"""Degrees of freedom of Student's t."""
MODEL = (3e-4, 1e-3)
"""What the model errs by whatever is known, m and rad."""
STEPS = np.array([1e-5, 1e-5, 1e-5, 1e-4, 1e-5, 1e-5, 1e-5])
"""Steps of the differences by which derivatives are taken."""
KNOT = 10
"""Poses of the plate between two that its way is added up from."""
PINNED = 1e6
"""Factor of what is likely of a value by which it is held where it is."""
KNOWN = 1.0 / 3.0
"""Share of what is likely of a value up to which it has to be known to outlast a departure."""
DOUBT = 0.2
"""Share of what is likely of them that is doubted of what a push before has told."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A measurement with closed contacts.

    Attributes:
        time: When, s.
        poses: (n, 3) of the objects, NaN where unseen.
        places: (n, 3) X_i.
        noise: (2,) its standard deviations as stated, m and rad.
        found: (2,) likewise as found from measurements about then; None while there are too few.
    """

    time: float
    poses: FloatArray
    places: FloatArray
    noise: FloatArray
    found: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Linear:
    """What samples tell, made linear in the values.

    Attributes:
        samples: Of what.
        sigma: (m, 3) what errors are divided by, m, m and rad.
        seen: (k, n) whether an object was.
        errors: (m, 3) of all that were seen, sample by sample.
        jacobian: (m, 3, p) their derivatives by the values.
        weights: (m,) by Student's t.
        gradient: (p,) of half the squares, priors included, by the values.
        hessian: (p, p) likewise.
    """

    samples: list[Sample]
    sigma: FloatArray
    seen: BoolArray
    errors: FloatArray
    jacobian: FloatArray
    weights: FloatArray
    gradient: FloatArray
    hessian: FloatArray


class Estimator:
    """Estimates constants of the sensors and of the plate's motion.

    Args:
        settings: Its priors.
        normals: (n, 2) of the contact that each object is pushed through, in the frame of the places.
        wheels: (3,) pose of what the wheels move in the frame that is told of and in which the places are.
        known: Of a push before: what it found of clock and wheels is the prior.
        aside_deviation: Standard deviation of where the load is along the plate, m: the plate has come up to it.
            That is no error of the camera, and the plate stands elsewhere by as much.
        places: (n, 3) of the objects in such a load.
        headings: (n,) standard deviations of what their headings are measured wrong, rad; None: as settings have it.

    Attributes:
        settings: See there.
        values: (7 + 3 n,) x, y (m), theta (rad) of C, tau (s), s_v, c, s_w, and of each object x, y, theta of B_i.
        covariance: Of these.
    """

    def __init__(
        self,
        settings: ControlSettings,
        normals: FloatArray,
        wheels: FloatArray,
        known: Estimator | None = None,
        *,
        aside_deviation: float = 0.0,
        places: FloatArray | None = None,
        headings: FloatArray | None = None,
    ) -> None:
        self.settings, self._normals, self._wheels = settings, normals, wheels
        self._count = count = len(normals)
        gauge = [settings.start_error[0]] * 2 + [settings.start_error[1]]
        scale = settings.odometry_error
        bias = [settings.bias[0]] * 2 + [settings.bias[1]]
        self._prior = np.array([*gauge, settings.delay_error, scale, scale, scale, *(bias * count)])
        if headings is not None:
            self._prior[COMMON + 2 :: 3] = headings
        self._center = np.zeros(len(self._prior))
        if known is not None:
            self._center[OWN] = known.values[OWN]
            self._prior[OWN] = np.maximum(np.sqrt(np.diag(known.covariance)[OWN]), DOUBT * self._prior[OWN])
        self._along = np.zeros(3 * count)  # how offsets change if the load stands 1 m farther to the left
        if aside_deviation > 0.0 and places is not None:
            self._along.reshape(-1, 3)[:, :2] = self._tangents(places)
        self._shift = aside_deviation * np.array([0.0, 1.0, *np.zeros(COMMON - 2), *-self._along])  # of all values
        self.values: FloatArray = self._center.copy()
        self.covariance: FloatArray = self._likely
        self._found = np.zeros(2)
        self._precision: FloatArray = _inverse(self._likely)
        self._history, self._count_moved = np.zeros((1024, 4)), 0
        self._knots: list[FloatArray] = []
        self._samples: list[Sample] = []

    @property
    def _likely(self) -> FloatArray:
        """(p, p) covariance of the values before anything was measured."""
        return np.asarray(np.diag(self._prior**2) + np.outer(self._shift, self._shift))

    @property
    def count(self) -> int:
        """Number of samples that are kept."""
        return len(self._samples)

    @property
    def headings(self) -> tuple[FloatArray, FloatArray]:
        """By what headings are measured wrong (n,), and standard deviations, rad."""
        return self.values[COMMON + 2 :: 3], np.sqrt(np.diag(self.covariance)[COMMON + 2 :: 3])

    @property
    def late(self) -> float:
        """By how much measurements may be late, s."""
        return max(0.0, float(self.values[DELAY] + 2.0 * math.sqrt(self.covariance[DELAY, DELAY])))

    def noise(self, samples: Sequence[Sample]) -> FloatArray:
        """Return standard deviations (k, 2) of samples, m and rad, as stated or as found where that is more."""
        stated = np.array([sample.noise for sample in samples])
        found = np.array([self._found if sample.found is None else sample.found for sample in samples])
        return np.asarray(np.maximum(np.maximum(stated, found), 1e-6))

    def unstamped(self) -> None:
        """Expect what comes without a time to be late."""
        late = self.settings.late
        self._center[DELAY], self._prior[DELAY] = late, late
        self.values[DELAY], self.covariance[DELAY, DELAY] = late, late**2
        self._precision = _inverse(self._likely)

    def moved(self, time: float, plate: FloatArray) -> None:
        """Take down where the plate is by what it was told, or by odometry (3,)."""
        k = self._count_moved
        if k == len(self._history):
            self._history = np.concatenate([self._history, np.zeros_like(self._history)])
        self._history[k] = time, *plate
        self._count_moved = k + 1
        if k and k % KNOT == 0:
            self._knots.append(log(relative(self._history[k - KNOT, 1:], plate)))

    def add(self, sample: Sample) -> None:
        """Take down a measurement with closed contacts."""
        self._samples.append(sample)
        if len(self._samples) > ROOM:
            half = ROOM // 2
            self._samples = self._samples[:half:2] + self._samples[half:]

    def forget(self, since: float, until: float) -> None:
        """Forget what was measured between two times: something happened then, or contacts were open."""
        self._samples = [sample for sample in self._samples if not since <= sample.time <= until]

    def plate(self, time: float) -> FloatArray:
        """Return where the plate is or was at a time (3,), as the measured poses have it."""
        return np.asarray(self._plates(self.values, *self._moments(np.array([time])))[0])

    def astray(self, driven: float, turned: float) -> float:
        """Return how far the plate may have gone astray, a standard deviation in m, on a way that nothing watched.

        Args:
            driven: m.
            turned: rad, to either side.
        """
        heading, _, along, aside, turns = (math.sqrt(self.covariance[p, p]) for p in range(START_THETA, COMMON))
        return math.hypot(heading, along, aside, 0.5 * turns * turned) * driven

    def scaled(self, twist: FloatArray, wheels: FloatArray) -> FloatArray:
        """Return the body twist (3,) that a frame does when it is told another.

        Args:
            twist: (3,) as told.
            wheels: (3,) pose of the wheels' frame in that frame.
        """
        return np.asarray(_scaled(twist[None], self.values, wheels)[0])

    def asked(self, twist: FloatArray, wheels: FloatArray) -> FloatArray:
        """Return the body twist (3,) to tell a frame so that it does another; see `scaled`."""
        s, c, w = self.values[WHEELS]
        x, y, turn = twist_of(wheels, twist)
        size = (1 + s) ** 2 + c**2
        told = [((1 + s) * x + c * y) / size, ((1 + s) * y - c * x) / size, turn / (1 + w)]
        return twist_of(inverse(wheels), told)

    def unbiased(self, poses: FloatArray, places: FloatArray) -> FloatArray:
        """Return measured poses (n, 3) without what of their errors can be told from slides: normal and angle.

        Args:
            poses: As measured.
            places: (n, 3) X_i.
        """
        bias = self.values[COMMON:].reshape(-1, 3)
        return compose(poses, inverse(bias - self._aside(places)))

    def aside(self, places: FloatArray) -> tuple[float, float]:
        """Return how far along the plate the load is from where it is taken to be, and the standard deviation of it.

        Args:
            places: (n, 3) X_i.

        Returns:
            Both in m; to the left is positive.
        """
        gradient = np.zeros((self._count, 3))
        gradient[:, :2] = self._tangents(places) / self._count
        along = np.concatenate([np.zeros(COMMON), gradient.reshape(-1)])
        return float(along @ self.values), math.sqrt(along @ self.covariance @ along)

    def take_for_closed(self, resting: Sample, recent: Iterable[Sample]) -> None:
        """Begin once more from objects at rest that have slid to new places, where contacts are closed.

        Errors along the contacts were slides; what the objects still seem off is the camera's. Of the samples before
        only what they tell of the plate is kept: the offsets of objects that have slid would be taken for its errors.

        Args:
            resting: Mean of what was measured, and the new places.
            recent: Measurements at rest; with what comes next, they tell the delay.
        """
        self.values = self.values - np.append(np.zeros(COMMON), self._aside(resting.places))
        (rest,) = self.residuals([resting])
        self.values[COMMON:] += rest.reshape(-1)
        likely, doubted = self._likely, np.diag((DOUBT * self._prior[:COMMON]) ** 2)
        likely[:COMMON], likely[:, :COMMON] = 0.0, 0.0
        likely[:COMMON, :COMMON] = self.covariance[:COMMON, :COMMON] + doubted
        self._precision = _inverse(likely)
        self._center, self._samples = self.values, []
        for one in recent:
            self.add(replace(one, places=resting.places))
        self.fit(resting.time + HOLD)

    def _tangents(self, places: FloatArray) -> FloatArray:
        """Return the directions (n, 2) along the contacts in the frames of the objects at places (n, 3)."""
        along = np.arctan2(self._normals[:, 1], self._normals[:, 0]) + 0.5 * np.pi - places[:, 2]
        return np.stack([np.cos(along), np.sin(along)], axis=-1)

    def _aside(self, places: FloatArray) -> FloatArray:
        """Return what of the errors (n, 3) in the objects' frames is along the contacts."""
        t = self._tangents(places)
        bias = self.values[COMMON:].reshape(-1, 3)
        tangential = (bias[:, :2] * t).sum(axis=1, keepdims=True) * t
        return np.concatenate([tangential, np.zeros((len(bias), 1))], axis=1)

    def residuals(self, samples: list[Sample]) -> FloatArray:
        """Return what measurements are off (k, n, 3) of what is expected with closed contacts, in their frames."""
        times, poses, places = _arrays(samples)
        plates = self._plates(self.values, *self._moments(times - self.values[DELAY]))
        return self._errors(plates, poses, places)

    def spread(self, sample: Sample) -> FloatArray:
        """Return the standard deviations (n, 2) of what is expected of the objects then, m and rad."""
        jacobian = self._linear([sample])[1][0]
        own = np.einsum("nip,pq,niq->ni", jacobian, self.covariance, jacobian)
        position, angle = 0.5 * own[:, :2].sum(axis=1), own[:, 2]
        return np.asarray(np.sqrt(np.stack([position + MODEL[0] ** 2, angle + MODEL[1] ** 2], axis=-1)))

    def fit(self, now: float) -> None:
        """Find the most likely values for all samples that are old enough."""
        self._look_at_noise(now - HOLD)
        samples = [sample for sample in self._samples if sample.time <= now - HOLD]
        if len(samples) < 8:
            return
        linear = self.linear(samples)  # one Gauss-Newton step on from the last fit
        self.covariance = _inverse(linear.hessian)
        self.values = self.values - self.covariance @ linear.gradient

    def doubt(self, now: float) -> None:
        """Take what is not known well of clock and wheels for unknown: an object has left its place.

        It may have begun to before that was noticed: a slide at the beginning of a push looks like wheels that err in
        turns. Start and offsets are fitted once more without.
        """
        sigma = np.sqrt(np.diag(self.covariance))
        unsure = np.zeros(len(sigma), dtype=np.bool_)
        unsure[OWN] = sigma[OWN] > KNOWN * self._prior[OWN]
        precision = self._precision
        self._precision = precision + np.diag(np.where(unsure, (PINNED / self._prior) ** 2, 0.0))
        self.values = np.where(unsure, self._center, self.values)
        self.fit(now)
        self._precision = precision
        self.covariance[unsure], self.covariance[:, unsure] = 0.0, 0.0
        self.covariance += np.diag(np.where(unsure, self._prior**2, 0.0))

    def linear(self, samples: list[Sample] | None = None) -> Linear:
        """Return what samples, or all that are kept, tell near the values."""
        samples = self._samples if samples is None else samples
        errors, jacobian = self._linear(samples)
        sigma = np.broadcast_to(self.noise(samples)[:, None, [0, 0, 1]], errors.shape)
        errors, jacobian = errors / sigma, jacobian / sigma[..., None]
        seen = ~np.isnan(errors[..., 0])
        weights = (FREEDOM + 3.0) / (FREEDOM + (errors[seen] ** 2).sum(axis=1))
        errors, jacobian = errors[seen], jacobian[seen]
        weighted = (weights[:, None, None] * jacobian).reshape(-1, len(self.values)).T
        hessian = weighted @ jacobian.reshape(-1, len(self.values)) + self._precision
        gradient = weighted @ errors.reshape(-1) + self._precision @ (self.values - self._center)
        return Linear(samples, sigma[seen], seen, errors, jacobian, weights, gradient, hessian)

    def ways(self, samples: list[Sample]) -> FloatArray:
        """Return how far the plate had driven (k,) when samples were taken, m."""
        history = self._history[: self._count_moved]
        ways = np.append(0.0, np.cumsum(np.hypot(*np.diff(history[:, 1:3], axis=0).T)))
        times = np.array([sample.time for sample in samples]) - self.values[DELAY]
        return np.asarray(np.interp(times, history[:, 0], ways))

    def estimates(self, names: Sequence[str]) -> dict[str, tuple[float, float]]:
        """Return values and their standard deviations, SI units, by name.

        `start x`, `start y`, `start theta` of the plate, `delay` of measurements, `odometry` (share that the wheels
        go too far), `drift` aside, `turns`; and of each object that is named, what its measurements are off in its
        own frame, as `NAME x`.
        """
        own = [f"{name} {axis}" for name in names for axis in ("x", "y", "theta")]
        sigma = np.sqrt(np.diag(self.covariance))
        return {key: (float(v), float(s)) for key, v, s in zip([*NAMES, *own], self.values, sigma, strict=False)}

    def words(self) -> str:
        """Return what was found, and what was not."""
        values, along = self.values.copy(), self._along
        if along.any():  # a load that stands elsewhere on the plate is no offset of the camera
            values[COMMON:] -= along * (values[COMMON:] @ along) / (along @ along)
        return errors_in_words(values, np.sqrt(np.diag(self.covariance)), self._prior)

    def _look_at_noise(self, until: float) -> None:
        """Estimate the noise of the last samples up to a time; earlier ones keep what was found then.

        A camera that gets worse has measured well before.
        """
        recent = [sample for sample in self._samples if sample.time <= until][-4 * NOISY :]
        if len(recent) < 2:
            return
        found = noise_between(np.array([sample.time for sample in recent]), self.residuals(recent))
        if found is not None:
            since, self._found = recent[-2 * NOISY :][0].time, found
            self._samples = [replace(s, found=found) if s.time >= since else s for s in self._samples]

    def _errors(self, plates: FloatArray, poses: FloatArray, places: FloatArray) -> FloatArray:
        expected = compose(plates[:, None], compose(places, self.values[COMMON:].reshape(-1, 3)))
        errors = relative(expected, poses)
        errors[..., 2] = wrap_angle(errors[..., 2])
        return errors

    def _linear(self, samples: list[Sample]) -> tuple[FloatArray, FloatArray]:
        """Return errors (k, n, 3) and their derivatives (k, n, 3, p); by those of B_i, which is small, minus 1."""
        times, poses, places = _arrays(samples)
        moments = self._moments(times - self.values[DELAY])
        plates = self._plates(self.values, *moments)
        moved = np.zeros((len(samples), 3, COMMON))  # body motions of the plate by each value
        away = plates[:, :2] - compose(self._history[0, 1:], self.values[:3])[:2]
        for p in (0, 1):
            ahead = rotate(float(self._history[0, 3]), np.eye(3)[p, :2])
            moved[:, :2, p] = rotate(-plates[:, 2], np.broadcast_to(ahead, away.shape))
        moved[:, :2, START_THETA] = rotate(-plates[:, 2], np.stack([-away[:, 1], away[:, 0]], axis=-1))
        moved[:, 2, START_THETA] = 1.0
        for p in range(DELAY, COMMON):
            values = self.values.copy()
            values[p] += STEPS[p]
            at = self._moments(times - values[DELAY]) if p == DELAY else moments
            moved[:, :, p] = log(relative(plates, self._plates(values, *at))) / STEPS[p]
        there = compose(places, self.values[COMMON:].reshape(-1, 3))
        jacobian = np.zeros((*there.shape, len(self.values)))
        arm = np.stack([-there[..., 1], there[..., 0]], axis=-1)[..., None] * moved[:, None, 2:, :]
        motion = moved[:, None, :2, :] + arm
        cos, sin = np.cos(there[..., 2])[..., None], np.sin(there[..., 2])[..., None]
        jacobian[:, :, 0, :COMMON] = -(cos * motion[:, :, 0] + sin * motion[:, :, 1])
        jacobian[:, :, 1, :COMMON] = sin * motion[:, :, 0] - cos * motion[:, :, 1]
        jacobian[:, :, 2, :COMMON] = -moved[:, None, 2, :]
        for i in range(self._count):
            jacobian[:, i, :, COMMON + 3 * i : COMMON + 3 * i + 3] = -np.eye(3)
        return self._errors(plates, poses, places), jacobian

    def _moments(self, times: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the knot (k,) before each time, and the motion (k, 3) since it, as told."""
        times_moved, history = self._history[: self._count_moved, 0], self._history[: self._count_moved, 1:]
        last = len(history) - 1
        at = np.clip(times, times_moved[0], times_moved[-1])
        k = np.clip(np.searchsorted(times_moved, at, side="right") - 1, 0, max(last - 1, 0))
        after = np.minimum(k + 1, last)
        span = times_moved[after] - times_moved[k]
        share = (at - times_moved[k]) / np.where(span > 0.0, span, 1.0)
        poses = between(history[k], history[after], share[:, None])
        knot = k // KNOT
        return knot, log(relative(history[knot * KNOT], poses))

    def _plates(self, values: FloatArray, knot: IntArray, rest: FloatArray) -> FloatArray:
        """Return where the plate was (k, 3) so far behind knots."""
        begin = compose(self._history[0, 1:], values[:3])
        chain = chained(begin, exp(_scaled(np.array(self._knots).reshape(-1, 3), values, self._wheels)))
        return compose(chain[knot], exp(_scaled(rest, values, self._wheels)))


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _arrays(samples: list[Sample]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times (k,), poses (k, n, 3) and places (k, n, 3) of samples."""
    times = np.array([sample.time for sample in samples])
    return times, np.array([s.poses for s in samples]), np.array([s.places for s in samples])


def _scaled(twists: FloatArray, values: FloatArray, wheels: FloatArray) -> FloatArray:
    """Return the twists (k, 3) that a frame does when it is told others; see `Estimator.scaled`."""
    s, c, w = values[WHEELS]
    x, y, turn = twist_of(wheels, twists).T
    scaled = np.empty(twists.shape)
    scaled[:, 0], scaled[:, 1], scaled[:, 2] = (1 + s) * x - c * y, (1 + s) * y + c * x, (1 + w) * turn
    return twist_of(inverse(wheels), scaled)
